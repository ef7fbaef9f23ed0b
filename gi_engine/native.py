"""The only import of the compiled extension. Where it is missing, everything but rendering still works."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import os
from pathlib import Path

EMBREE_VARIABLE = "GI_ENGINE_EMBREE"  # environment: another Embree library to load
EMBREE_FILES = ("../embreex.libs/libembree4*.so*", "../embreex.libs/embree4*.dll", ".dylibs/libembree4*.dylib")


class NativeMissing(RuntimeError):
    """The compiled part of GI Engine cannot be loaded."""


@functools.cache
def module():
    """The extension module. Raises NativeMissing, saying why."""
    try:
        return importlib.import_module("gi_engine_native")
    except ImportError as error:
        raise NativeMissing(
            f"GI Engine's compiled part (gi_engine_native) cannot be loaded: {error}. Install the add-on's package for this platform."
        ) from error


def available() -> bool:
    try:
        module()
    except NativeMissing:
        return False
    return True


def integrators() -> list[dict]:
    """Descriptors of the integrators; none without the compiled part."""
    return module().integrators() if available() else []


@functools.cache
def embree_path() -> str:
    """The Embree library of the installed embreex package, never Blender's own copy. Raises NativeMissing."""
    chosen = os.environ.get(EMBREE_VARIABLE)
    if chosen:
        return chosen
    spec = importlib.util.find_spec("embreex")  # finds it without importing
    if spec is None or not spec.origin:
        raise NativeMissing("the package embreex, which brings the Embree library, is not installed")
    package = Path(spec.origin).parent
    for pattern in EMBREE_FILES:
        folder, name = os.path.split(pattern)
        for found in sorted((package / folder).resolve().glob(name)):
            return str(found)
    raise NativeMissing(f"no Embree library beside {package}: reinstall the package embreex")


def build_scene(scene, threads: int = 0, movable: bool = False, before=None):
    """The native scene of a scene_data.Scene. Raises ValueError naming what is wrong with it.

    `movable`: for a scene that is edited; what `before`, one like it, made of the same Mesh objects serves again."""
    return module().Scene(scene, embree=embree_path(), threads=threads, movable=movable, before=before)
