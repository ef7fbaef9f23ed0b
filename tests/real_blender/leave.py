"""Inside Blender with a window: it is quit while the engine is at work, and ends with status 0, not by a crash.

blender FILE.blend --python leave.py -- f12|viewport|window|baking
"""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from hands import F12, in_window, leave, press, renders, until, viewport

WHILE = sys.argv[sys.argv.index("--") + 1]


def story():
    scene = bpy.context.scene
    bpy.context.preferences.view.render_display_type = "AREA"
    bpy.context.preferences.view.use_save_prompt = False
    scene.render.engine = "GI_ENGINE"
    scene.cycles.samples = scene.cycles.preview_samples = 1_000_000
    yield 1
    if WHILE == "f12":
        press(F12)
        yield from until(renders, 60, "F12")
    elif WHILE == "baking":
        item = next(o for o in bpy.context.view_layer.objects if o.type == "MESH")
        for other in bpy.context.view_layer.objects:
            other.select_set(other == item)
        with in_window():
            bpy.ops.gi_engine.bake_lightmap("INVOKE_DEFAULT")
    else:
        viewport().shading.type = "RENDERED"
    yield 1
    if WHILE == "window":
        with in_window():
            bpy.ops.wm.window_close()
    with in_window():
        bpy.ops.wm.quit_blender()
    yield 20
    leave(4)  # it should have been gone


def step(going=story()):  # noqa: B008
    try:
        return next(going)
    except Exception as error:
        print(error, file=sys.stderr)
        leave(1)


bpy.app.timers.register(step, first_interval=1.0, persistent=True)
