"""Whole renders by the operator: where pixels land, what passes hold, how failing and stopping look."""

from __future__ import annotations

import threading
import time
from operator import attrgetter

import bpy
import numpy as np
import pytest

from gi_engine import control, engine, native
from gi_engine.passes import PASSES

from .conftest import add, grid, mesh

SQUARE = ((-50, -50, 0), (50, -50, 0), (50, 50, 0), (-50, 50, 0))
SCALE = 4.0  # metres across the orthographic camera's longer side


@pytest.fixture
def plane(scene):
    """A big square seen from above by an orthographic camera, one sample in the middle of each pixel."""
    add(scene, "Plane", mesh(vertices=SQUARE))
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", SCALE
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    scene.view_layers[0].use_pass_position = True
    return scene


def pixel_positions(width: int, height: int) -> np.ndarray:
    """(height, width, 2): where the middle of each pixel is in the plane."""
    pixel = SCALE / max(width, height)
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([x - width / 2, y - height / 2], -1) * pixel


@pytest.mark.parametrize("size", [(33, 17), (64, 64), (129, 65), (7, 91), (4, 4)])
def test_pixels_land_where_they_belong(plane, rendered, size):
    plane.render.resolution_x, plane.render.resolution_y = size
    found = rendered(plane)["ViewLayer.Position"]
    assert found.shape == (size[1], size[0], 3)
    np.testing.assert_allclose(found[..., :2], pixel_positions(*size), atol=0.1 * SCALE / max(size))


@pytest.mark.parametrize("crop", [False, True])
@pytest.mark.parametrize(
    "border", [(0.25, 0.75, 0.5, 1.0), (0.1, 0.37, 0.13, 0.71), (0.9, 1.0, 0.0, 0.2), (0.5, 0.6, 0.5, 0.6)]
)
def test_borders_land_where_they_belong(plane, rendered, border, crop):
    width, height = 61, 43
    render = plane.render
    render.resolution_x, render.resolution_y = width, height
    render.use_border, render.use_crop_to_border = True, crop
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = border
    found = rendered(plane)["ViewLayer.Position"][..., :2]
    x0, x1 = int(render.border_min_x * width), int(render.border_max_x * width)
    y0, y1 = int(render.border_min_y * height), int(render.border_max_y * height)
    inside = pixel_positions(width, height)[y0:y1, x0:x1]
    if crop:
        np.testing.assert_allclose(found, inside, atol=0.1 * SCALE / width)
        return
    assert found.shape[:2] == (height, width)
    np.testing.assert_allclose(found[y0:y1, x0:x1], inside, atol=0.1 * SCALE / width)
    found[y0:y1, x0:x1] = 0
    assert not found.any()


def test_a_border_on_whole_pixels_has_them_all(plane, rendered):
    """0.7 of 20 pixels is 14 in Blender's single precision, and less in double."""
    render = plane.render
    render.resolution_x, render.resolution_y = 20, 20
    render.use_border, render.use_crop_to_border = True, True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.3, 0.7, 0.3, 0.7
    found = rendered(plane)["ViewLayer.Position"][..., :2]
    np.testing.assert_allclose(found, pixel_positions(20, 20)[6:14, 6:14], atol=0.1 * SCALE / 20)


def test_layers_get_their_own_objects(scene, rendered):
    layers = [scene.view_layers[0], scene.view_layers.new("Second")]
    for i, layer in enumerate(layers):
        layer.use_pass_object_index = True
        collection = bpy.data.collections.new(f"Only {i}")
        scene.collection.children.link(collection)
        item = bpy.data.objects.new(f"Square {i}", mesh(vertices=SQUARE))
        item.pass_index = 10 + i
        collection.objects.link(item)
        for j, other in enumerate(layers):
            other.layer_collection.children[collection.name].exclude = i != j
    name = next(p.blender_name for p in PASSES if p.name == "Object Index")
    found = rendered(scene)
    assert (found[f"ViewLayer.{name}"] == 10).all() and (found[f"Second.{name}"] == 11).all()


