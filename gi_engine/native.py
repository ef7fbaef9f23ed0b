"""The only import of the compiled extension. Where it is missing, everything but rendering still works."""

from __future__ import annotations

import functools
import importlib


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
