"""Lightmaps: against Cycles' own bake, by the button, and what happens where they cannot be baked."""

from __future__ import annotations

import bmesh
import bpy
import numpy as np
import OpenEXR
import pytest
from scipy import stats

from gi_engine import bake, denoise
from gi_engine.ui import lightmap

from .conftest import add, mesh

FLOOR = ((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))
BOX = tuple((x, y, z) for z in (0, 0.8) for y in (-0.4, 0.4) for x in (0, 0.8))
BOX_FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
SIZE = 32
RUNS = 8  # bakes of one kind, for their noise


def material(name, color):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    out, shader = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*color, 1)
    made.node_tree.links.new(shader.outputs[0], out.inputs["Surface"])
    return made


@pytest.fixture
def room(scene):
    """A white floor with a red box on it, lit by a lamp; the floor has a UV map that leaves a border."""
    floor = add(scene, "Floor", mesh("Floor", FLOOR))
    floor.data.materials.append(material("white", (0.8, 0.8, 0.8)))
    uv = floor.data.uv_layers.new(name="Map")
    uv.uv.foreach_set("vector", np.array([0.1, 0.1, 0.9, 0.1, 0.9, 0.9, 0.1, 0.9], np.float32))
    box = add(scene, "Box", mesh("Box", BOX, BOX_FACES))
    box.data.materials.append(material("red", (0.8, 0.1, 0.1)))
    lamp = bpy.data.lights.new("Lamp", "AREA")
    lamp.energy, lamp.size = 60, 0.7
    add(scene, "Lamp", lamp, location=(-0.5, 0.3, 2.5))
    scene.cycles.samples = 32
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    return scene


def pixels_of(image) -> np.ndarray:
    width, height = image.size
    buffer = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(buffer)
    return buffer.reshape(height, width, 4)


def request(name="Floor", **fields):
    fields = {"uv_map": "Map", "width": SIZE, "height": SIZE, "margin": 2, "denoise": False, **fields}
    return bake.Request(name, **fields)


def baked(path=None, integrator="path", **fields) -> np.ndarray:
    image, *_ = bake.bake(bpy.context, request(**fields), path, integrator)
    return pixels_of(image)


def by_blender(scene, engine: str, seed: int, filters) -> np.ndarray:
    """Blender's own Bake button on the floor."""
    floor = bpy.data.objects["Floor"]
    image = bpy.data.images.new("Target", SIZE, SIZE, alpha=True, float_buffer=True)
    tree = floor.data.materials[0].node_tree
    node = tree.nodes.get("Target") or tree.nodes.new("ShaderNodeTexImage")
    node.name, node.image, tree.nodes.active = "Target", image, node
    for item in scene.objects:
        item.select_set(item == floor)
    bpy.context.view_layer.objects.active = floor
    scene.render.engine, scene.cycles.seed = engine, seed
    bpy.ops.object.bake(type="DIFFUSE", pass_filter=filters, margin=0, use_clear=True)
    scene.render.engine = "GI_ENGINE"
    found = pixels_of(image)
    bpy.data.images.remove(image)
    return found[..., :3].astype(np.float64)


def add_ball(scene) -> None:
    """Smooth, askew, every face apart on its map; named as the floor was."""
    bpy.data.objects["Floor"].name = "Ground"
    data, ball = bpy.data.meshes.new("Ball"), bmesh.new()
    bmesh.ops.create_icosphere(ball, subdivisions=2, radius=0.6)
    ball.to_mesh(data)
    ball.free()
    data.polygons.foreach_set("use_smooth", np.ones(len(data.polygons), bool))
    data.materials.append(material("green", (0.3, 0.7, 0.4)))
    add(scene, "Floor", data, location=(-1, -0.8, 0.8), rotation_euler=(0.3, 0.5, 0.7), scale=(1, 0.7, 1.3))
    bpy.context.view_layer.update()
    bake.unwrap(bpy.data.objects["Floor"], request(margin=1), whole_faces=True)


