"""Inside Blender with a window: Rendered viewports as people use them. Nothing begins anew without cause; playback, local view, render region,
mode switches, hiding, undo; two viewports at once, one of them closed; pause; a denoised preview where Blender has a denoiser. Pictures are
compared with those of a viewport that was opened afresh, which knows of nothing that went before.

    blender FILE.blend --python views.py -- [PART…]     names of the functions below, all PARTS unless told otherwise
"""

import os
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler

sys.path.insert(0, str(Path(__file__).parent))
from hands import Ticks, engine_module, in_window, picture, run, until

SETTLE = 120  # seconds, at most
FRAMES = 24


def views():
    """The viewports that are open and look Rendered, those on the left first."""
    areas = [a for window in bpy.context.window_manager.windows for a in window.screen.areas if a.type == "VIEW_3D"]
    return sorted((a for a in areas if a.spaces.active.shading.type == "RENDERED"), key=lambda a: a.x)


def ours():
    return [view for view in list(engine_module("viewport")._open) if view.job]


def of(area):
    """The engine's part of a viewport: the one whose picture is as large."""
    region = next(r for r in area.regions if r.type == "WINDOW")
    fits = [v for v in ours() if (v.job.film.width, v.job.film.height) == (region.width, region.height)]
    assert len(fits) == 1, f"{len(fits)} viewports of {region.width} x {region.height}"
    return fits[0]


def is_settled(view):
    shown, job = view.refiner.picture, view.job
    assert not view.failure and not view.refiner.error, view.failure or view.refiner.error
    return shown is not None and shown.job is job and shown.samples == job.settings.samples


def settled(what):
    """Waits until all viewports have all samples, and for a while nothing begins anew."""
    yield 0.5  # until Blender has drawn
    while True:
        yield from until(lambda: ours() and all(map(is_settled, ours())), SETTLE, what)
        begun = starts()
        yield 0.5
        if starts() == begun and all(map(is_settled, ours())):
            return


def starts():
    return sum(view.refiner.starts for view in ours())


def pixels():
    (view,) = ours()
    return view.refiner.picture.pixels[..., :3].copy()


def as_if_opened_afresh(what):
    """What is shown is what a viewport shows that reads everything anew."""
    yield from settled(what)
    before = pixels()
    space = views()[0].spaces.active
    space.shading.type = "SOLID"
    yield from until(lambda: not ours(), 20, "the end of a viewport")
    space.shading.type = "RENDERED"
    yield from settled(what)
    after = pixels()
    assert before.shape == after.shape, (what, before.shape, after.shape)
    assert np.allclose(before, after, atol=1e-4), f"{what}: a fresh viewport differs by {np.abs(before - after).max()}"
    print(f"views: {what}: as if opened afresh", flush=True)


def differ(a, b):
    """Visibly, in as many pixels as an object covers."""
    return (np.abs(a - b).max(-1) > 0.02).mean() > 0.002


def meshes():
    return [o for o in bpy.context.view_layer.objects if o.type == "MESH"]


def edit(text, change):
    """As an operator would do it, with its step of undo."""
    change()
    with in_window("VIEW_3D"):
        bpy.ops.ed.undo_push(message=text)


def begins_anew_but_for_cause():
    yield from settled("the first picture")
    begun, first = starts(), pixels()
    assert first.mean() > 0.01, "the picture is black"
    item = meshes()[0]
    space, layer, scene = views()[0].spaces.active, bpy.context.view_layer, bpy.context.scene
    for what, change in {
        "drawn again": lambda: views()[0].tag_redraw(),
        "selected": lambda: item.select_set(not item.select_get()),
        "made active": lambda: setattr(layer.objects, "active", item),
        "without overlays": lambda: setattr(space.overlay, "show_overlays", False),
        "with overlays": lambda: setattr(space.overlay, "show_overlays", True),
        "end of the animation": lambda: setattr(scene, "frame_end", 99),
        "samples of the final picture": lambda: setattr(scene.gi_engine, "samples", 99),
    }.items():
        edit("no change of the picture", change)
        yield 0.6
        assert starts() == begun, f"{what}: began anew without cause"
    yield from settled("what changes nothing")
    assert starts() == begun
    assert np.array_equal(pixels(), first)
    print("views: begins anew only for a cause", flush=True)


def played(frames):
    """The gaps between ticks while an animation is played, until ten frames were shown; the frames go into the list."""
    note = lambda scene, _: frames.append(scene.frame_current)  # noqa: E731
    bpy.app.handlers.frame_change_post.append(note)
    ticks = Ticks()
    with in_window("VIEW_3D"):
        bpy.ops.screen.animation_play()
    yield from until(lambda: len(set(frames)) > 10, 60, "frames of the animation")
    yield 2
    with in_window("VIEW_3D"):
        bpy.ops.screen.animation_cancel(restore_frame=False)
    bpy.app.handlers.frame_change_post.remove(note)
    print(f"views: playback, {views() and 'rendered' or 'solid'}: {len(frames)} frames, {ticks.end()}", flush=True)
    return ticks


