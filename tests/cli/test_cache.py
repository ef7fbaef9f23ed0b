"""What renders keep: `--cache`, files that cannot be used, frames of an animation, Blender's own animation render."""

import re
import struct

import numpy as np
import OpenEXR
import pytest

from gi_engine import cli, content, kept_file
from gi_engine import scene_data as sd

VERSION = 5  # of the tables of irradiance records
HERE = ("--integrator", "irradiance_cache", "--set", "record_samples=64", "--resolution", "32x32")


def combined(path) -> np.ndarray:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        found = {name: c.pixels for part in file.parts for name, c in part.channels.items()}
    return np.stack([next(v for k, v in found.items() if k.endswith(f"Combined.{c}")) for c in "RGB"], axis=-1)


def box(name, size, height=0.0):
    """A closed box around the origin, its faces turned inwards or not at all: diffuse from both sides."""
    import bpy

    s = size / 2
    v = [(x, y, z + height) for z in (-s, s) for y in (-s, s) for x in (-s, s)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(v, [], faces)
    return mesh


@pytest.fixture
def room(stage):
    """A camera at one end of a room that looks along its floor, and a small block that can be moved."""
    stage.room = stage.add("room", box("room", 6.0))
    stage.room.data.materials.append(stage.material)
    stage.block = stage.add("block", box("block", 0.3))
    stage.block.location = (2.0, 2.0, -1.0)
    stage.lamp.location, stage.floor.hide_render = (0, 0, 2), True
    stage.camera.location, stage.camera.rotation_euler = (0, -2.5, 0), (1.2, 0, 0)
    return stage


def records(done) -> int:
    return int(re.search(r"(\d+) records", done.out)[1])


def test_a_cache_is_kept_and_taken_over(gi, room, tmp_path):
    file, cache, out = room.save(), tmp_path / "light.cache", tmp_path / "out.exr"
    room.camera.rotation_euler = (1.2, 0, 1.0)
    turned = room.save("turned.blend")
    first = gi("render", file, "-o", out, "--cache", cache, *HERE)
    assert (first.code, first.err) == (cli.DONE, "")
    picture = combined(out)
    kept = kept_file.read(cache, "irradiance_cache", VERSION)
    assert sum(len(t) for name, t in kept.tables.items() if name != "bounds") == records(first)
    again = gi("render", file, "-o", out, "--cache", cache, *HERE)
    assert (again.code, again.err) == (cli.DONE, "")
    assert records(first) <= records(again) <= 1.02 * records(first)
    assert np.abs(combined(out) - picture).mean() < 0.01 * picture.mean()
    bytes_before = cache.read_bytes()
    still = ("--set", "refinement=0")
    assert records(gi("render", file, "-o", out, "--cache", cache, *HERE, *still)) == records(again)
    assert cache.read_bytes() == bytes_before  # nothing was added
    before = kept_file.read(cache, "irradiance_cache", VERSION).tables["bounce 1"]
    assert records(gi("render", file, "-o", out, "--cache", cache, *HERE)) == records(again)
    after = kept_file.read(cache, "irradiance_cache", VERSION).tables["bounce 1"]
    assert (after[:, -3] >= before[:, -3]).all()  # rays of each record, in portions
    assert after[:, -3].sum() > before[:, -3].sum()
    assert sorted(p.name for p in tmp_path.iterdir() if "blend" not in p.name) == ["light.cache", "out.exr"]
    # Seen from elsewhere it grows.
    assert records(gi("render", turned, "-o", out, "--cache", cache, *HERE)) > records(again)
    assert len(cache.read_bytes()) > len(bytes_before)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda b: b"P6 32 32 255\n" + b, "is no file of GI Engine's"),
        (lambda b: b[: len(b) // 2], "is damaged: its checksum is wrong"),
        (lambda b: b[:20], "is damaged: it ends too soon"),
        (lambda b: b[:-100] + bytes([b[-100] ^ 1]) + b[-99:], "is damaged: its checksum is wrong"),
        (lambda b: b[:8] + struct.pack("<I", 99) + b[12:], "is of format 99, this GI Engine reads 1"),
    ],
)
def test_a_file_that_cannot_be_used(gi, room, tmp_path, spoil, reason):
    file, cache, out = room.save(), tmp_path / "light.cache", tmp_path / "out.png"
    assert gi("render", file, "-o", out, "--cache", cache, *HERE).code == cli.DONE
    spoilt = spoil(cache.read_bytes())
    cache.write_bytes(spoilt)
    without = gi("render", file, "-o", out, "--cache", cache, *HERE)
    assert without.code == cli.DONE
    assert f'warning: "{cache}" {reason}; it is left as it is' in without.err
    assert cache.read_bytes() == spoilt
    out.unlink()
    stop = gi("render", file, "-o", out, "--cache", cache, "--cache-misfit", "stop", *HERE)
    assert (stop.code, out.exists()) == (cli.FAILED, False)
    assert f'gi-engine: "{cache}" {reason}' in stop.err
    replaced = gi("render", file, "-o", out, "--cache", cache, "--cache-misfit", "replace", *HERE)
    assert replaced.code == cli.DONE
    ours = spoilt.startswith(kept_file.MAGIC)
    assert (cache.read_bytes() != spoilt) == ours  # what is not ours stays
    assert ("it is replaced" in replaced.err) == ours


