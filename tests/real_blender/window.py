"""Inside Blender with a window: F12 ends by itself and makes a picture, Esc ends what would take for ever, with every integrator; so do the
buttons that bake, render strategies and compare. Real keys, by xdotool. Quits with exit status 0, or 1 after the first thing that went wrong."""

import sys
import tempfile
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from hands import ESCAPE, F12, in_window, press, renders, run, until

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


def button(own, name, how, samples, **options):
    """Presses it; by a button's own sign, what it started is at work when this returns."""
    own.samples = samples
    with in_window():
        found = getattr(bpy.ops.gi_engine, name)(how, **options)
    assert found == {"RUNNING_MODAL"}, (name, found)
    assert is_working(name)
    with in_window():
        assert not getattr(bpy.ops.gi_engine, name).poll(), f"{name} can be pressed twice"


def is_working(name):
    return getattr(bpy.types, "GI_ENGINE_OT_" + name).running


def cancelled(name):
    yield 1.0
    assert is_working(name)
    start = time.monotonic()
    press(ESCAPE)
    yield from until(lambda: not is_working(name), 20, f"{name}, Esc")
    print(f"window: {name}: stopped within {time.monotonic() - start:.1f} s", flush=True)


def bake(own):
    item = next(o for o in bpy.context.view_layer.objects if o.type == "MESH")
    for other in bpy.context.view_layer.objects:
        other.select_set(other == item)
    own.integrator, own.lightmap.width, own.lightmap.height, own.lightmap.folder = "path", 32, 32, ""
    before = {image.name for image in bpy.data.images}, item.data.uv_layers.keys()
    button(own, "bake_lightmap", "INVOKE_DEFAULT", 1_000_000)
    yield from cancelled("bake_lightmap")
    assert ({image.name for image in bpy.data.images}, item.data.uv_layers.keys()) == before, "something is left behind"
    button(own, "bake_lightmap", "INVOKE_DEFAULT", 2)
    yield from until(lambda: not is_working("bake_lightmap"), 60, "bake_lightmap")
    image = bpy.data.images[next(iter({image.name for image in bpy.data.images} - before[0]))]
    assert any(image.pixels[:]), "the lightmap is black"
    print(f"window: bake_lightmap: {image.name}", flush=True)


def show_strategies(own):
    own.integrator = "bdpt"
    with tempfile.TemporaryDirectory() as folder:
        button(own, "render_strategies", "EXEC_DEFAULT", 1_000_000, directory=folder)  # as the file browser calls it
        yield from cancelled("render_strategies")
        assert not list(Path(folder).iterdir()), "something is left behind"
        button(own, "render_strategies", "EXEC_DEFAULT", 1, directory=folder)
        yield from until(lambda: not is_working("render_strategies"), 90, "render_strategies")
        assert (Path(folder) / "weighted.png").exists()
        print(f"window: render_strategies: {len(list(Path(folder).iterdir()))} files", flush=True)


def compare(own):
    """To its end it shows two pictures beside each other, in a window of their own that is closed here."""
    settings, windows = own.compare, bpy.context.window_manager.windows
    with tempfile.TemporaryDirectory() as folder:
        settings.folder, settings.open_report, settings.seconds = folder, False, 300
        button(own, "compare", "INVOKE_DEFAULT", 2)
        yield from cancelled("compare")
        assert not list(Path(folder).iterdir()), "something is left behind"
        settings.seconds = 0.5
        button(own, "compare", "INVOKE_DEFAULT", 2)
        yield from until(lambda: not is_working("compare"), 200, "compare")
        yield from until(lambda: len(windows) == 2, 20, "the window of a comparison")
        yield 2
        areas = sorted(windows[1].screen.areas, key=lambda area: area.x)
        shown = [area.spaces.active.image.name for area in areas]
        print(f"window: compare: {shown}", flush=True)
        assert shown == ["Compare: Path Tracing", "Compare: Cycles"] and (Path(folder) / "report.html").exists()
    with bpy.context.temp_override(window=windows[1]):
        bpy.ops.wm.window_close()
    yield 1


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
    yield from bake(scene.gi_engine)
    yield from show_strategies(scene.gi_engine)
    yield from compare(scene.gi_engine)
    # And what was there before still works.
    yield from both_keys(scene.gi_engine, "path")


run(story())
