"""Reading Blender's images: every source and colour space, and what is shown in place of files that cannot be read."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from gi_engine import native
from gi_engine.export.images import image_key, read_file, read_image
from gi_engine.nodes.compile import Compiler
from gi_engine.scene_data import Scene

SRGB_ORANGE = (200, 100, 50, 255)


@pytest.fixture(autouse=True)
def empty_file():
    bpy.ops.wm.read_factory_settings(use_empty=True)


def write_png(path, color=SRGB_ORANGE, size=(3, 2)):
    image = bpy.data.images.new("writer", *size, alpha=True)
    image.pixels.foreach_set(np.tile(np.array(color, np.float32) / 255, size[0] * size[1]))
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)
    return path


def read(image, user=None):
    """The only tile, and the warnings."""
    warnings = []
    tiles = read_image(image, warnings.append, user)
    assert len(tiles) == 1
    return tiles[0], warnings


def test_file(tmp_path):
    tile, warnings = read(bpy.data.images.load(str(write_png(tmp_path / "a.png"))))
    assert not warnings
    assert tile.pixels.shape == (2, 3, 4) and tile.pixels.dtype == np.uint8
    assert tile.srgb and tile.alpha == "STRAIGHT"
    assert tuple(tile.pixels[1, 2]) == SRGB_ORANGE


def test_packed_file_that_is_gone(tmp_path):
    path = write_png(tmp_path / "a.png")
    image = bpy.data.images.load(str(path))
    image.pack()
    path.unlink()
    tile, warnings = read(image)
    assert not warnings and tuple(tile.pixels[0, 0]) == SRGB_ORANGE


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "BMP", "TARGA", "WEBP", "IRIS", "TIFF"])
@pytest.mark.parametrize("pack", [False, True])
def test_files_are_read_as_blender_shows_them_and_not_kept(kind, pack, tmp_path):
    made = bpy.data.images.new("writer", 5, 4, alpha=True)
    made.pixels.foreach_set(np.random.default_rng(1).random(80, np.float32))
    made.filepath_raw, made.file_format = str(tmp_path / "a"), kind
    made.save()
    image = bpy.data.images.load(str(tmp_path / "a"))
    if pack:
        image.pack()
        image.buffers_free()
    tile, warnings = read(image)
    assert not warnings and not image.has_data
    assert tile.alpha == "STRAIGHT" and tile.srgb
    shown = np.array(image.pixels[:]).reshape(4, 5, 4)
    np.testing.assert_array_equal(tile.pixels, np.rint(shown * 255))
    assert read(image)[0].pixels.tolist() == tile.pixels.tolist() and image.has_data, "was loaded before: stays"


def test_sixteen_bits_a_channel_are_floats(tmp_path):
    image = bpy.data.images.new("writer", 2, 2, float_buffer=True)
    image.pixels.foreach_set(np.full(16, 0.5, np.float32))
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_depth = "PNG", "16"
    image.save_render(str(tmp_path / "a.png"))
    image = bpy.data.images.load(str(tmp_path / "a.png"))
    tile, warnings = read(image)
    assert not warnings and tile.pixels.dtype == np.float32 and not image.has_data
    np.testing.assert_array_equal(tile.pixels.ravel(), image.pixels[:])


def test_painted_pixels_count_and_stay(tmp_path):
    image = bpy.data.images.load(str(write_png(tmp_path / "a.png")))
    image.pixels.foreach_set(np.tile(np.array([0.0, 1.0, 0.0, 1.0], np.float32), 6))
    assert tuple(read(image)[0].pixels[0, 0]) == (0, 255, 0, 255)
    assert image.has_data and image.is_dirty


@pytest.mark.skipif(bpy.app.version < (5, 2, 0), reason="reads what Blender has divided by alpha")
def test_premultiplied_file(tmp_path):
    image = bpy.data.images.load(str(write_png(tmp_path / "a.png", (100, 50, 25, 128))))
    image.alpha_mode = "PREMUL"
    tile, _ = read(image)
    assert tile.alpha == "PREMULTIPLIED" and tuple(tile.pixels[0, 0]) == (100, 50, 25, 128)


@pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="Cycles multiplies them there")
def test_premultiplied_and_packed(tmp_path):
    """Blender divides by alpha what Cycles then takes for multiplied: colours may be brighter than white."""
    image = bpy.data.images.load(str(write_png(tmp_path / "a.png", (200, 50, 25, 128))))
    image.pack()
    image.alpha_mode = "PREMUL"
    material = emitter("ShaderNodeTexImage", image)
    texture = next(n for n in material.node_tree.nodes if n.type == "TEX_IMAGE")
    emission = next(n for n in material.node_tree.nodes if n.type == "EMISSION")
    material.node_tree.links.new(texture.outputs["Alpha"], emission.inputs["Strength"])
    data = Scene()
    data.programs = [Compiler(data, bpy.context.evaluated_depsgraph_get(), pytest.fail).material(material)]
    color = native.module().emission(data, 0, np.full((1, 3), 0.5, np.float32), (0.0, 0.0, 1.0))[0]
    encoded = np.minimum(np.array([200, 50, 25]) * 255 / 128, 255).round() / 128  # divided by Blender, then by us
    np.testing.assert_allclose(color, ((encoded + 0.055) / 1.055) ** 2.4 * 128 / 255, rtol=0.02)


def test_row_zero_is_at_the_bottom():
    image = bpy.data.images.new("rows", 1, 2, alpha=True)
    image.pixels.foreach_set([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    tile, _ = read(image)
    assert tile.pixels[0, 0, 0] == 0 and tile.pixels[1, 0, 0] == 255


def test_float_image_is_scene_linear():
    image = bpy.data.images.new("float", 2, 2, alpha=True, float_buffer=True)
    image.pixels.foreach_set(np.tile(np.array([4.0, 0.5, 0.25, 1.0], np.float32), 4))
    tile, warnings = read(image)
    assert (
        not warnings
        and tile.pixels.dtype == np.float32
        and tile.alpha == ("STRAIGHT" if bpy.app.version >= (5, 0, 0) else "PREMULTIPLIED")
    )
    assert tile.pixels[0, 0].tolist() == [4.0, 0.5, 0.25, 1.0]


def test_float_image_marked_as_premultiplied():
    image = bpy.data.images.new("float", 2, 2, alpha=True, float_buffer=True)
    image.alpha_mode = "PREMUL"
    assert read(image)[0].alpha == "PREMULTIPLIED"


@pytest.mark.parametrize(("space", "srgb"), [("sRGB", True), ("Non-Color", False), ("Linear Rec.709", False)])
def test_plain_color_spaces_stay_bytes(space, srgb):
    image = bpy.data.images.new("space", 1, 1)
    image.colorspace_settings.name = space
    tile, _ = read(image)
    assert tile.pixels.dtype == np.uint8 and tile.srgb is srgb
    assert (tile.alpha == "CHANNEL_PACKED") == (space == "Non-Color")


def test_other_color_spaces_are_converted_by_blender():
    image = bpy.data.images.new("wide", 1, 1, alpha=True)
    image.colorspace_settings.name = "Linear Rec.2020"
    image.pixels.foreach_set(np.array([51, 102, 204, 128], np.float32) / 255)
    tile, warnings = read(image)
    assert not warnings and tile.pixels.dtype == np.float32
    # ITU-R BT.2087.
    to_709 = np.array(
        [[1.660491, -0.587641, -0.072850], [-0.124550, 1.132900, -0.008349], [-0.018151, -0.100579, 1.118730]]
    )
    np.testing.assert_allclose(tile.pixels[0, 0, :3], to_709 @ (np.array([51, 102, 204]) / 255), atol=2e-3)
    assert tile.pixels[0, 0, 3] == pytest.approx(128 / 255)
    assert [i.name for i in bpy.data.images] == ["wide"], "helpers are left behind"


def test_frames_of_a_sequence(tmp_path):
    for frame in (1, 2, 3):
        write_png(tmp_path / f"s_{frame:03d}.png", (frame * 10, 0, 0, 255))
    image = bpy.data.images.load(str(tmp_path / "s_001.png"))
    image.source = "SEQUENCE"
    material = bpy.data.materials.new("m")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    node.image_user.frame_duration, node.image_user.frame_start = 3, 1
    keys = set()
    for frame in (1, 2, 3):
        bpy.context.scene.frame_set(frame)
        tile, warnings = read(image, node.image_user)
        assert not warnings and tile.pixels[0, 0, 0] == frame * 10
        keys.add(image_key(image, node.image_user))
    assert len(keys) == 3


FRAMES = 6


def write_movie(folder):
    """Of frames that are each darker than the one before."""
    scene = bpy.data.scenes.new("Cut")
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    for frame in range(1, FRAMES + 1):
        write_png(folder / f"f_{frame}.png", (240 - 30 * frame, 60, 100, 255), (32, 32))
    strip = strips.new_image("frames", str(folder / "f_1.png"), 1, 1)
    for frame in range(2, FRAMES + 1):
        strip.elements.append(f"f_{frame}.png")
    strip.frame_final_duration = scene.frame_end = FRAMES
    render = scene.render
    render.resolution_x = render.resolution_y = 32
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format, render.filepath = "FFMPEG", str(folder / "movie.mp4")
    render.ffmpeg.format, render.ffmpeg.codec, render.ffmpeg.constant_rate_factor = "MPEG4", "H264", "HIGH"
    scene.view_settings.view_transform = "Standard"
    bpy.ops.render.render(animation=True, scene=scene.name)
    bpy.data.scenes.remove(scene)
    return folder / "movie.mp4"


MOVIE_SETTINGS = {
    "from the first frame": {},
    "later": {"frame_start": 3},
    "offset": {"frame_offset": 2},
    "shorter": {"frame_duration": 3},
    "over and over": {"frame_duration": 3, "use_cyclic": True},
    "of one frame": {"frame_duration": 1},
}


@pytest.mark.parametrize("key", MOVIE_SETTINGS)
def test_frames_of_a_movie_are_cycles(key, tmp_path):
    path = write_movie(tmp_path)
    for image in list(bpy.data.images):
        bpy.data.images.remove(image)
    image = bpy.data.images.load(str(path))
    assert image.source == "MOVIE" and image.frame_duration == FRAMES
    node = shown_to_cycles(image)
    user = node.image_user
    user.frame_duration, user.frame_start = FRAMES, 1
    for name, value in MOVIE_SETTINGS[key].items():
        setattr(user, name, value)
    reds = []
    for frame in (1, 2, 5, 9):
        bpy.context.scene.frame_set(frame)
        theirs = seen_by_cycles(tmp_path / "cycles.exr")
        tile, warnings = read(image, user)
        assert not warnings and not bpy.data.textures
        ours = srgb_to_linear(tile.pixels[16, 16, :3] / 255.0)
        np.testing.assert_allclose(ours, theirs, atol=2e-3)
        reds.append(ours[0])
    assert np.ptp(reds) > 0.1 or key == "of one frame"


@pytest.mark.parametrize("how", ["missing", "damaged"])
@pytest.mark.parametrize("source", ["MOVIE", "SEQUENCE"])
def test_what_cannot_be_read_does_not_keep_the_viewport_reading(source, how, tmp_path):
    """A datablock that is made, even for a moment, makes Blender tell the viewport of a change, which then reads all again."""
    path = write_movie(tmp_path) if source == "MOVIE" else write_png(tmp_path / "f_1.png")
    image = bpy.data.images.load(str(path))
    image.source = source
    user = user_of(image)
    if how == "missing":
        path.unlink()
    else:
        path.write_bytes(b"no picture at all" * 40)
    changes = []

    def notice(*_):
        changes.append(1)

    bpy.app.handlers.depsgraph_update_post.append(notice)
    read(image, user)
    bpy.context.view_layer.update()
    changes.clear()
    tile, warnings = read(image, user)
    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_post.remove(notice)
    assert len(warnings) == 1 and tuple(tile.pixels[0, 0]) == (255, 0, 255, 255)
    assert not changes
    # A file that is put there again is read.
    if source == "SEQUENCE":
        write_png(path)
        tile, warnings = read(image, user)
        assert not warnings and tuple(tile.pixels[0, 0]) == SRGB_ORANGE


def test_what_is_packed_and_damaged_is_not_read_again_and_again(tmp_path):
    """Nor is the file blamed that lies where it came from."""
    path = write_png(tmp_path / "f_1.png")
    like = bpy.data.images.load(str(path))
    changes, said = [], []

    def notice(*_):
        changes.append(1)

    def tile(packed):
        return read_file(like, str(path), packed, said.append).pixels[0, 0]

    damaged = b"no picture at all" * 40
    tile(damaged)
    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_post.append(notice)
    found = tile(damaged)
    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_post.remove(notice)
    assert len(said) == 2 and tuple(found) == (255, 0, 255, 255)
    assert not changes
    assert tuple(tile(None)) == SRGB_ORANGE and tuple(tile(path.read_bytes())) == SRGB_ORANGE and len(said) == 2


def user_of(image):
    """How a node shows the image: from the scene's first frame on."""
    material = bpy.data.materials.get("user")
    if material is None:
        material = bpy.data.materials.new("user")
        if material.node_tree is None:
            material.use_nodes = True
        material.node_tree.nodes.new("ShaderNodeTexImage").name = "shows"
    node = material.node_tree.nodes["shows"]
    node.image, node.image_user.frame_duration = image, 10
    return node.image_user