def triangles_of_texels(item, size: int) -> np.ndarray:
    """How many triangles touch each texel: where a triangle's box and the lines of its sides leave no gap between them."""
    item.data.calc_loop_triangles()
    uv = np.array([corner.vector[:] for corner in item.data.uv_layers.active.uv]) * size
    y, x = np.mgrid[:size, :size]
    count = np.zeros((size, size), int)
    for triangle in item.data.loop_triangles:
        p = uv[list(triangle.loops)]
        side = np.roll(p, -1, 0) - p
        if side[0, 0] * side[1, 1] < side[0, 1] * side[1, 0]:
            p, side = p[::-1], np.roll(p[::-1], -1, 0) - p[::-1]
        touched = (x < p[:, 0].max()) & (x + 1 > p[:, 0].min()) & (y < p[:, 1].max()) & (y + 1 > p[:, 1].min())
        for (px, py), (dx, dy) in zip(p, side, strict=True):
            touched &= dx * (y + (dx > 0) - py) > dy * (x + (dy < 0) - px)
        count += touched
    return count


def student(theirs: np.ndarray, ours: np.ndarray, bias: float) -> np.ndarray:
    """By texel, of bakes with seeds of their own. `bias`: share of the light that may be wrong."""
    theirs, ours = theirs.mean(3), ours.mean(3)
    error = np.sqrt((theirs.var(0, ddof=1) + ours.var(0, ddof=1)) / RUNS) + bias * theirs.mean(0)
    return (theirs.mean(0) - ours.mean(0)) / np.maximum(error, 1e-12)


def read_by_cycles(theirs: np.ndarray, item) -> np.ndarray:
    """The texels of which Cycles reads all that we read: it takes one triangle of those that share a texel, the one in its middle, or
    none. Before 5.2 it read only the middle half of a texel: there, where light is bent too much for that not to show is left out."""
    light = theirs.mean((0, 3))
    read = (triangles_of_texels(item, SIZE) == 1) & (light > 0)
    if bpy.app.version < (5, 2):
        around = sum(np.roll(light, step, axis) for step in (-1, 1) for axis in (0, 1))
        error = np.sqrt(theirs.mean(3).var(0, ddof=1) / RUNS)
        read &= np.abs(around - 4 * light) / 32 < 0.5 * error
    return read


@pytest.mark.parametrize(
    ("integrator", "filters", "what"),
    [
        ("path", {"DIRECT", "INDIRECT"}, "floor"),
        ("path", {"INDIRECT"}, "floor"),
        ("path", {"DIRECT", "INDIRECT", "COLOR"}, "floor"),
        ("path", {"DIRECT", "INDIRECT"}, "ball"),
        ("particle", {"DIRECT", "INDIRECT"}, "floor"),
        ("particle", {"INDIRECT"}, "floor"),
        ("particle", {"DIRECT", "INDIRECT", "COLOR"}, "ball"),
    ],
    ids=lambda value: value if isinstance(value, str) else str(len(value)),
)
def test_every_texel_agrees_with_cycles(room, integrator, filters, what):
    """Texels differ as independent noise would have them: partly covered ones, those at the box's foot and in its shadow included.
    Particles blur light by the size of their texels, hence a bias."""
    bpy.data.objects[
        "Box"
    ].location.z = -0.1  # what is just as high as the floor is in it for one and on it for the other
    if what == "ball":
        if bpy.app.version < (5, 2):
            pytest.skip("Cycles reads the middle of each texel only")
        add_ball(room)
    room.cycles.samples = 256
    theirs = np.array([by_blender(room, "CYCLES", seed, filters) for seed in range(RUNS)])
    room.gi_engine.integrator, room.gi_engine.particle.particles = integrator, 10000
    ours = np.array([by_blender(room, "GI_ENGINE", 100 + seed, filters) for seed in range(RUNS)])
    read = read_by_cycles(theirs, bpy.data.objects["Floor"])
    particles = integrator == "particle"
    t = student(theirs, ours, 0.005 if particles else 0)[read]
    freedom = (1 if particles else 2) * (RUNS - 1)  # particles' noise is small beside Cycles'
    far = 2 * stats.t.sf(3, freedom)
    print(
        f"{t.size} texels: t {t.mean():.3f}, t² {np.mean(t**2):.3f}, beyond 3 {np.mean(abs(t) > 3):.4f}, most {abs(t).max():.1f}"
    )
    assert t.size > (400 if bpy.app.version >= (5, 2) else 200)
    assert np.mean(t**2) < freedom / (freedom - 2) + 4 * 1.9 / np.sqrt(t.size)
    assert np.mean(np.abs(t) > 3) < far + 4 * np.sqrt(far / t.size)
    assert np.abs(t).max() < 8
    if not particles:
        assert abs(t.mean()) < 4 * 1.1 / np.sqrt(t.size)
        assert np.mean(t**2) > 0.8  # the errors are no larger than they have to be