def play():
    """The window goes on answering as it does in Solid shading, pictures come meanwhile, and the last frame's is right."""
    item, scene = meshes()[0], bpy.context.scene
    scene.frame_start, scene.frame_end = 1, FRAMES
    for frame, x in ((1, 0.0), (FRAMES, 0.4)):
        item.location.x = x
        item.keyframe_insert("location", frame=frame)
    space = views()[0].spaces.active
    space.shading.type = "SOLID"
    yield 1
    plain = yield from played([])
    scene.frame_set(1)
    space.shading.type = "RENDERED"
    yield from settled("frame 1")
    (view,) = ours()
    before, shown, tell = pixels(), [], view.refiner.redraw
    view.refiner.redraw = lambda: shown.append(view.refiner.picture) or tell()
    ticks = yield from played([])
    pictures = len({id(p) for p in shown if p})
    print(f"views: playback: {pictures} pictures", flush=True)
    assert pictures > 5
    assert max(ticks.gaps) < 2 * max(plain.gaps) + 0.5, f"the window did not answer: {ticks.where}"
    if scene.frame_current < FRAMES // 4:  # hardly anything has moved
        scene.frame_set(FRAMES // 2)
    yield from as_if_opened_afresh(f"frame {scene.frame_current}")
    assert differ(pixels(), before)
    item.animation_data_clear()
    item.location.x = 0
    scene.frame_set(1)


def local_view():
    yield from settled("all objects")
    before, item = pixels(), meshes()[-1]
    for other in bpy.context.view_layer.objects:
        other.select_set(other == item)
    bpy.context.view_layer.objects.active = item
    with in_window("VIEW_3D"):
        bpy.ops.view3d.localview(frame_selected=False)
    yield from settled("local view")
    alone = pixels()
    (view,) = ours()
    names = {mesh.name for mesh in view.job.scene.meshes}
    picture("local_view", views()[0])
    assert len(view.job.scene.instances) == 1 and names == {item.data.name}, names
    assert differ(alone, before)
    with in_window("VIEW_3D"):
        bpy.ops.view3d.localview(frame_selected=False)
    yield from settled("all objects again")
    assert np.array_equal(pixels(), before)
    print("views: local view and back", flush=True)


def region():
    """What is in it is what was there before; a border of the camera's frame likewise."""
    yield from settled("without a region")
    before, space, render = pixels(), views()[0].spaces.active, bpy.context.scene.render
    height, width, _ = before.shape
    space.use_render_border = True
    space.render_border_min_x, space.render_border_max_x = 0.25, 0.6
    space.render_border_min_y, space.render_border_max_y = 0.5, 0.75
    yield from settled("a region")
    (view,) = ours()
    x0, y0, x1, y1 = view.refiner.picture.region
    assert abs(x0 - 0.25 * width) <= 1 and abs(y1 - 0.75 * height) <= 1 and pixels().shape == (y1 - y0, x1 - x0, 3)
    assert np.allclose(pixels(), before[y0:y1, x0:x1], atol=1e-4)
    picture("region", views()[0])
    yield from as_if_opened_afresh("a region")
    space.use_render_border = False
    with in_window("VIEW_3D"):
        bpy.context.region_data.view_perspective = "CAMERA"
    yield from settled("the camera's view")
    before = pixels()
    render.use_border, render.use_crop_to_border = True, False
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.1, 0.5, 0.2, 0.9
    yield from settled("a border of the camera")
    (view,) = ours()
    x0, y0, x1, y1 = view.refiner.picture.region
    assert np.allclose(pixels(), before[y0:y1, x0:x1], atol=1e-4) and (x1 - x0) < 0.5 * width
    picture("camera_border", views()[0])
    render.use_border = False
    with in_window("VIEW_3D"):
        bpy.context.region_data.view_perspective = "PERSP"
    yield from settled("without a border")
    print("views: render region and the camera's border", flush=True)


def modes_and_undo():
    yield from settled("object mode")
    before, item = pixels(), meshes()[0]
    bpy.context.view_layer.objects.active = item
    with in_window("VIEW_3D"):
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.translate(value=(0, 0, 0.3))
    yield from settled("edit mode")
    edited = pixels()
    assert differ(edited, before), "an edit is not shown"
    with in_window("VIEW_3D"):
        bpy.ops.object.mode_set(mode="OBJECT")
    yield from as_if_opened_afresh("after edit mode")
    assert np.allclose(pixels(), edited, atol=1e-4)
    with in_window("VIEW_3D"):
        bpy.ops.ed.undo_push(message="moved")
        bpy.ops.ed.undo()
    yield from settled("undo")
    assert bpy.context.mode == "OBJECT"
    assert np.allclose(pixels(), before, atol=1e-4), "undo is not shown"
    edit("hide", lambda: meshes()[0].hide_set(True))
    yield from as_if_opened_afresh("hidden")
    assert differ(pixels(), before)
    edit("show", lambda: next(o for o in bpy.context.scene.objects if o.hide_get()).hide_set(False))
    yield from settled("shown again")
    assert np.allclose(pixels(), before, atol=1e-4)
    print("views: edit mode, undo, hiding", flush=True)


def paused():
    scene = bpy.context.scene
    yield from settled("before the pause")
    before = pixels()
    begun = starts()
    for pause in (True, False, True):
        scene.gi_engine.preview_pause = pause
        yield 0.5
    assert starts() == begun, "a pause begins anew"
    edit("while paused", lambda: setattr(meshes()[0], "location", (0.3, 0, 0)))
    yield 1.5
    (view,) = ours()
    assert np.array_equal(pixels(), before), "a paused viewport goes on"
    words = view.status(view.refiner.picture)
    assert words.startswith("Paused"), words
    picture("paused", views()[0])
    scene.gi_engine.preview_pause = False
    yield from settled("after the pause")
    assert differ(pixels(), before)
    edit("back", lambda: setattr(meshes()[0], "location", (0, 0, 0)))
    yield from settled("back")
    print("views: paused", flush=True)


def several():
    """Each has its own view; an edit is seen in both, a view that is turned only in its own. One is closed while it is at work."""
    with in_window("VIEW_3D"):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.3)
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "VIEW_3D":
            area.spaces.active.shading.type = "RENDERED"  # which a copy is not
    yield 1
    narrow, wide = views()
    wide.spaces.active.region_3d.view_rotation.rotate(Euler((0, 0, 0.1)))
    yield from settled("two viewports")
    first, second = of(narrow), of(wide)
    pictures = [v.refiner.picture.pixels[..., :3].copy() for v in (first, second)]
    assert all(p.mean() > 0.01 for p in pictures)
    begun = [v.refiner.starts for v in (first, second)]
    wide.spaces.active.region_3d.view_rotation.rotate(Euler((0, 0, 0.05)))
    yield from settled("one is turned")
    assert first.refiner.starts == begun[0] and second.refiner.starts == begun[1] + 1
    assert np.array_equal(first.refiner.picture.pixels[..., :3], pictures[0])
    edit("an edit", lambda: setattr(meshes()[0], "location", (0.2, 0.1, 0.1)))
    yield from settled("an edit in two viewports")
    assert [v.refiner.starts for v in (first, second)] == [begun[0] + 1, begun[1] + 2]
    assert differ(first.refiner.picture.pixels[..., :3], pictures[0])
    picture("several")
    scene = bpy.context.scene
    scene.gi_engine.preview_pause = True
    yield 1
    picture("paused_narrow", narrow)
    scene.gi_engine.preview_pause = False
    scene.gi_engine.preview_samples = 1 << 20
    yield 1
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=narrow):
        bpy.ops.screen.area_close()
    scene.gi_engine.preview_samples = 1
    yield from until(lambda: len(ours()) == 1, 20, "the end of the viewport that was closed")
    edit("back", lambda: setattr(meshes()[0], "location", (0, 0, 0)))
    yield from as_if_opened_afresh("one of two is left")
    print("views: two at once, one closed", flush=True)