def test_every_pass_arrives_under_blenders_name(plane, rendered):
    layer = plane.view_layers[0]
    for path in (path for p in PASSES for path in p.wanted):
        owner, _, name = path.rpartition(".")
        setattr(attrgetter(owner)(layer) if owner else layer, name, True)
    plane.cycles.samples = 2
    matte = bpy.data.materials.new("Matte")
    matte.use_nodes = True
    tree = matte.node_tree
    tree.nodes.clear()
    shader, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Color"].default_value = (0.2, 0.4, 0.6, 1)
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    next(item for item in plane.objects if item.type == "MESH").data.materials.append(matte)
    found = rendered(plane)
    for p in PASSES:
        assert found[f"ViewLayer.{p.blender_name}"].shape[2] == len(p.channels), p.name
    np.testing.assert_allclose(found["ViewLayer.Depth"], 5, rtol=1e-5)
    np.testing.assert_allclose(
        found["ViewLayer.Normal"], np.broadcast_to((0, 0, 1), found["ViewLayer.Normal"].shape), atol=1e-6
    )
    albedo = found["ViewLayer.Denoising Albedo"]
    np.testing.assert_allclose(albedo, np.broadcast_to((0.2, 0.4, 0.6), albedo.shape), rtol=1e-5)
    np.testing.assert_array_equal(found["ViewLayer.Debug Sample Count"], 2)
    assert set(engine.passes_of(layer)) == set(PASSES)


def test_transparent_film(scene, rendered):
    add(scene, "Square", mesh(vertices=((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))))
    scene.render.resolution_x = scene.render.resolution_y = 32
    world = scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    for transparent, corner in ((False, 1), (True, 0)):
        scene.render.film_transparent = transparent
        alpha = rendered(scene)["ViewLayer.Combined"][..., 3]
        assert alpha[16, 16] == 1 and alpha[0, 0] == corner


def test_stereo_views_differ(plane, rendered):
    plane.render.use_multiview = True
    plane.camera.data.type = "PERSP"
    plane.camera.data.stereo.convergence_mode = "PARALLEL"
    plane.camera.data.stereo.interocular_distance = 0.5
    found = rendered(plane)
    left, right = (found[f"ViewLayer.Position.{view}"][..., 0].mean() for view in ("left", "right"))
    assert right - left == pytest.approx(0.5, abs=0.02)


def test_animations_render_every_frame_and_warn_once(plane, tmp_path, capfd):
    add(plane, "Hollow", mesh(faces=[]))
    item = plane.objects["Plane"]
    for frame, height in ((1, 0.0), (3, 2.0)):
        item.location.z = height
        item.keyframe_insert("location", frame=frame)
    plane.frame_start, plane.frame_end = 1, 3
    heights = []
    control.current = control.Control()
    bpy.app.handlers.render_write.append(lambda scene, _=None: heights.append(scene.frame_current))
    plane.render.filepath = str(tmp_path / "frame_")
    try:
        bpy.ops.render.render(animation=True)
    finally:
        bpy.app.handlers.render_write.pop()
        control.current = None
    assert heights == [1, 2, 3] and len(list(tmp_path.glob("frame_*"))) == 3
    assert capfd.readouterr().out.count("no faces") <= 1


CAMERAS = (
    {"type": "PERSP", "shift_x": 0.1, "shift_y": -0.2},
    {"type": "PERSP", "sensor_fit": "VERTICAL"},
    {"type": "ORTHO", "ortho_scale": 4},
    {"type": "PANO", "panorama_type": "EQUIRECTANGULAR", "shift_x": 0.2, "shift_y": 0.1, "latitude_min": -1},
)


@pytest.mark.parametrize("camera", CAMERAS)
def test_pixels_are_those_of_cycles(scene, rendered, camera):
    """Geometry, normals, UV and depth of the same scene; tolerances are what a hundredth of a pixel makes."""
    for name, value in camera.items():
        setattr(scene.camera.data, name, value)
    scene.camera.rotation_euler = (0.1, 0.05, 0.3)
    add(scene, "Bent", grid(8), scale=(3, 2, 4), location=(-1.5, -1, 0))
    for i in range(3):
        add(scene, f"Square {i}", mesh(), location=(i - 1, i - 1.5, 1), rotation_euler=(0.5, i, 0))
    carrier = add(scene, "Carrier", grid(2), instance_type="VERTS", location=(-1, 0.5, 2), scale=(2, 1, 1))
    add(scene, "Leaf", mesh(), scale=(0.2, 0.1, 1), rotation_euler=(0.3, 0, 0)).parent = carrier
    scene.render.resolution_x, scene.render.resolution_y = 96, 64
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    scene.cycles.use_denoising = False
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_position = layer.use_pass_uv = True
    ours = rendered(scene)
    scene.render.engine = "CYCLES"
    theirs = rendered(scene)
    hit = [image["ViewLayer.Depth"][..., 0] < 1e9 for image in (ours, theirs)]
    assert (hit[0] != hit[1]).mean() < 0.002 and hit[0].sum() > 100
    both = hit[0] & hit[1]
    for name, tolerance in (("Depth", 5e-3), ("Position", 5e-3), ("Normal", 0.02), ("UV", 2e-3)):
        difference = np.abs(ours[f"ViewLayer.{name}"] - theirs[f"ViewLayer.{name}"])[both]
        assert np.quantile(difference, 0.98) < tolerance, name