def srgb_to_linear(encoded):
    return np.where(encoded < 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def shown_to_cycles(image):
    """A square that fills the view and glows with the image."""
    scene = bpy.context.scene
    mesh = bpy.data.meshes.new("square")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    mesh.uv_layers.new(name="UVMap")
    scene.collection.objects.link(bpy.data.objects.new("square", mesh))
    material = bpy.data.materials.new("glow")
    mesh.materials.append(material)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node, glow, end = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexImage", "Emission", "OutputMaterial"))
    node.image = image
    tree.links.new(node.outputs[0], glow.inputs[0])
    tree.links.new(glow.outputs[0], end.inputs[0])
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 1.0, (0, 0, 3)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return node


def seen_by_cycles(path):
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    scene.cycles.use_denoising = scene.render.use_sequencer = False
    scene.render.resolution_x = scene.render.resolution_y = 4
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, scene.render.filepath = "OPEN_EXR", "32", str(path)
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(str(path))
    color = np.array(picture.pixels[:3])
    bpy.data.images.remove(picture)
    return color


def test_udim_tiles(tmp_path):
    for number, red in ((1001, 10), (1002, 20), (1011, 30)):
        write_png(tmp_path / f"t.{number}.png", (red, 0, 0, 255))
    image = bpy.data.images.load(str(tmp_path / "t.1001.png"))
    image.source = "TILED"
    image.filepath_raw = str(tmp_path / "t.<UDIM>.png")
    for number in (1002, 1011):
        image.tiles.new(tile_number=number)
    warnings = []
    tiles = {tile.tile: tile.pixels[0, 0, 0] for tile in read_image(image, warnings.append)}
    assert not warnings and tiles == {1001: 10, 1002: 20, 1011: 30}


def test_udim_tile_that_is_missing(tmp_path):
    write_png(tmp_path / "t.1001.png")
    image = bpy.data.images.load(str(tmp_path / "t.1001.png"))
    image.source = "TILED"
    image.filepath_raw = str(tmp_path / "t.<UDIM>.png")
    image.tiles.new(tile_number=1002)
    warnings = []
    tiles = read_image(image, warnings.append)
    assert tuple(tiles[0].pixels[0, 0]) == SRGB_ORANGE
    assert tiles[1].pixels.tolist() == [[[255, 0, 255, 255]]]
    assert len(warnings) == 1 and "t.1002.png" in warnings[0]


# -------------------------------------------------------------------- what cannot be read


def broken(path, how: str):
    """An image datablock whose file is then damaged."""
    write_png(path, size=(64, 64))
    image = bpy.data.images.load(str(path))
    if how == "missing":
        path.unlink()
    elif how == "empty":
        path.write_bytes(b"")
    elif how == "cut off":
        path.write_bytes(path.read_bytes()[:20])
    else:
        path.write_bytes(b"this is no picture")
    return image


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("missing", "there is no file"),
        ("empty", "is empty"),
        ("cut off", "damaged"),
        ("text", "damaged or of an unknown format"),
    ],
)
def test_broken_file_is_magenta_with_a_warning(how, said, tmp_path):
    tile, warnings = read(broken(tmp_path / "broken.png", how))
    assert tile.pixels.tolist() == [[[255, 0, 255, 255]]]
    assert len(warnings) == 1 and said in warnings[0] and "broken.png" in warnings[0]