def roughness(image):
    """Of neighbouring pixels: their mean difference, which noise makes large."""
    return float(np.abs(np.diff(image, axis=1)).mean())


def denoised():
    scene = bpy.context.scene
    yield from settled("noisy")
    noisy = roughness(pixels())
    picture("noisy", views()[0])
    (view,) = ours()
    scene.gi_engine.use_preview_denoising = True
    yield from until(lambda: view.job.settings.denoising, 20, "denoising asked for")
    yield from settled("asked to be denoised")
    if os.environ.get("DENOISER"):
        yield from until(lambda: view.refiner.picture.clean, SETTLE, "denoised")
        yield 1
    words = view.status(view.refiner.picture)
    picture("denoised", views()[0])
    if os.environ.get("DENOISER"):
        assert not view.refiner.lacks_denoiser and "denoiser" not in words, words
        assert roughness(pixels()) < 0.5 * noisy, (roughness(pixels()), noisy)
    else:
        assert "No denoiser" in words, words
    print(f"views: denoised preview: roughness {roughness(pixels()):.4f}, was {noisy:.4f}; {words}", flush=True)
    scene.gi_engine.use_preview_denoising = False


PARTS = (begins_anew_but_for_cause, play, local_view, region, modes_and_undo, paused, denoised, several)


def story():
    scene = bpy.context.scene
    scene.render.engine = "GI_ENGINE"
    own = scene.gi_engine
    own.is_own, own.integrator, own.preview_samples = True, "path", 1
    yield 1
    with in_window("VIEW_3D"):
        space, view = bpy.context.area.spaces.active, bpy.context.region_data
        view.view_matrix = scene.camera.matrix_world.inverted()
        view.view_perspective = "PERSP"
    space.shading.type = "RENDERED"
    with in_window("VIEW_3D"):
        bpy.ops.ed.undo_push(message="begin")
    given = [globals()[name] for name in sys.argv[sys.argv.index("--") + 1 :]]
    for part in given or PARTS:
        yield from part()


run(story())
