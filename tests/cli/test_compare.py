"""`gi-engine compare`: engines against a reference, and what happens where one of them, or the reference, fails."""

import csv
import json

import bpy
import cycles
import numpy as np
import OpenEXR
import pytest

from gi_engine import cli, control
from gi_engine.compare import child, pictures, plan, reference, runner, worker

SMALL = ("--samples", 16, "--reference-samples", 64, "--threads", 1)


@pytest.fixture
def compare(gi, stage, tmp_path):
    """Runs the command on the stage; references are kept in a folder of the test's."""
    file = stage.save()

    def run(*argv):
        done = gi("compare", file, "--cache", tmp_path / "cache", "-o", tmp_path / "report", *SMALL, *argv)
        report = tmp_path / "report" / "report.json"
        return done, json.loads(report.read_text()) if report.exists() else None

    return run


def by_name(facts) -> dict:
    return {engine["engine"]: engine for engine in facts["engines"]}


def test_engines_that_agree(compare, stage, tmp_path):
    """In the soft light of a wide lamp; our own denoiser is on in the scene, and must not be in the comparison."""
    stage.lamp.data = bpy.data.lights.new("wide", "AREA")
    stage.lamp.data.energy, stage.lamp.data.size = 100, 3
    stage.scene.gi_engine.use_denoising = True
    stage.scene.view_layers[0].use_pass_z = True
    stage.save()
    done, facts = compare("--engines", "path,cycles")
    assert done.code == cli.DONE, done.err
    assert facts["size"] == [24, 16] and not facts["warnings"]
    for engine in by_name(facts).values():
        assert engine["samples"] == 16 and len(engine["steps"]) == 4
        assert engine["blocks"] == 6 and engine["blocks_beyond_noise"] == 0
        assert engine["mean_ratio"] == pytest.approx(1, abs=max(5 * engine["mean_ratio_error"], 0.01))
        assert engine["passes"]["Depth"]["relative_mse"] < 1e-4
        assert all(engine[name] > 0 for name in ("startup", "load", "seconds", "memory", "flip", "relative_mse"))
    ours, theirs = (by_name(facts)[name] for name in ("path", "cycles"))
    assert 0.3 < ours["relative_mse"] / theirs["relative_mse"] < 3 and theirs["relative_mse"] > 1e-4
    assert ours["rays_per_second"] > 0
    rows = list(csv.DictReader((tmp_path / "report/report.csv").read_text().splitlines()))
    assert [row["engine"] for row in rows] == ["path", "cycles"]
    image = pictures.read_exr(tmp_path / "report" / by_name(facts)["path"]["picture"])
    assert image.shape == (16, 24, 3) and image.mean() > 0
    page = (tmp_path / "report/report.html").read_text()
    assert page.count("data:image/png;base64,") == 3 + 2 * 3


def test_a_reference_is_rendered_once_and_goes_on(compare, tmp_path):
    words = ("--engines", "path", "--reference", "path")
    _, first = compare(*words)
    assert (first["reference"]["pieces"], first["reference"]["rendered_now"]) == (8, 8)
    assert first["reference"]["samples"] == 64
    # As if it had been interrupted after five pieces, with the sixth half written.
    pieces = sorted((tmp_path / "cache").rglob("piece_???.exr"))
    pieces[5].write_bytes(pieces[5].read_bytes()[:100])
    for piece in pieces[6:]:
        piece.with_suffix(".json").unlink()
    done, again = compare(*words)
    assert again["reference"]["rendered_now"] == 3
    assert "a piece that was kept is rendered anew" in done.err and "damaged" in done.err
    assert again["engines"][0]["blocks_beyond_noise"] == 0


def test_one_engine_fails_and_the_others_stay(compare, monkeypatch):
    """The process of one engine is shot while it renders."""
    ask = child.Child.ask

    def shoot(self, do, *args, **arguments):
        if do == "render" and "whitted" in str(arguments["path"]):
            self.process.kill()
            self.process.wait()
        return ask(self, do, *args, **arguments)

    monkeypatch.setattr(child.Child, "ask", shoot)
    done, facts = compare("--engines", "whitted,path", "--reference", "path")
    assert done.code == cli.FAILED
    engines = by_name(facts)
    assert "crashed" in engines["whitted"]["error"] and "Ray Tracing: crashed" in done.err
    assert engines["path"]["relative_mse"] > 0 and not engines["path"]["error"]


