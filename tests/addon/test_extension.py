"""The add-on as an extension: Blender builds, installs, enables, renders with and disables it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

SCRIPT = """
import os, sys
import bpy
assert bpy.ops.extensions.package_install_files(repo="user_default", filepath=sys.argv[1], enable_on_install=True) == {"FINISHED"}
scene = bpy.context.scene
scene.render.engine = "GI_ENGINE"
scene.gi_engine.samples, scene.render.resolution_percentage = 1, 1
assert bpy.ops.render.render() == {"FINISHED"}
bpy.ops.preferences.addon_disable(module="bl_ext.user_default.gi_engine")
assert scene.render.engine != "GI_ENGINE" and not hasattr(bpy.types.Scene, "gi_engine")
print("rendered")
sys.stdout.flush()
os._exit(0)
"""


@pytest.fixture(scope="module")
def package(root, tmp_path_factory) -> Path:
    """The extension's zip, built by Blender's own tool."""
    folder = tmp_path_factory.mktemp("extension")
    source = folder / "source"
    shutil.copytree(root / "gi_engine", source, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("blender_manifest.toml", "LICENSE"):
        shutil.copy(root / name, source)
    scripts = Path(bpy.utils.resource_path("LOCAL")) / "scripts"
    tool = scripts / "addons_core/bl_pkg/cli/blender_ext.py"
    for command in (["validate", source], ["build", "--source-dir", source, "--output-dir", folder]):
        subprocess.run([sys.executable, tool, *command], check=True, capture_output=True)
    (found,) = folder.glob("gi_engine-*.zip")
    return found


def test_installs_renders_and_leaves(package, tmp_path):
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, package],
        env=environment,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=120,
    )
    assert "rendered" in done.stdout, done.stdout + done.stderr
