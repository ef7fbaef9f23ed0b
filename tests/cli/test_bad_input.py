"""Bad input: one clear message that names the thing, the right exit code, no crash, and no half-written or overwritten
output. Errors stop the render; what can be left out is left out with a warning."""

import os
import subprocess
import sys

import numpy as np
import pytest

from gi_engine import cli

from .conftest import plane


@pytest.fixture
def refuses(gi, tmp_path):
    """The render fails with `code`, says all `words`, and leaves the old output alone."""

    def check(file, *words, code=cli.FAILED, options=()):
        out = tmp_path / "out.png"
        out.write_bytes(b"old")
        before = sorted(os.listdir(tmp_path))
        done = gi("render", file, "-o", out, *options)
        assert done.code == code, done
        assert all(word in done.err for word in words), done.err
        assert "Traceback" not in done.err and "internal error" not in done.err
        assert len(done.err.strip().splitlines()) == 1, done.err
        assert out.read_bytes() == b"old"
        assert sorted(os.listdir(tmp_path)) == before

    return check


@pytest.fixture
def warns(gi, tmp_path):
    """The render works and warns once with all `words`; without words it does not warn."""

    def check(file, *words):
        out = tmp_path / "out.exr"
        done = gi("render", file, "-o", out)
        assert done.code == cli.DONE, done
        lines = done.err.splitlines()
        assert len([line for line in lines if words and all(word in line for word in words)]) == bool(words), done.err
        assert len(lines) == bool(words), done.err
        from .test_render import combined

        pixels = combined(out)
        assert np.all(np.isfinite(pixels))
        return pixels

    return check


# Files and folders


def test_no_such_file(refuses, tmp_path):
    refuses(tmp_path / "none.blend", "none.blend", "No such file", code=cli.BAD_ARGUMENTS)


def test_not_a_blend(refuses, tmp_path):
    (tmp_path / "text.blend").write_text("This is no scene.")
    refuses(tmp_path / "text.blend", "text.blend", "not a .blend", code=cli.BAD_ARGUMENTS)


def test_an_empty_file(refuses, tmp_path):
    (tmp_path / "empty.blend").touch()
    refuses(tmp_path / "empty.blend", "empty.blend", "not a .blend", code=cli.BAD_ARGUMENTS)


def test_a_folder_as_file(refuses, tmp_path):
    refuses(tmp_path, str(tmp_path), "directory", code=cli.BAD_ARGUMENTS)


def test_a_header_and_nothing_more(refuses, stage, tmp_path):
    (tmp_path / "cut.blend").write_bytes(stage.save().read_bytes()[:200])
    refuses(tmp_path / "cut.blend", "cut.blend")


def test_no_output_folder(gi, stage, tmp_path):
    done = gi("render", stage.save(), "-o", tmp_path / "missing" / "out.png")
    assert done.code == cli.BAD_ARGUMENTS
    assert f'"{tmp_path / "missing"}" does not exist' in done.err


def test_the_output_is_a_folder(gi, stage, tmp_path):
    (tmp_path / "out.png").mkdir()
    done = gi("render", stage.save(), "-o", tmp_path / "out.png")
    assert (done.code, "out.png" in done.err, "is a folder" in done.err) == (cli.BAD_ARGUMENTS, True, True)


def test_an_output_folder_that_is_not_writable(gi, stage, tmp_path):
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o555)
    if os.access(locked, os.W_OK):  # root may write anywhere but in the kernel's own folders
        locked = "/proc"
    done = gi("render", stage.save(), "-o", f"{locked}/out.png")
    assert done.code == cli.BAD_ARGUMENTS
    assert str(locked) in done.err and "not writable" in done.err


def test_an_unknown_format(gi, stage):
    done = gi("render", stage.save(), "-o", "out.gif")
    assert (done.code, "out.gif" in done.err) == (cli.BAD_ARGUMENTS, True)


def test_a_video_needs_a_name(gi, stage):
    settings = stage.scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    done = gi("render", stage.save())
    assert done.code == cli.FAILED
    assert "video" in done.err and "-o" in done.err


# Arguments that only the engine can judge


def test_an_unknown_integrator(refuses, stage):
    refuses(stage.save(), "warp", "path", "whitted", code=cli.BAD_ARGUMENTS, options=("--integrator", "warp"))


def test_an_unknown_parameter(refuses, stage):
    refuses(stage.save(), "warmth", "max_bounces", code=cli.BAD_ARGUMENTS, options=("--set", "warmth=3"))


def test_no_samples(gi, stage, tmp_path):
    done = gi("render", stage.save(), "-o", tmp_path / "out.png", "--samples", 0)
    assert (done.code, "--samples" in done.err) == (cli.BAD_ARGUMENTS, True)


# Scenes


def test_no_camera(refuses, stage):
    stage.scene.camera = None
    refuses(stage.save(), "camera", "Scene")


def test_a_camera_of_no_size(refuses, stage):
    stage.camera.scale = (0, 0, 0)
    refuses(stage.save(), "camera", '"camera"')