# ------------------------------------------------------------------ failing


def failing_render(scene, tmp_path) -> str:
    """Renders over an existing file; the message of the failure. The file must stay as it was."""
    target = tmp_path / "old.png"
    target.write_bytes(b"old picture")
    scene.render.filepath = str(target)
    with pytest.raises(RuntimeError) as failure:
        bpy.ops.render.render(write_still=True)
    assert target.read_bytes() == b"old picture" and list(tmp_path.iterdir()) == [target]
    message = str(failure.value)
    assert message.count("\n") <= 1, "said more than once"
    return message


def test_no_camera(scene, tmp_path):
    scene.camera = None
    assert "camera" in failing_render(scene, tmp_path).lower()


def test_a_camera_of_scale_zero(scene, tmp_path):
    scene.camera.scale = (0, 0, 0)
    assert 'camera "Camera" has a singular matrix' in failing_render(scene, tmp_path)


def test_no_compiled_part(scene, tmp_path, monkeypatch):
    def missing():
        raise native.NativeMissing("gi_engine_native cannot be loaded")

    monkeypatch.setattr(native, "module", missing)
    assert "cannot be loaded" in failing_render(scene, tmp_path)


def test_no_embree(plane, tmp_path, monkeypatch):
    monkeypatch.setenv(native.EMBREE_VARIABLE, str(tmp_path / "none.so"))
    native.embree_path.cache_clear()
    try:
        assert "none.so" in failing_render(plane, tmp_path)
    finally:
        native.embree_path.cache_clear()


@pytest.mark.parametrize("where", ["export", "stream"])
def test_what_nobody_foresaw(plane, tmp_path, monkeypatch, where):
    def broken(*_):
        raise KeyError("surprise")

    monkeypatch.setattr(engine.GIEngine, where, broken)
    assert "KeyError" in failing_render(plane, tmp_path)


def test_out_of_memory(plane, tmp_path, monkeypatch):
    def exhausted(*_):
        raise MemoryError

    monkeypatch.setattr(engine.GIEngine, "stream", exhausted)
    assert "out of memory" in failing_render(plane, tmp_path)


def test_an_exr_can_be_written_after_a_failure(plane, rendered, monkeypatch):
    """Blender crashes where a result was never begun: the failure must leave it in order."""
    plane.camera.scale = (0, 0, 0)
    with pytest.raises(RuntimeError):
        rendered(plane)
    plane.camera.scale = (1, 1, 1)
    assert rendered(plane)["ViewLayer.Position"].any()


def test_an_empty_scene_is_black(scene, rendered):
    combined = rendered(scene)["ViewLayer.Combined"]
    assert not combined[..., :3].any() and (combined[..., 3] == 1).all()


# ------------------------------------------------------------------ progress and stopping


@pytest.fixture
def watched():
    """A caller that watches, as the command line does."""
    control.current = control.Control(overrides={"samples": 1_000_000})
    yield control.current
    control.current = None


def test_cancelling_keeps_what_is_there_within_half_a_second(plane, rendered, watched):
    plane.render.resolution_x, plane.render.resolution_y = 256, 256
    asked = []

    def cancel(progress):
        if progress.passes >= 2 and not asked:
            asked.append(time.monotonic())
            watched.cancelled = True

    watched.on_progress = cancel
    found = rendered(plane)
    # Reading and writing the file are in the time, too.
    assert time.monotonic() - asked[0] < 0.5
    np.testing.assert_allclose(found["ViewLayer.Position"][..., :2], pixel_positions(256, 256), atol=0.1)


def test_escape_cancels(plane, tmp_path, watched, monkeypatch):
    pressed = time.monotonic() + 0.3
    monkeypatch.setattr(engine.GIEngine, "stopped", lambda self: time.monotonic() > pressed)
    bpy.ops.render.render()
    assert time.monotonic() - pressed < 0.5