def test_a_file_of_another_scene(gi, room, tmp_path):
    cache, out = tmp_path / "light.cache", tmp_path / "out.png"
    file = room.save()
    room.lamp.data.energy = 50
    dimmed = room.save("dimmed.blend")
    room.lamp.data.energy = 100
    room.floor.hide_render = False
    changed = room.save("changed.blend")
    assert gi("render", file, "-o", out, "--cache", cache, *HERE).code == cli.DONE

    def err(*words, file=file):
        return gi("render", file, "-o", out, "--cache", cache, *HERE, *words).err

    assert "does not fit the scene: setting error has changed from 0.15 to 0.5;" in err("--set", "error=0.5")
    assert err("--set", "max_spacing=30", "--samples", 2, "--seed", 4) == ""
    assert 'does not fit the scene: lamp "lamp" has changed;' in err(file=dimmed)
    assert err(file=changed) == ""  # what lies near is dropped, and the rest serves on


def test_what_keeps_nothing_has_no_cache(gi, stage, tmp_path):
    done = gi("render", stage.save(), "-o", tmp_path / "out.png", "--cache", tmp_path / "x", "--integrator", "path")
    assert (done.code, done.err) == (
        cli.BAD_ARGUMENTS,
        'gi-engine: --cache: integrator "path" has nothing to keep; these have: photon_map, irradiance_cache\n',
    )
    done = gi("render", stage.save(), "-o", tmp_path / "out.png", "--cache", tmp_path / "missing" / "x")
    assert done.code == cli.BAD_ARGUMENTS


def test_an_animation_fills_the_cache_once(gi, room, tmp_path):
    """Filled along the camera's path in the first frame, so that those after it have nothing to add."""
    room.scene.frame_start, room.scene.frame_end = 3, 6
    for frame, x in ((3, -0.5), (6, 0.5)):
        room.camera.location.x = x
        room.camera.keyframe_insert("location", frame=frame)
    done = gi("render", room.save(), "-o", tmp_path / "f.png", "--animation", *HERE)
    assert (done.code, done.err) == (cli.DONE, "")
    assert sorted(p.name for p in tmp_path.glob("*.png")) == [f"f000{n}.png" for n in (3, 4, 5, 6)]
    counts = [int(n) for n in re.findall(r"(\d+) records", done.out)]
    assert len(counts) == 4
    assert counts[0] > 50
    assert counts[-1] - counts[0] <= 0.01 * counts[0]
    alone = gi("render", tmp_path / "scene.blend", "-o", tmp_path / "g.png", "--frame", 3, *HERE)
    assert records(alone) < counts[0]


def test_blenders_own_animation_keeps_what_holds(room, tmp_path, capfd):
    """Each frame has a RenderEngine of its own; records near a moved block are dropped, others serve on."""
    import bpy

    scene = room.scene
    scene.gi_engine.integrator, scene.gi_engine.irradiance_cache.record_samples = "irradiance_cache", 64
    scene.render.resolution_x = scene.render.resolution_y = 32
    scene.frame_start, scene.frame_end = 1, 3
    for frame, x in ((1, 2.0), (2, 2.0), (3, 1.9)):
        room.block.location.x = x
        room.block.keyframe_insert("location", frame=frame)
    scene.render.filepath = str(tmp_path / "a")
    bpy.ops.render.render(animation=True)
    text = capfd.readouterr().out
    taken = [int(n) for n in re.findall(r"(\d+) taken over", text)]
    worked_out = [int(n) for n in re.findall(r"(\d+) records in the irradiance cache", text)]
    assert len(worked_out) == 3
    assert len(taken) == 2
    assert taken[0] == worked_out[0]
    assert 0.3 * worked_out[1] < taken[1] < worked_out[1]
    dropped = re.search(r'(\d+) records near "block" are dropped', text)
    assert worked_out[1] - int(dropped[1]) == taken[1]
    scene.gi_engine.keep = False
    bpy.ops.render.render(animation=True)
    assert "taken over" not in capfd.readouterr().out


# -------------------------------------------------------------------------------------------------- content


def test_what_is_far_from_a_box():
    boxes = np.array([[1, 1, 1, 2, 2, 2]], np.float32)
    positions = np.array([(0, 0, 0), (0, 0, 0), (1.5, 1.5, 1.5), (30, 0, 0), (1.5, 1.5, 0.99)], np.float32)
    normals = np.array([(0, 0, 1), (0, 0, -1), (0, 0, -1), (-1, 0, 0), (0, 0, -1)], np.float32)
    assert content.far_from(boxes, positions, normals).tolist() == [False, True, False, True, True]
    assert content.far_from(np.zeros((0, 6), np.float32), positions, normals).all()


def test_places_that_moved_are_told_from_those_that_did_not():
    mesh = sd.Mesh("m", np.eye(3, dtype=np.float32), np.arange(3, dtype=np.int32), None, None, None, "FACE", None)
    matrices = np.stack([np.eye(4, dtype=np.float32)] * 3)
    matrices[:, 0, 3] = (0, 10, 20)

    def scene(matrix):
        return sd.Scene(meshes=[mesh], instances=[sd.Instance("many", 0, matrix, [])])

    before = content.content_of(scene(matrices), sd.Settings())
    elsewhere = matrices.copy()
    elsewhere[1, 0, 3] = 11
    change = content.compare(before, content.content_of(scene(elsewhere), sd.Settings()))
    assert (change.reason, change.names) == ("", ["many"])
    np.testing.assert_allclose(change.boxes[:, 0], (10, 11))
    assert content.compare(before, content.content_of(scene(matrices), sd.Settings())).names == []
    gone = content.compare(before, content.content_of(sd.Scene(), sd.Settings()))
    assert len(gone.boxes) == 3