def test_particles_of_the_texels_agree_with_path_tracing(room):
    light = [
        baked(integrator=integrator, content=c)[..., :3].mean()
        for integrator in ("path", "particle")
        for c in ("IRRADIANCE", "RADIOSITY")
    ]
    assert light[2] == pytest.approx(light[0], rel=0.01)
    assert light[3] == pytest.approx(light[1], rel=0.01)
    assert light[1] == pytest.approx(0.8 * light[0], rel=0.01)


def test_margin_is_filled_and_no_further(room):
    found = baked(margin=2)
    assert found[2, 16, 3] == 1  # the map begins in texel 3
    assert found[2, 16, :3] == pytest.approx(found[3, 16, :3], rel=0.3)
    assert found[0, 16].max() == 0


def test_denoising_takes_noise_away(room):
    if denoise.load(bake.blender_folders()) is None:
        pytest.skip("this Blender brings no denoiser")
    room.cycles.samples = 512
    truth = baked(content="INDIRECT", width=64, height=64)
    room.cycles.samples, room.cycles.seed = 4, 7
    noisy, clean = (
        np.abs(baked(content="INDIRECT", width=64, height=64, denoise=d) - truth)[8:-8, 8:-8, :3].mean()
        for d in (False, True)
    )
    assert clean < 0.6 * noisy