def test_an_empty_scene(warns, stage):
    import bpy

    for thing in (stage.floor, stage.lamp):
        bpy.data.objects.remove(thing)
    assert np.all(warns(stage.save()) == 0.0)


def test_no_lights(warns, stage):
    import bpy

    bpy.data.objects.remove(stage.lamp)
    assert np.all(warns(stage.save()) == 0.0)


def test_a_picture_too_long_for_blender(refuses, stage):
    refuses(stage.save(), "1x60000", code=cli.BAD_ARGUMENTS, options=("--resolution", "1x60000"))


@pytest.mark.parametrize("size", ["1x1", "1x7", "7x1", "3x4"])
def test_pictures_of_one_pixel(gi, stage, tmp_path, size):
    done = gi("render", stage.save(), "-o", tmp_path / "out.exr", "--resolution", size)
    assert (done.code, done.err) == (cli.DONE, "")
    from .test_render import combined

    width, height = map(int, size.split("x"))
    pixels = combined(tmp_path / "out.exr")
    assert pixels.shape == (height, width, 3)
    assert np.all(pixels > 0)


# Meshes


def test_an_empty_mesh(warns, stage):
    stage.add("hollow", plane("hollow", ()))
    warns(stage.save(), "hollow")


def test_points_without_faces(warns, stage):
    mesh = plane("dust", ())
    mesh.from_pydata([(0, 0, 1), (1, 0, 1)], [], [])
    stage.add("dust", mesh)
    warns(stage.save(), "dust")


def test_vertices_that_are_not_numbers(warns, stage):
    mesh = plane("broken", ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)))
    mesh.vertices[2].co = (float("nan"), 0, 0)
    stage.add("broken", mesh)
    assert np.all(warns(stage.save(), "broken") >= 0)


def test_a_mesh_of_triangles_keeps_those_that_are_sound(warns, stage):
    mesh = plane("shards", ())
    corners = [(x, y, 1) for x in range(3) for y in (0, 1)]
    mesh.from_pydata([*corners, (0, 0, 2)], [], [(0, 1, 6), (0, 1, 2), (2, 3, 4)])
    mesh.polygons[2].material_index = 1
    mesh.vertices[6].co = (float("nan"), 0, 0)
    stage.add("shards", mesh)
    assert np.all(warns(stage.save(), "shards", "1 triangles") >= 0)


def test_vertices_at_the_end_of_the_number_range(warns, stage):
    mesh = plane("vast", ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)))
    mesh.vertices[2].co = (float("inf"), 0, 0)  # Blender makes it 3.4e38
    stage.add("vast", mesh)
    assert np.all(warns(stage.save()) >= 0)


def test_triangles_of_no_area(warns, stage):
    stage.add("flat", plane("flat", ((0, 0, 1), (1, 0, 1), (2, 0, 1))))
    warns(stage.save())


def test_indices_out_of_range(warns, stage):
    mesh = plane("wild")
    mesh.attributes[".corner_vert"].data[1].value = 1000
    stage.add("wild", mesh)
    assert warns(stage.save(), "wild").mean() > 0


def test_a_flattened_object(warns, stage):
    thing = stage.add("flat", plane("flat"))
    thing.location.z, thing.scale = 1, (1, 1, 0)
    assert warns(stage.save()).mean() > 0


@pytest.mark.parametrize("scale", [(0, 0, 1), (0, 0, 0)])
def test_singular_transforms(warns, stage, scale):
    thing = stage.add("squashed", plane("squashed"))
    thing.location.z, thing.scale = 1, scale
    warns(stage.save(), "squashed")


def test_mirrored_transforms(warns, stage):
    reference = warns(stage.save())
    mirrored = mirrored_floor(stage)
    assert warns(mirrored) == pytest.approx(reference, rel=1e-3)


def mirrored_floor(stage):
    """The stage again, its floor mirrored (rendering has replaced the open file)."""
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(stage.folder / "scene.blend"))
    bpy.data.objects["floor"].scale = (-1, 1, 1)
    path = stage.folder / "mirrored.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


# Materials


def test_no_material(warns, stage):
    stage.floor.data.materials.clear()
    assert warns(stage.save()).mean() > 0


def test_an_empty_slot(warns, stage):
    stage.floor.material_slots[0].material = None
    assert warns(stage.save()).mean() > 0


def test_a_slot_that_is_not_there(warns, stage):
    stage.floor.data.polygons[0].material_index = 7
    assert warns(stage.save()).mean() > 0


def nodes_of(material):
    material.use_nodes = True
    material.node_tree.nodes.clear()
    return material.node_tree.nodes, material.node_tree.links


def test_a_material_without_output(warns, stage):
    nodes, _ = nodes_of(stage.material)
    nodes.new("ShaderNodeBsdfDiffuse")
    assert np.all(warns(stage.save(), "grey", "Material Output") == 0.0)


def test_an_output_without_surface(warns, stage):
    nodes, _ = nodes_of(stage.material)
    nodes.new("ShaderNodeOutputMaterial")
    assert np.all(warns(stage.save()) == 0.0)