def test_progress_grows_and_images_arrive(plane, watched, monkeypatch):
    shown, told = [], []
    show = engine.GIEngine.show

    def count(self, session, result):
        show(self, session, result)
        shown.append(time.monotonic())
        watched.cancelled = len(shown) >= 3

    monkeypatch.setattr(engine, "WINDOW", True)  # without one, nobody looks before the end
    monkeypatch.setattr(engine.GIEngine, "show", count)
    watched.on_progress = lambda progress: told.append(progress)
    bpy.ops.render.render()
    fractions = [p.fraction for p in told if p.stage == "Render"]
    assert fractions == sorted(fractions) and fractions[-1] > 0
    assert 0.2 < shown[1] - shown[0] < 0.6
    assert told[-1].rays > 0 and told[-1].passes > 0


def test_pictures_come_seldom_once_they_change_slowly():
    assert engine.show_interval(0.0) == 0.25
    assert engine.show_interval(20.0) == pytest.approx(2.0)
    assert engine.show_interval(3600.0) == 3.0


def test_the_line_over_the_picture():
    progress = {"rays": 3e6, "seconds": 2.0, "samples_per_pixel": 12, "memory": 5 << 20}
    assert engine.status(progress, 3700.0, 64) == "Remaining 1:01:40 | Mem:5M | Sample 12/64 | 1.5 Mrays/s"
    assert engine.status(progress, None, 64) == "Mem:5M | Sample 12/64 | 1.5 Mrays/s"


def test_rendering_leaves_pythons_other_threads_running(plane, watched):
    ticks = []
    stop = threading.Event()

    def tick():
        while not stop.wait(0.01):
            ticks.append(time.monotonic())
        watched.cancelled = True

    def enough(progress):
        if progress.seconds > 0.5:
            stop.set()

    watched.on_progress = enough
    thread = threading.Thread(target=tick)
    thread.start()
    bpy.ops.render.render()
    thread.join()
    assert len(ticks) > 15 and np.diff(ticks).max() < 0.4


def test_switching_the_add_on_off_ends_a_render(plane, watched, monkeypatch):
    """From another thread, as the window does while the render's own thread runs. It fails, or an animation would go on."""

    def leave(progress):
        if progress.passes and not threads:
            threads.append(threading.Thread(target=engine.stop_renders))
            threads[0].start()

    threads = []
    watched.on_progress = leave
    plane.cycles.samples = 1 << 20
    with pytest.raises(RuntimeError, match=engine.SWITCHED_OFF):
        bpy.ops.render.render()
    threads[0].join(5.0)
    assert not threads[0].is_alive() and not engine._running
    with pytest.raises(RuntimeError, match=engine.SWITCHED_OFF):  # and so does what was about to begin
        bpy.ops.render.render()
    engine._leaving.clear()


# ------------------------------------------------------------------ previews


def test_material_previews_show_the_material(scene):
    colors = []
    for color in ((1, 0, 0, 1), (0, 0, 1, 1)):
        material = bpy.data.materials.new("Paint")
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = color
        material.asset_generate_preview()
        size = material.preview.image_size
        pixels = np.array(material.preview.image_pixels_float).reshape(size[1], size[0], 4)
        colors.append(pixels[size[1] // 2 - 5 : size[1] // 2 + 5, size[0] // 2 - 5 : size[0] // 2 + 5, :3].mean((0, 1)))
    red, blue = colors
    assert red[0] > 2 * red[2] and blue[2] > 2 * blue[0]


def test_scene_strips_are_rendered(scene, tmp_path):
    """A strip of the sequencer that shows another scene holds what that scene's own render does."""
    add(scene, "Square", mesh(), scale=(3, 3, 3), location=(-1.5, -1.5, 0))
    add(scene, "Lamp", bpy.data.lights.new("Lamp", "POINT"), location=(1, 0, 2)).data.energy = 100
    outer = bpy.data.scenes.new("Outer")
    outer.render.engine = "GI_ENGINE"
    outer.render.resolution_x, outer.render.resolution_y = 16, 12
    outer.render.resolution_percentage = 100
    outer.frame_start = outer.frame_end = 1
    editor = outer.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strips.new_scene("inner", scene, 1, 1)
    pictures = []
    for each in (scene, outer):
        each.view_settings.view_transform = "Standard"
        each.render.image_settings.file_format = "PNG"
        each.render.filepath = str(tmp_path / f"{each.name}.png")
        bpy.ops.render.render(write_still=True, scene=each.name)
        image = bpy.data.images.load(each.render.filepath)
        pictures.append(np.array(image.pixels).reshape(12, 16, 4)[..., :3])
    assert pictures[0].max() > 0.1
    np.testing.assert_allclose(pictures[1], pictures[0], atol=1.5 / 255)