def test_a_reference_of_another_size_or_damaged_is_named(compare, tmp_path):
    path = tmp_path / "truth.exr"
    pictures.write_exr(path, np.ones((8, 9, 3), np.float32))
    done, facts = compare("--engines", "path", "--reference", path)
    assert done.code == cli.FAILED
    assert '"' + str(path) + '" is 9x8 pixels, the pictures are 24x16' in facts["warnings"][0]
    assert facts["engines"][0]["samples"] == 16
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(pictures.PictureError, match="is damaged or no EXR"):
        reference.from_file(path, (24, 16))
    done, facts = compare("--engines", "path", "--reference", path)
    assert done.code == cli.FAILED and "no reference" in done.err and "is damaged or no EXR" in done.err
    assert facts["engines"][0]["samples"] == 16 and facts["reference"] is None


def test_a_scene_that_one_engine_cannot_render(compare, stage):
    """Cycles takes a camera without a size, and the other's figures stay."""
    stage.camera.scale = (0, 0, 0)
    stage.save()
    done, facts = compare("--engines", "path,cycles")
    ours, theirs = (by_name(facts)[name] for name in ("path", "cycles"))
    assert done.code == cli.FAILED and f"Path Tracing: {ours['error']}" in done.err
    assert "camera" in ours["error"].lower() and not theirs["error"] and theirs["samples"] == 16


def test_an_engine_that_is_missing_is_named(stage, monkeypatch):
    """As Blender is where the add-on of Cycles is switched off."""
    bpy.utils.unregister_class(cycles.CyclesRender)
    try:
        with pytest.raises(control.RenderError, match="Cycles is not in this Blender"):
            worker.choose_engine(stage.scene, "cycles")
    finally:
        bpy.utils.register_class(cycles.CyclesRender)
    worker.choose_engine(stage.scene, "cycles")


def test_pictures_of_two_sizes_are_not_compared(tmp_path, monkeypatch):
    monkeypatch.setattr(runner.Run, "show", lambda self: None)
    run = runner.Run(plan.Plan(tmp_path / "a.blend", ["path", "whitted"], tmp_path, samples=1), runner.Watcher())
    run.result.reference = reference.Reference("Cycles", np.ones((16, 24, 3), np.float32), 0.0, {}, {})
    for rendered, size in zip(run.result.engines, ((8, 24, 3), (16, 24, 3)), strict=True):
        rendered.pixels = np.ones(size, np.float32)
        rendered.steps = [{"sampling": 1.0, "not_finite": 0, "file": "none.exr"}]
    run.judge()
    small, right = run.result.engines
    assert small.error == "the picture is 24x8 pixels, the reference 24x16: not compared" and not small.figures
    assert not right.error and right.figures["relative_mse"] == 0


def test_packages_that_are_missing_are_named(tmp_path, monkeypatch):
    """Inside Blender there is no FLIP and no OpenEXR."""
    monkeypatch.setattr(runner.metrics, "has_flip", lambda: False)
    monkeypatch.setattr(pictures, "reads_passes", lambda: False)
    run = runner.Run(plan.Plan(tmp_path / "a.blend", ["path"], tmp_path, samples=1), runner.Watcher())
    run.name_missing_packages()
    assert ["FLIP is left out" in w or "passes are left out" in w for w in run.result.warnings] == [True, True]
    pixels = np.random.default_rng(1).random((5, 7, 3), np.float32)
    pictures.write_exr(tmp_path / "by_blender.exr", pixels)
    np.testing.assert_allclose(pictures.read_exr(tmp_path / "by_blender.exr"), pixels, rtol=1e-6)


def test_what_cannot_be_asked_for_is_said(gi, stage, tmp_path):
    file = stage.save()
    for words, says in (
        (("--engines", "path,nonsense"), 'no engine "nonsense"; there are: cycles, whitted'),
        (("--reference", tmp_path / "none.exr"), "is not there"),
        (("--region", "0.5,0,0.2,1"), "is not X0,Y0,X1,Y1"),
    ):
        done = gi("compare", file, "-o", tmp_path / "report", *words)
        assert done.code == cli.BAD_ARGUMENTS and says in done.err
    assert not (tmp_path / "report" / "report.json").exists()


def test_exr_files_of_colours_come_back(tmp_path):
    pixels = np.random.default_rng(1).random((5, 7, 3), np.float32)
    pictures.write_exr(tmp_path / "a.exr", pixels)
    assert np.array_equal(pictures.read_exr(tmp_path / "a.exr"), pixels)
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        assert set(file.channels()) == {"RGB"}


def test_a_process_that_hangs_is_ended():
    with child.Child() as process, pytest.raises(child.ChildFailed, match="not done after 0 s"):
        process.ask("open", limit=0.0, file="none.blend", engine="path", view={})
    assert process.process.poll() is not None