def test_a_cycle_of_nodes(warns, stage):
    nodes, links = nodes_of(stage.material)
    output, diffuse = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfDiffuse")
    first, second = nodes.new("ShaderNodeMath"), nodes.new("ShaderNodeMath")
    links.new(diffuse.outputs[0], output.inputs[0])
    links.new(second.outputs[0], first.inputs[0])
    links.new(first.outputs[0], second.inputs[0])
    links.new(second.outputs[0], diffuse.inputs["Roughness"])
    warns(stage.save(), "grey", "cycle")


# Images


def textured(stage, image):
    nodes, links = nodes_of(stage.material)
    output, diffuse, texture = (
        nodes.new("ShaderNode" + name) for name in ("OutputMaterial", "BsdfDiffuse", "TexImage")
    )
    texture.image = image
    links.new(texture.outputs[0], diffuse.inputs[0])
    links.new(diffuse.outputs[0], output.inputs[0])


def is_magenta(pixels) -> bool:
    return bool(
        np.all(pixels[..., 1] == 0) and pixels[..., 0].mean() > 0 and np.allclose(pixels[..., 0], pixels[..., 2])
    )


def test_a_missing_image(warns, stage):
    import bpy

    image = bpy.data.images.new("gone", 4, 4)
    image.filepath, image.source = str(stage.folder / "gone.png"), "FILE"
    textured(stage, image)
    assert is_magenta(warns(stage.save(), "gone"))


@pytest.mark.parametrize("length", [0, 60])
def test_truncated_images(warns, stage, length):
    import bpy

    path = stage.folder / "cut.png"
    image = bpy.data.images.new("cut", 16, 16)
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)
    image = bpy.data.images.load(str(path))
    path.write_bytes(path.read_bytes()[:length])
    textured(stage, image)
    assert is_magenta(warns(stage.save(), "cut.png"))


def test_no_image_in_the_node(warns, stage):
    textured(stage, None)
    assert is_magenta(warns(stage.save(), "grey", "no image"))


# Lights


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA", "SUN"])
def test_lights_of_no_size(warns, stage, kind):
    light = stage.lamp.data
    light.type = kind
    light = stage.lamp.data
    if kind == "AREA":
        light.size = 0.0
    elif kind == "SUN":
        light.angle = 0.0
    else:
        light.shadow_soft_size = 0.0
    pixels = warns(stage.save(), *(["lamp"] if kind == "AREA" else []))
    assert kind == "AREA" or pixels.mean() > 0


@pytest.mark.parametrize("kind", ["POINT", "AREA", "SUN"])
def test_lights_of_no_power(warns, stage, kind):
    stage.lamp.data.type = kind
    stage.lamp.data.energy = 0.0
    assert np.all(warns(stage.save()) == 0.0)


def test_a_light_of_negative_power(warns, stage):
    import bpy

    bright = warns(stage.save())
    bpy.ops.wm.open_mainfile(filepath=str(stage.folder / "scene.blend"))
    second = bpy.data.objects.new("eater", bpy.data.lights.new("eater", "POINT"))
    bpy.context.scene.collection.objects.link(second)
    second.location, second.data.energy = (0, 0, 2), -50
    path = stage.folder / "eater.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert warns(path).mean() < bright.mean()


# The machine


def program(*argv, prepare="", **environment) -> subprocess.CompletedProcess:
    code = f"{prepare}\nfrom gi_engine import cli; cli.main()"
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, argv)],
        capture_output=True,
        text=True,
        timeout=240,
        env={**os.environ, **environment},
    )


def test_out_of_memory(stage, tmp_path):
    """Far more pixels than the process may have memory for."""
    out = tmp_path / "out.png"
    limit = "import resource; resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))"
    done = program("render", stage.save(), "-o", out, "--resolution", "40000x40000", prepare=limit)
    assert done.returncode == cli.FAILED, done
    assert "memory" in done.stderr, done.stderr
    assert sorted(os.listdir(tmp_path)) == ["scene.blend"]


def test_embree_is_missing(stage, tmp_path):
    out = tmp_path / "out.png"
    hide = "import importlib.util as u; find = u.find_spec; u.find_spec = lambda n, *a: None if n == 'embreex' else find(n, *a)"
    done = program("render", stage.save(), "-o", out, prepare=hide)
    assert done.returncode == cli.FAILED, done
    assert "Embree" in done.stderr, done.stderr
    assert not out.exists()


def test_embree_is_no_library(stage, tmp_path):
    fake, out = tmp_path / "libembree4.so", tmp_path / "out.png"
    fake.write_text("not a library")
    done = program("render", stage.save(), "-o", out, GI_ENGINE_EMBREE=str(fake))
    assert done.returncode == cli.FAILED, done
    assert str(fake) in done.stderr, done.stderr
    assert not out.exists()


def test_the_compiled_part_is_missing(stage, tmp_path):
    hide = "import sys; sys.modules['gi_engine_native'] = None"
    done = program("render", stage.save(), "-o", tmp_path / "out.png", prepare=hide)
    assert done.returncode == cli.FAILED
    assert "gi_engine_native" in done.stderr
