"""Inside Blender with a window: what people do to an engine at work, again and again. F12 and Esc, another engine, another file, undo, a view that
is turned; then memory must be what it was once all was warm, and the window must have answered all the time.

    blender FILE.blend --python storm.py -- [TIMES] [ENGINE] [PART…]     TIMES of each (10); ENGINE: GI_ENGINE, or CYCLES to see Blender's own
                                                                         share; PARTS: keys of PARTS below, all unless told otherwise
"""

import random
import sys
import tempfile
import time
from pathlib import Path

import bpy
from mathutils import Euler

sys.path.insert(0, str(Path(__file__).parent))
from hands import ESCAPE, F12, Ticks, engine_module, in_window, memory, press, renders, run, until, viewport

given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
TIMES = int(given[0]) if given else 10
ENGINE = given[1] if len(given) > 1 else "GI_ENGINE"
MOST_GROWTH = 20.0  # MB, after warm-up
ENOUGH = 30  # times, to be warm by the end of the first third
MOST_HELD = 0.5  # seconds, on a machine that does other things as well
INTEGRATORS = ("path", "bdpt", "photon_map", "irradiance_cache", "vcm")
chance = random.Random(7)
failures = []


def again(name, once):
    """`once` so many times; a third of them warm up."""
    sizes = []
    start = time.monotonic()
    for number in range(TIMES):
        yield from once(number)
        sizes.append(memory())
    warm = max(1, TIMES // 3)
    few = max(1, TIMES // 10)
    # What is held at the moment goes with the integrator at work; what leaks raises the least of it, too.
    growth = min(sizes[-few:]) - min(sizes[warm : warm + few])
    seconds = time.monotonic() - start
    print(
        f"storm: {ENGINE}: {name}: {TIMES} times in {seconds:.0f} s, {growth:+.1f} MB, {sizes[-1]:.0f} MB", flush=True
    )
    if TIMES >= ENOUGH and growth > MOST_GROWTH:
        failures.append(f"{name}: {growth:.1f} MB more after warm-up: {[round(size) for size in sizes]}")


def prepare():
    scene = bpy.context.scene
    scene.render.engine = ENGINE
    scene.render.resolution_x = scene.render.resolution_y = 128
    scene.render.resolution_percentage = 100
    scene.cycles.samples = 1_000_000
    scene.cycles.preview_samples = 64
    scene.cycles.use_denoising = scene.cycles.use_preview_denoising = False
    if ENGINE == "GI_ENGINE":
        scene.gi_engine.is_own = False
    return scene


def choose(number):
    if ENGINE == "GI_ENGINE":
        bpy.context.scene.gi_engine.integrator = INTEGRATORS[number % len(INTEGRATORS)]


def f12_and_esc(number):
    choose(number)
    press(F12)
    yield from until(renders, 60, "F12")
    yield chance.choice((0.0, 0.05, 0.3, 0.8))
    while renders():
        press(ESCAPE)
        end = time.monotonic() + 20
        while renders() and time.monotonic() < end:
            yield 0.02


def shown():
    """A viewport shows a picture of the engine's; for others, nobody knows."""
    return ENGINE != "GI_ENGINE" or any(view.refiner.picture for view in list(engine_module("viewport")._open))


def rendered_view():
    viewport().shading.type = "RENDERED"
    yield from until(shown, 60, "a picture in the viewport")


def other_engine(number):
    scene = bpy.context.scene
    choose(number)
    scene.render.engine = ENGINE
    yield from rendered_view()
    scene.render.engine = chance.choice(["BLENDER_WORKBENCH", "CYCLES" if ENGINE != "CYCLES" else "BLENDER_WORKBENCH"])
    yield chance.choice((0.05, 0.3))
    scene.render.engine = ENGINE
    yield chance.choice((0.02, 0.1))
    viewport().shading.type = "SOLID"
    yield 0.05


def other_file(number):
    """While the viewport is at work."""
    yield from rendered_view()
    with in_window():
        bpy.ops.wm.open_mainfile(filepath=str(files[number % len(files)]), load_ui=False)
    yield 0.1


def undo_storm(number):
    viewport().shading.type = "RENDERED"
    choose(number)
    item = next(o for o in bpy.context.view_layer.objects if o.type == "MESH")
    name = item.name
    for k in range(8):
        item = bpy.data.objects[name]
        item.location.x += 0.01 * (k - 3.5)
        item.hide_render = False
        with in_window("VIEW_3D"):
            bpy.ops.ed.undo_push(message="storm")
        yield chance.choice((0.0, 0.02, 0.1))
    for _ in range(8):
        with in_window("VIEW_3D"):
            bpy.ops.ed.undo()
        yield chance.choice((0.0, 0.02))
    for _ in range(4):
        with in_window("VIEW_3D"):
            bpy.ops.ed.redo()
        yield 0.0
    yield from until(shown, 60, "a picture after undo")


def turn_the_view():
    """The window goes on answering: as well as where nothing is rendered, for a virtual screen is drawn by the processor."""
    for shading in ("SOLID", "RENDERED"):
        viewport().shading.type = shading
        yield 0.5
        ours = timed(("draw", "update")) if shading == "RENDERED" else {}
        ticks = Ticks()
        for number in range(min(TIMES, 10)):
            choose(number)
            with in_window("VIEW_3D"):
                region = bpy.context.region_data
            for _ in range(10):
                region.view_rotation.rotate(Euler((0, 0, 0.05)))
                region.update()
                yield 0.03
            yield 0.3
        words = "".join(
            f"; {name} {len(took)} times, longest {1e3 * max(took, default=0):.0f} ms" for name, took in ours.items()
        )
        print(f"storm: {ENGINE}: turning the view, {shading.lower()}: {ticks.end()}{words}\n{ticks.where}", flush=True)
        slow = max((max(took, default=0) for took in ours.values()), default=0)
        if slow > MOST_HELD:
            failures.append(f"the engine held the window for {slow:.2f} s")


def timed(names):
    """Seconds of each call of these methods of the engine's viewports, from now on."""
    if ENGINE != "GI_ENGINE":
        return {}
    cls, found = engine_module("viewport").Viewport, {name: [] for name in names}
    for name, took in found.items():
        setattr(cls, name, with_times(getattr(cls, name), took))
    return found


def with_times(function, took):
    def wrapped(*words):
        start = time.monotonic()
        try:
            return function(*words)
        finally:
            took.append(time.monotonic() - start)

    return wrapped


def add_on(number):
    """Off and on, while a picture is rendered or the viewport is at work."""
    scene = bpy.context.scene
    choose(number)
    if number % 2:
        with in_window():  # no key: what pops up about the render that failed would take it
            bpy.ops.render.render("INVOKE_DEFAULT")
        yield from until(renders, 60, "F12")
    else:
        yield from rendered_view()
    module = next(name for name in bpy.context.preferences.addons.keys() if name.endswith("gi_engine"))
    bpy.ops.preferences.addon_disable(module=module)
    yield from until(lambda: not renders(), 20, "the end of a render whose engine is gone")
    viewport().shading.type = "SOLID"
    bpy.ops.preferences.addon_enable(module=module)
    scene.render.engine = ENGINE
    yield 0.1


files = []


def renders_and_stops():
    bpy.context.preferences.view.render_display_type = "AREA"
    yield from again("F12 and Esc", f12_and_esc)
    with in_window():
        bpy.context.area.type = "VIEW_3D"  # the render took its place
    bpy.context.preferences.view.render_display_type = "NONE"
    yield 1


def switches():
    if ENGINE == "GI_ENGINE":
        yield from again("add-on off and on", add_on)


PARTS = {
    "f12": renders_and_stops,
    "turn": turn_the_view,
    "undo": lambda: again("undo and redo", undo_storm),
    "engines": lambda: again("another engine", other_engine),
    "files": lambda: again("another file", other_file),
    "add-on": switches,
}


def story():
    scene = prepare()
    preferences = bpy.context.preferences
    preferences.view.render_display_type = "NONE"
    preferences.edit.undo_steps = 8
    yield 2
    with tempfile.TemporaryDirectory() as folder:
        files.extend(Path(folder) / f"{k}.blend" for k in range(2))
        for k, path in enumerate(files):
            scene.gi_engine.integrator = INTEGRATORS[k]
            bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
        for part in given[2:] or PARTS:
            yield from PARTS[part]()
    assert not failures, "\n".join(failures)


run(story())
