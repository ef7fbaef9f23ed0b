"""`gi-engine info` and `gi-engine integrators`; the commands inside Blender; words about progress."""

import io
import re

import pytest

from gi_engine import arguments, cli, headless, native
from gi_engine.control import Progress
from gi_engine.display import PlainDisplay, amount, details, duration

from .conftest import plane


def test_what_would_be_rendered(gi, stage):
    copy = stage.add("copy", stage.floor.data)
    copy.location.z = -1
    stage.add("triangle", plane("triangle", ((0, 0, 0), (1, 0, 0), (0, 1, 0))))
    stage.add("sun", light("SUN"))
    stage.scene.cycles.samples = 77
    done = gi("info", stage.save())
    assert (done.code, done.err) == (cli.DONE, "")
    for words in (
        'scene: "Scene", frame 1',
        'view layer: "ViewLayer"',
        'camera: "camera", perspective',
        "24 x 16 pixels; passes Combined",
        "path, 77 samples",
        "3 instances of 2 meshes",
        "3 stored, 5 placed",
        "1 point, 1 sun",
        '"grey"',
        "Embree: ",
        "embree4",
    ):
        assert words in done.out, (words, done.out)
    assert not list(stage.folder.glob("*.png"))


def light(kind):
    import bpy

    return bpy.data.lights.new(kind, kind)


def test_what_is_not_supported(gi, stage):
    mesh = plane("broken")
    mesh.vertices[0].co = (float("nan"), 0, 0)
    stage.add("broken", mesh)
    stage.scene.render.use_motion_blur = True
    done = gi("info", stage.save())
    assert done.code == cli.DONE
    assert re.search("warning: .*broken", done.out)
    assert re.search("warning: .*motion blur", done.out)


def test_every_view_layer_is_told(gi, stage):
    stage.scene.view_layers.new("second")
    done = gi("info", stage.save())
    assert 'view layer: "ViewLayer"' in done.out and 'view layer: "second"' in done.out


def test_a_border(gi, stage):
    render = stage.scene.render
    render.use_border, render.border_min_x, render.border_max_x = True, 0.5, 1.0
    render.border_min_y, render.border_max_y = 0.0, 1.0
    assert "12 x 16 are rendered" in gi("info", stage.save()).out


def test_info_on_a_bad_scene(gi, stage):
    stage.scene.camera = None
    done = gi("info", stage.save())
    assert (done.code, "no camera" in done.err) == (cli.FAILED, True)


def test_integrators_and_their_parameters(gi):
    done = gi("integrators")
    assert (done.code, done.err) == (cli.DONE, "")
    for descriptor in native.integrators():
        assert f"{descriptor['id']}: {descriptor['label']}." in done.out
        for parameter in descriptor["parameters"]:
            assert f"    {parameter['name']}={parameter['default']} (" in done.out


def test_the_readme_lists_the_integrators(root):
    listed = re.findall(r"^\| `(\w+)` \|", (root / "README.md").read_text(), re.M)
    assert listed == [descriptor["id"] for descriptor in native.integrators()]


def test_every_default_is_valid():
    for descriptor in native.integrators():
        arguments.check_parameters(descriptor, {p["name"]: str(p["default"]) for p in descriptor["parameters"]})


def test_inside_blender_the_open_file_is_rendered(stage, tmp_path):
    stage.save()
    stage.scene.render.resolution_x = 12  # not saved
    out = tmp_path / "out.png"
    assert headless.run_in_blender(["render", "-o", str(out)]) == cli.DONE
    assert int.from_bytes(out.read_bytes()[16:20], "big") == 12


def test_inside_blender_a_named_file_is_opened(stage, tmp_path):
    file, out = stage.save(), tmp_path / "out.png"
    stage.scene.render.resolution_x = 12
    assert headless.run_in_blender(["render", str(file), "-o", str(out)]) == cli.DONE
    assert int.from_bytes(out.read_bytes()[16:20], "big") == 24


@pytest.mark.parametrize(
    ("value", "text"), [(0, "0 "), (12.34, "12.3 "), (4567, "4.57 k"), (1.5e6, "1.5 M"), (2e9, "2 G")]
)
def test_amounts(value, text):
    assert amount(value) == text


@pytest.mark.parametrize(("seconds", "text"), [(0.04, "0.0 s"), (9.9, "9.9 s"), (61.2, "01:01"), (3725, "1:02:05")])
def test_durations(seconds, text):
    assert duration(seconds) == text


def test_progress_in_words():
    progress = Progress("Render", fraction=0.25, passes=32, rays=40_000_000, seconds=20.0)
    assert details(progress) == "32 passes, 01:00 left, 2 Mrays/s"
    assert details(Progress("Building", 0.0)) == "Building"
    assert details(Progress("Render", 0.5, 2, 10, 1.0, 1.0, 0.123456)).endswith("noise 0.123")


def test_plain_progress_is_sparse():
    stream = io.StringIO()
    display = PlainDisplay(stream)
    display.begin("a.png")
    for _ in range(100):
        display.update(Progress("Render", 0.5, 8, 1000, 1.0))
    assert stream.getvalue() == ""
    display.next = 0.0
    display.update(Progress("Render", 0.5, 8, 1000, 1.0))
    assert stream.getvalue() == "a.png: 50 %, 8 passes, 1.0 s left, 1 krays/s\n"
