"""Switching the whole add-on on and off leaves nothing behind: in a process of its own, where nothing else has registered."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

SCRIPT = """
import gc, json, logging, os, resource, sys, threading
import bpy
import gi_engine
from gi_engine import refine

def sorted_names(items):
    return sorted(str(getattr(item, "__name__", item)) for item in items)

def state():
    gc.collect()
    handlers = {name: sorted_names(found) for name in dir(bpy.app.handlers)
                if isinstance(found := getattr(bpy.app.handlers, name), list)}
    panels = {name: sorted(engines) for name in dir(bpy.types)
              if isinstance(engines := getattr(getattr(bpy.types, name), "COMPAT_ENGINES", None), set)}
    owners = (bpy.types.ID, *bpy.types.ID.__subclasses__(), bpy.types.ViewLayer, bpy.types.WindowManager)
    return {
        "handlers": handlers,
        "panels": panels,
        "types": dir(bpy.types),
        "classes": sorted_names(bpy.types.bpy_struct.__subclasses__()),
        "properties": {owner.__name__: sorted({*dir(owner), *owner.bl_rna.properties.keys()}) for owner in owners},
        "operators": dir(bpy.ops.gi_engine),
        "threads": sorted_names(t.name for t in threading.enumerate()),
        "log": [sorted_names(logging.getLogger("gi_engine").handlers), logging.getLogger("gi_engine").level],
        "engine": bpy.context.scene.render.engine,
    }

def memory():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20

def render():
    scene = bpy.context.scene
    scene.render.engine = "GI_ENGINE"
    scene.gi_engine.samples = 1
    scene.render.resolution_x = scene.render.resolution_y = 16
    bpy.ops.render.render()
    viewer = refine.Refiner(lambda: True)  # as a viewport has one; closed by whoever closes the viewport
    viewer.close()

before = state()
after, sizes = {}, []
for cycle in range(int(sys.argv[1])):
    gi_engine.register()
    assert "GI_ENGINE" in bpy.types.RENDER_PT_output.COMPAT_ENGINES
    render()
    gi_engine.unregister()
    bpy.context.scene.render.engine = "CYCLES"
    if cycle in (0, 1, int(sys.argv[1]) - 1):
        after[cycle] = state()
    gc.collect()
    sizes.append(memory())
print("FOUND " + json.dumps([before, after, sizes]))
sys.stdout.flush()
os._exit(0)
"""
CYCLES = 12
ENOUGH = 3  # until everything was loaded


@pytest.fixture(scope="module")
def found(root):
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(CYCLES)], env=os.environ | {"PYTHONPATH": str(root)}, capture_output=True, text=True, timeout=300
    )  # fmt: skip
    lines = [line for line in done.stdout.splitlines() if line.startswith("FOUND ")]
    assert lines, done.stdout + done.stderr
    assert "Traceback" not in done.stderr, done.stderr
    return json.loads(lines[0].removeprefix("FOUND "))


@pytest.mark.parametrize("cycle", [0, 1, CYCLES - 1])
def test_nothing_is_left(found, cycle):
    before, after, _ = found
    before = before | {"engine": "CYCLES"}
    for what, value in before.items():
        assert after[str(cycle)][what] == value, what


def test_memory_does_not_grow(found):
    sizes = found[2]
    assert sizes[-1] - sizes[ENOUGH - 1] < 2.0, sizes  # MB in nine cycles, a render in each
