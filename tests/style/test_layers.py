"""The directions in which code may know other code: native includes, and who may import bpy."""

import ast
import re

import pytest

# Each folder of native/src may include itself and what stands before it, one way only.
NATIVE = {
    "core": set(),
    "shading": {"core"},
    "scene": {"core", "shading"},
    "film": {"core", "shading", "scene"},
    "lights": {"core", "shading", "scene"},
    "transport": {"core", "scene", "film", "shading", "lights"},
    "integrators": {"core", "scene", "film", "shading", "lights", "transport"},
    "render": {"core", "scene", "film", "shading", "lights", "transport", "integrators"},
    "bind": {"core", "scene", "film", "shading", "lights", "transport", "integrators", "render"},
}
# Programs are part of the scene, so scene stands above shading; but ops look up what the scene knows of a point.
READS_THE_SCENE = re.compile(r"shading/(ops_\w+\.cpp|object_space\.h)$")
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^">]+)[">]', re.M)

# What may import bpy (or Blender's other modules): the border with Blender.
MAY_USE_BLENDER = {
    "__init__", "engine", "session", "sync", "preferences", "properties", "bake", "strategies", "viewport", "headless", "info", "passes", "operators", "previews",
}  # fmt: skip
MAY_USE_BLENDER_FOLDERS = {"export", "ui", "compare"}
BLENDER = {"bpy", "bpy_extras", "bl_ui", "bl_math", "gpu", "gpu_extras", "mathutils", "idprop", "nodeitems_utils"}


def native_sources(root):
    found = sorted(p for p in (root / "native/src").rglob("*") if p.suffix in (".h", ".cpp"))
    assert found
    return found


def python_sources(root):
    found = sorted((root / "gi_engine").rglob("*.py"))
    assert found
    return found


def test_native_includes_go_one_way(root):
    wrong = []
    for path in native_sources(root):
        folder = path.relative_to(root / "native/src").parts[0]
        for quote, target in INCLUDE.findall(path.read_text()):
            other = target.split("/")[0]
            if other == "scene" and READS_THE_SCENE.search(path.as_posix()):
                continue
            if quote == '"' and other in NATIVE and other != folder and other not in NATIVE[folder]:
                wrong.append(f"{path.relative_to(root)} includes {target}")
    assert not wrong, "\n".join(wrong)


def test_project_includes_name_the_folder(root):
    """Every quoted include is a path from native/src, so that the test above sees it."""
    wrong = []
    for path in native_sources(root):
        for quote, target in INCLUDE.findall(path.read_text()):
            if quote == '"' and not (root / "native/src" / target).is_file():
                wrong.append(f"{path.relative_to(root)} includes {target}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("header", "folders"),
    [("nanobind", {"bind"}), ("Python.h", {"bind"}), ("scene/embree", {"scene"}), ("embree4", {"scene"})],
)
def test_libraries_stay_in_their_folder(root, header, folders):
    wrong = []
    for path in native_sources(root):
        folder = path.relative_to(root / "native/src").parts[0]
        includes = [target for _, target in INCLUDE.findall(path.read_text())]
        if folder not in folders and any(header in target for target in includes):
            wrong.append(str(path.relative_to(root)))
    assert not wrong, wrong


def test_an_integrator_knows_no_other_and_no_lobe(root):
    wrong = []
    for path in (root / "native/src/integrators").glob("*.cpp"):
        for _, target in INCLUDE.findall(path.read_text()):
            other = target.startswith("integrators/") and target != "integrators/integrator.h"
            own = target == f"integrators/{path.stem}.h"
            if (other and not own) or target.startswith(("shading/lobes/", "shading/ops/")):
                wrong.append(f"{path.name} includes {target}")
    assert not wrong, "\n".join(wrong)


def imported(path):
    """The top-level modules that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module.split(".")[0]


def test_blender_stays_at_the_border(root):
    wrong = []
    for path in python_sources(root):
        inside = path.relative_to(root / "gi_engine")
        allowed = inside.parts[0] in MAY_USE_BLENDER_FOLDERS or (
            len(inside.parts) == 1 and inside.stem in MAY_USE_BLENDER
        )
        used = BLENDER & set(imported(path))
        if used and not allowed:
            wrong.append(f"{inside}: {', '.join(sorted(used))}")
    assert not wrong, "\n".join(wrong)


def test_only_native_imports_the_compiled_part(root):
    """Statically or through importlib; a missing build then gives one clear message."""
    users = {
        p.name
        for p in python_sources(root)
        if '"gi_engine_native"' in p.read_text() or "gi_engine_native" in set(imported(p))
    }
    assert users <= {"native.py"}
