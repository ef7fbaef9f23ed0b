"""Inside Blender: Cycles, GI Engine and Cycles again in one process; the two Embrees do not meet. Exit status 0 where all is well."""

import os
import sys
import tempfile
import traceback
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np

EMBREE = "4.4.0"  # of the package embreex, whatever Blender itself is linked to


def picture(engine, folder):
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.render.filepath = str(Path(folder) / engine)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath + scene.render.file_extension)
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    bpy.data.images.remove(image)
    return pixels


def embree():
    """What the engine says that it uses."""
    name = next(name for name in sys.modules if name.endswith("gi_engine.native"))
    native, data = import_module(name), import_module(name.removesuffix("native") + "scene_data")
    return native.build_scene(data.Scene()).embree


def main():
    scene = bpy.context.scene
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    scene.render.resolution_x = scene.render.resolution_y = 48
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 64, False, False
    used = embree()
    print(f"both: {used}", flush=True)
    assert EMBREE in used, used
    with tempfile.TemporaryDirectory() as folder:
        before, ours, after = (picture(engine, folder) for engine in ("CYCLES", "GI_ENGINE", "CYCLES"))
    assert np.array_equal(before, after), "Cycles' picture has changed"
    ratio = ours.mean() / before.mean()
    print(f"both: mean over Cycles' {ratio:.3f}", flush=True)
    assert 0.95 < ratio < 1.05, ratio


try:
    main()
except BaseException:
    traceback.print_exc()
    sys.stderr.flush()
    os._exit(1)
