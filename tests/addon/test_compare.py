"""The button that compares: what is open, unsaved changes and files beside it included, and what is left when it is stopped."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import bpy
import numpy as np
import pytest

from gi_engine.compare import job, pictures
from gi_engine.ui import compare

from .conftest import add, mesh

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes as Linux shows them")


@pytest.fixture
def lit(scene, tmp_path):
    """A floor that glows as the picture beside the file does: red."""
    picture = bpy.data.images.new("red", 2, 2)
    picture.pixels.foreach_set(np.tile(np.float32([0.5, 0, 0, 1]), 4))
    picture.filepath_raw, picture.file_format = str(tmp_path / "red.png"), "PNG"
    picture.save()
    picture.filepath = "//red.png"
    made = bpy.data.materials.new("glow")
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    shader, image, out = (nodes.new(f"ShaderNode{kind}") for kind in ("Emission", "TexImage", "OutputMaterial"))
    image.image = picture
    made.node_tree.links.new(image.outputs["Color"], shader.inputs["Color"])
    made.node_tree.links.new(shader.outputs[0], out.inputs["Surface"])
    floor = add(scene, "Floor", mesh("Floor", ((-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0))))
    floor.data.materials.append(made)
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "lit.blend"), compress=False)
    settings = scene.gi_engine.compare
    settings.seconds, settings.folder = 0.2, str(tmp_path / "out")
    shader.inputs["Strength"].default_value = 3  # not saved
    return scene


def started() -> set[int]:
    """Processes for comparing that this one and its children have started."""
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent = path.read_text().rpartition(")")[2].split()[:2]
        except OSError:  # gone by now
            continue
        if state != "Z":
            parents[int(path.parent.name)] = int(parent)
    found, more = set(), {os.getpid()}
    while more:
        found |= more
        more = {process for process, parent in parents.items() if parent in found} - found
    return {process for process in found - {os.getpid()} if "gi_engine.compare" in command_of(process)}


def command_of(process: int) -> str:
    try:
        return Path(f"/proc/{process}/cmdline").read_text()
    except OSError:
        return ""


def test_the_scene_as_it_is(lit, tmp_path):
    before = {name: getattr(lit.render, name) for name in ("engine", "filepath", "use_compositing", "resolution_x")}
    samples, path, names = lit.cycles.samples, bpy.data.filepath, set(bpy.data.images.keys())
    assert bpy.ops.gi_engine.compare() == {"FINISHED"}
    facts = json.loads((tmp_path / "out/report.json").read_text())
    assert [engine["engine"] for engine in facts["engines"]] == ["path", "cycles"]
    assert facts["file"] == "lit.blend" and facts["size"] == [16, 12] and not facts["unsupported"]
    for engine in facts["engines"]:
        assert not engine["error"] and engine["blocks_beyond_noise"] == 0
        red = pictures.read_exr(tmp_path / "out" / engine["picture"]).mean((0, 1))
        assert red[0] == pytest.approx(3 * 0.214, rel=0.02) and red[1] < 0.01  # 0.5 of sRGB
    assert (tmp_path / "out/report.html").stat().st_size > 20000
    assert {name: getattr(lit.render, name) for name in before} == before
    assert (lit.cycles.samples, bpy.data.filepath) == (samples, path)
    ours, theirs = (bpy.data.images[compare.NAME + name] for name in ("Path Tracing", "Cycles"))
    assert tuple(ours.size) == tuple(theirs.size) == (16, 12) and ours.is_float
    assert set(bpy.data.images.keys()) - names == {ours.name, theirs.name}
    assert {path.name for path in tmp_path.iterdir()} == {"lit.blend", "out", "red.png"}
    assert not list((tmp_path / "out").glob(".*")) and not list(job.session_folder("scene").iterdir())
    assert not started()

    # Once more, without a change: the reference is kept, and the same images show the new pictures.
    assert bpy.ops.gi_engine.compare() == {"FINISHED"}
    if bpy.app.version >= (5, 2):  # before, no two copies are the same
        assert json.loads((tmp_path / "out/report.json").read_text())["reference"]["rendered_now"] == 0
    assert set(bpy.data.images.keys()) - names == {ours.name, theirs.name}


def test_stopping_leaves_nothing(lit, tmp_path):
    lit.gi_engine.compare.seconds = 300
    running = job.Job(lit)
    deadline = time.monotonic() + 120
    while "samples" not in running.text:  # a process of the process renders
        assert time.monotonic() < deadline and not running.done(0.05), running.error
    assert len(started()) == 2
    start = time.monotonic()
    running.cancel()
    assert time.monotonic() - start < 5
    while started():
        assert time.monotonic() - start < 10
        time.sleep(0.05)
    assert {path.name for path in tmp_path.iterdir()} == {"lit.blend", "red.png"}
    assert not list(job.session_folder("scene").iterdir())


def test_one_engine_fails_and_the_other_stays(lit, tmp_path):
    lit.camera.scale = (0, 0, 0)
    assert bpy.ops.gi_engine.compare() == {"FINISHED"}
    ours, theirs = json.loads((tmp_path / "out/report.json").read_text())["engines"]
    assert "camera" in ours["error"].lower() and not theirs["error"]
    assert compare.NAME + "Cycles" in bpy.data.images and compare.NAME + "Path Tracing" not in bpy.data.images


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"engines": set()}, "no engine is chosen"),
        ({"folder": "/proc/nowhere/at/all"}, "cannot be used"),
        ({"reference": "FILE", "reference_file": "none.exr"}, "is not there"),
        ({"reference": "FILE", "reference_file": "red.png"}, "must end in .exr"),
    ],
)
def test_what_is_wrong_is_said_at_once(lit, tmp_path, change, says):
    for name, value in change.items():
        setattr(lit.gi_engine.compare, name, value)
    with pytest.raises(RuntimeError, match=says):
        bpy.ops.gi_engine.compare()
    assert {path.name for path in tmp_path.iterdir()} == {"lit.blend", "red.png"}


def test_one_at_a_time(lit, monkeypatch):
    assert bpy.ops.gi_engine.compare.poll()
    monkeypatch.setattr(compare.GI_OT_compare, "running", True)
    assert not bpy.ops.gi_engine.compare.poll()
