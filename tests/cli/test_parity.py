"""`gi-engine parity`: scenes that agree, differ, fail and crash are all in the table, and a second run goes on."""

import csv
import json

import bpy
import pytest

from gi_engine import cli
from gi_engine.compare import child

from .conftest import plane


@pytest.fixture
def survey(gi, stage, tmp_path):
    """Scenes: a floor in the sun; the same under a wall, whose light ray tracing leaves out; one without a camera; two that are damaged or
    shot (see `shoot`)."""
    folder = tmp_path / "in"
    (folder / "deep").mkdir(parents=True)
    stage.folder = folder
    stage.lamp.data = bpy.data.lights.new("sun", "SUN")
    stage.lamp.data.angle = 0
    stage.save("open.blend")
    stage.save("shot.blend")
    stage.add("wall", plane("wall", ((-5, 1, 0), (5, 1, 0), (5, 1, 5), (-5, 1, 5))))
    stage.save("walled.blend")
    stage.scene.camera = None
    stage.save("deep/blind.blend")
    (folder / "garbage.blend").write_bytes((folder / "open.blend").read_bytes()[:3000])

    def run(*argv):
        limits = ("--samples", 16, "--size", 24, "--threads", 1)
        done = gi("parity", folder, "--engine", "whitted", "-o", tmp_path / "out", *limits, *argv)
        return done, {
            row["scene"]: row for row in csv.DictReader((tmp_path / "out/parity.csv").read_text().splitlines())
        }

    return run


@pytest.fixture
def shoot(monkeypatch):
    """Ends the process that compares on "shot" while it does."""
    ask = child.Child.ask

    def shooting(self, do, *args, **arguments):
        if do == "compare" and "shot" in arguments["plan"]["file"]:
            self.process.kill()
            self.process.wait()
        return ask(self, do, *args, **arguments)

    monkeypatch.setattr(child.Child, "ask", shooting)
    return monkeypatch


def test_nothing_ends_the_run_and_it_goes_on(survey, shoot, tmp_path):
    notes = tmp_path / "notes.json"
    notes.write_text(json.dumps({"walled": "light from the wall is left out"}))
    done, rows = survey("--notes", notes)
    assert done.code == cli.FAILED
    kinds = {name: row["verdict"] for name, row in rows.items()}
    assert kinds == {
        "deep/blind": "failed",
        "garbage": "failed",
        "open": "agrees",
        "shot": "failed",
        "walled": "differs",
    }
    assert "no camera" in rows["deep/blind"]["error"] and "cannot be opened" in rows["garbage"]["error"]
    assert "crashed" in rows["shot"]["error"]
    assert float(rows["walled"]["mean_ratio"]) < 0.97 and int(rows["walled"]["blocks_beyond_noise"]) > 0
    text = (tmp_path / "out/parity.md").read_text()
    assert (
        "Of 5 scenes, 1 agree within noise, 1 differ, 3 failed." in text and "light from the wall is left out" in text
    )
    assert (tmp_path / "out/parity.html").read_text().count("data:image/png") == 2 * 2
    assert not list((tmp_path / "out").rglob(".gi-engine-*"))

    shoot.undo()
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out/scenes").glob("*/row.json")}
    done, again = survey()
    assert [name for name, row in again.items() if row["verdict"] == "failed"] == ["deep/blind", "garbage"]
    assert again["shot"]["verdict"] == "agrees"
    anew = {path.parent.name for path, time in before.items() if path.stat().st_mtime_ns != time}
    assert anew == {"deep_blind", "garbage", "shot"}


def test_a_scene_that_takes_too_long_is_given_up(survey, tmp_path):
    done, rows = survey("--limit", 0.2)
    assert {row["error"] for row in rows.values()} == {"not done after 0.2 s"} and len(rows) == 5
    assert done.code == cli.FAILED


def test_what_cannot_be_asked_for_is_said(gi, stage, tmp_path):
    stage.save()
    for words, says in (
        ((tmp_path / "none",), "is not there"),
        ((tmp_path, "--engine", "nonsense"), 'no engine "nonsense"'),
        ((tmp_path, "--notes", tmp_path / "none.json"), "--notes"),
    ):
        done = gi("parity", *words, "-o", tmp_path / "out")
        assert done.code == cli.BAD_ARGUMENTS and says in done.err