def test_warning_names_material_and_node(tmp_path):
    material = bpy.data.materials.new("Brass")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.name = "Scratches"
    texture.image = broken(tmp_path / "broken.png", "missing")
    shader = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(texture.outputs["Alpha"], shader.inputs["Alpha"])
    warnings, data = [], Scene()
    Compiler(data, bpy.context.evaluated_depsgraph_get(), warnings.append).material(material)
    assert len(warnings) == 1 and len(data.images) == 1
    assert all(name in warnings[0] for name in ("Brass", "Scratches", "broken.png"))


def test_image_of_several_nodes_is_read_once(tmp_path):
    image = bpy.data.images.load(str(write_png(tmp_path / "a.png")))
    data = Scene()
    compiler = Compiler(data, bpy.context.evaluated_depsgraph_get(), pytest.fail)
    for name in ("one", "two"):
        material = bpy.data.materials.new(name)
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        tree = material.node_tree
        shader = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
        for socket in ("Base Color", "Emission Color"):
            texture = tree.nodes.new("ShaderNodeTexImage")
            texture.image = image
            tree.links.new(texture.outputs["Color"], shader.inputs[socket])
        compiler.material(material)
    assert len(data.images) == 1


def emitter(texture_node: str, image=None):
    """A material that emits a texture of the position."""
    material = bpy.data.materials.new("emitter")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    position, texture = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new(texture_node)
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    texture.image = image
    tree.links.new(position.outputs["Position"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return material


@pytest.mark.parametrize("node", ["ShaderNodeTexImage", "ShaderNodeTexEnvironment"])
def test_node_without_image_is_magenta_with_a_warning(node):
    data, warnings = Scene(), []
    data.programs = [Compiler(data, bpy.context.evaluated_depsgraph_get(), warnings.append).material(emitter(node))]
    assert native.module().emission(data, 0, np.zeros((1, 3), np.float32), (0.0, 0.0, 1.0)).tolist() == [[1, 0, 1]]
    assert len(warnings) == 1 and "no image" in warnings[0]


def test_coordinates_choose_the_udim_tile(tmp_path):
    """One tile each metre; magenta where there is none, on the left, below and beyond the tenth."""
    for number, red in ((1001, 51), (1002, 102), (1011, 204)):
        write_png(tmp_path / f"t.{number}.png", (red, 0, 0, 255))
    image = bpy.data.images.load(str(tmp_path / "t.1001.png"))
    image.source = "TILED"
    image.filepath_raw = str(tmp_path / "t.<UDIM>.png")
    image.colorspace_settings.name = "Non-Color"
    for number in (1002, 1011):
        image.tiles.new(tile_number=number)
    data = Scene()
    data.programs = [
        Compiler(data, bpy.context.evaluated_depsgraph_get(), pytest.fail).material(
            emitter("ShaderNodeTexImage", image)
        )
    ]
    points = np.array(
        [[0.5, 0.5, 0], [1.5, 0.5, 0], [0.5, 1.5, 0], [1.5, 1.5, 0], [-0.5, 0.5, 0], [10.5, 0.5, 0]], np.float32
    )
    colors = native.module().emission(data, 0, points, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(colors[:3, 0], [0.2, 0.4, 0.8], atol=1e-6)
    assert (colors[3:] == (1, 0, 1)).all()