def test_the_baked_floor_looks_as_it_was_rendered(room, tmp_path):
    """Shown by emission of what was baked, all else gone, the floor is the same picture."""
    baked(content="RADIOSITY", width=128, height=128)
    room.cycles.samples = 32
    room.camera.location, room.camera.data.type, room.camera.data.ortho_scale = (-1, 0, 5), "ORTHO", 1.6
    before = picture(room, tmp_path / "before.exr")
    floor = bpy.data.objects["Floor"]
    tree = floor.data.materials[0].node_tree
    image, uv, shader = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexImage", "UVMap", "Emission"))
    image.image, uv.uv_map = bpy.data.images["Floor Lightmap"], "Map"
    tree.links.new(uv.outputs[0], image.inputs[0])
    tree.links.new(image.outputs["Color"], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    for name in ("Box", "Lamp"):
        bpy.data.objects.remove(bpy.data.objects[name])
    after = picture(room, tmp_path / "after.exr")
    assert before.mean() > 0.05
    np.testing.assert_allclose(after, before, rtol=0.15)
    assert after.mean() == pytest.approx(before.mean(), rel=0.01)


def picture(scene, path) -> np.ndarray:
    """Means of blocks of 4 x 4 pixels."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    with OpenEXR.File(str(path)) as file:
        rgb = next(iter(file.channels().values())).pixels[..., :3].astype(np.float64)
    return rgb.reshape(3, 4, 4, 4, 3).mean((1, 3, 4))


def test_a_fresh_map_has_room_for_every_face(room, tmp_path):
    path = tmp_path / "box.exr"
    image, uv_map, passes, _ = bake.bake(bpy.context, request("Box", uv_map="", width=64, height=64), path, "path")
    assert uv_map == bake.FRESH_MAP
    assert passes == 32
    assert uv_map in bpy.data.objects["Box"].data.uv_layers
    found = pixels_of(image)
    assert 0.1 < (found[..., 3] > 0).mean() <= 1
    with OpenEXR.File(str(path)) as file:
        stored = next(iter(file.channels().values())).pixels
    assert stored.dtype == np.float32
    np.testing.assert_array_equal(stored[::-1, :, :3], found[..., :3])


def test_the_button_bakes_what_is_selected(room):
    for name in ("Floor", "Box"):
        bpy.data.objects[name].select_set(True)
    settings = room.gi_engine.lightmap
    settings.width = settings.height = 16
    assert bpy.ops.gi_engine.bake_lightmap() == {"FINISHED"}
    for name in ("Floor Lightmap", "Box Lightmap"):
        assert pixels_of(bpy.data.images[name])[..., :3].max() > 0
        assert bpy.data.images[name].is_float


def test_one_bake_at_a_time(room, monkeypatch):
    bpy.data.objects["Floor"].select_set(True)
    assert bpy.ops.gi_engine.bake_lightmap.poll()
    monkeypatch.setattr(lightmap.GI_OT_bake_lightmap, "running", True)
    assert not bpy.ops.gi_engine.bake_lightmap.poll()


def test_the_button_tells_what_is_wrong_and_leaves_images_alone(room, tmp_path):
    bpy.data.objects["Floor"].select_set(True)
    room.gi_engine.lightmap.uv_map = "Nowhere"
    with pytest.raises(RuntimeError, match='"Floor" has no UV map "Nowhere"; it has: Map'):
        bpy.ops.gi_engine.bake_lightmap()
    room.gi_engine.lightmap.uv_map = "Map"
    room.gi_engine.lightmap.folder = str(tmp_path / "missing")
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.gi_engine.bake_lightmap()
    assert "Floor Lightmap" not in bpy.data.images


@pytest.mark.parametrize(
    ("name", "uv_map", "message"),
    [
        ("Nobody", "Map", 'no object "Nobody"'),
        ("Lamp", "", '"Lamp" is no mesh but a light'),
        ("Box", "Map", '"Box" has no UV map "Map"; it has none'),
        ("Empty", "", '"Empty" has no faces'),
    ],
)
def test_what_cannot_be_baked_is_named(room, name, uv_map, message):
    add(room, "Empty", bpy.data.meshes.new("Empty"))
    with pytest.raises(bake.BakeError, match=message):
        baked(name=name, uv_map=uv_map)


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        (np.zeros(8), "covers nothing"),
        ([0, 0, 2, 0, 2, 2, 0, 2], "reaches outside"),
        ([0, 0, 1, 0, 0, 0, 1, 1], "covers nothing|overlaps itself|reaches"),
    ],
)
def test_bad_maps_are_named_and_files_stay(room, tmp_path, corners, message):
    path = tmp_path / "floor.exr"
    path.write_text("old")
    floor = bpy.data.objects["Floor"]
    floor.data.uv_layers["Map"].uv.foreach_set("vector", np.array(corners, np.float32))
    with pytest.raises(bake.RenderFailed, match=f"'Map' of object 'Floor'.*({message})"):
        baked(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_overlaps_are_found(room):
    """Two faces on top of one another."""
    twice = add(room, "Twice", mesh("Twice", (*FLOOR, *[(x, y, 1) for x, y, _ in FLOOR]), ((0, 1, 2, 3), (4, 5, 6, 7))))
    corners = [0.1, 0.1, 0.9, 0.1, 0.9, 0.9, 0.1, 0.9]
    twice.data.uv_layers.new(name="Map").uv.foreach_set("vector", np.array(2 * corners, np.float32))
    with pytest.raises(bake.RenderFailed, match="'Map' of object 'Twice' overlaps itself"):
        baked(name="Twice")


def test_blender_s_button_says_what_it_cannot_do(room):
    bpy.data.objects["Floor"].select_set(True)
    with pytest.raises(RuntimeError, match="Direct light alone"):
        by_blender(room, "GI_ENGINE", 1, {"DIRECT"})
