"""`gi-engine series`: the classic figure's steps as pictures and on one sheet, and what happens where one of them fails."""

import numpy as np
import pytest
from PIL import Image

from gi_engine import cli
from gi_engine.compare import child, pictures, series

STEPS = [step.name for step in series.steps()]


@pytest.fixture
def figure(gi, stage, tmp_path):
    """Runs the command on a red floor; its pictures by step."""
    stage.material.use_nodes = True
    stage.material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.1, 0.1, 1)
    file = stage.save()

    def run():
        limits = ("--samples", 16, "--reference-samples", 32, "--threads", 1, "--resolution", "24x16")
        done = gi("series", file, "-o", tmp_path / "out", *limits)
        return done, {name: tmp_path / "out" / f"{name}.exr" for name in STEPS}

    return run


def test_every_step_adds_light(figure, tmp_path):
    done, files = figure()
    assert done.code == cli.DONE, done.err
    mean = {name: pictures.read_exr(file).mean((0, 1)) for name, file in files.items()}
    for name in STEPS:
        assert mean[name][0] > 3 * mean[name][2], f"{name} is not red"
    # Nothing here throws caustics, and the only other light is the floor's.
    assert mean["caustics"] == pytest.approx(mean["soft_shadows"], rel=0.03)
    assert mean["global_illumination"] == pytest.approx(mean["reference"], rel=0.03)
    sheet = np.asarray(Image.open(tmp_path / "out" / series.SHEET))
    assert sheet.shape[1] > 5 * 24 and sheet.shape[2] == 3


def test_a_step_that_fails_leaves_its_place_empty(figure, monkeypatch, tmp_path):
    ask = child.Child.ask

    def shoot(self, do, *args, **arguments):
        if do == "render" and "soft_shadows" in str(arguments["path"]):
            self.process.kill()
            self.process.wait()
        return ask(self, do, *args, **arguments)

    monkeypatch.setattr(child.Child, "ask", shoot)
    done, files = figure()
    assert done.code != cli.DONE and "+ soft shadows failed" in done.err
    assert [name for name, file in files.items() if not file.exists()] == ["soft_shadows"]
    assert (tmp_path / "out" / series.SHEET).exists()
