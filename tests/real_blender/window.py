"""Inside Blender with a window: F12 ends by itself and makes a picture, Esc ends what would take for ever, with every integrator.
Real keys, by xdotool. Quits with exit status 0, or 1 after the first thing that went wrong."""

import os
import subprocess
import sys
import time
import traceback

import bpy

F12, ESCAPE = "96", "Escape"  # by key code: xdotool's own F12 comes with a wrong Alt


def press(code):
    subprocess.run(["xdotool", "mousemove", "400", "400", "sleep", "0.2", "key", code], check=True)


def renders():
    return bpy.app.is_job_running("RENDER")


def until(test, seconds, what):
    end = time.monotonic() + seconds
    while not test():
        if time.monotonic() > end:
            raise TimeoutError(f"{what}: waited {seconds} s")
        yield 0.05


ended = []  # how each render did, in the order of their ends


def both_keys(own, chosen):
    ended.clear()
    own.integrator = chosen
    own.samples = 2
    press(F12)
    yield from until(lambda: ended and not renders(), 60, f"{chosen}, F12")
    own.samples = 1_000_000
    press(F12)
    yield from until(renders, 20, f"{chosen}, F12 again")
    yield 0.5
    start = time.monotonic()
    press(ESCAPE)
    yield from until(lambda: len(ended) == 2 and not renders(), 20, f"{chosen}, Esc")
    print(f"window: {chosen}: {ended[0]}, {ended[1]} within {time.monotonic() - start:.1f} s", flush=True)
    assert ended == ["done", "stopped"], (chosen, ended)


def story():
    scene = bpy.context.scene
    bpy.context.preferences.view.render_display_type = "AREA"
    scene.render.engine = "GI_ENGINE"
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.gi_engine.is_own = True
    bpy.app.handlers.render_complete.append(lambda *_: ended.append("done"))
    bpy.app.handlers.render_cancel.append(lambda *_: ended.append("stopped"))
    yield 2
    for item in scene.gi_engine.bl_rna.properties["integrator"].enum_items:
        yield from both_keys(scene.gi_engine, item.identifier)


steps = story()


def step():
    try:
        return next(steps)
    except StopIteration:
        code = 0
    except Exception:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


bpy.app.timers.register(step, first_interval=1.0, persistent=True)
