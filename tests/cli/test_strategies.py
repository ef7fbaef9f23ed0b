"""`gi-engine render --strategies`: every technique of bidirectional path tracing by itself, and what they add up to."""

import json

import numpy as np
import OpenEXR
import pytest

from gi_engine import cli


def picture(path) -> np.ndarray:
    """(height, width, 3)"""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for part in file.parts for name, channel in part.channels.items()}
    return np.stack([next(v for k, v in channels.items() if k.split(".")[-1] == c) for c in "RGB"], -1)


@pytest.fixture
def corner(stage):
    """A wall beside the floor, both white, under a lamp that rays can meet."""
    import bpy

    from .conftest import plane

    wall = stage.add("wall", plane("wall", ((-5, 1, 0), (5, 1, 0), (5, 1, 5), (-5, 1, 5))))
    wall.data.materials.append(stage.material)
    lamp = bpy.data.lights.new("area", "AREA")
    lamp.energy, lamp.size = 100, 1.5
    stage.lamp.data = lamp
    return stage


COMMON = ("--integrator", "bdpt", "--samples", 64, "--set", "max_bounces=2", "--seed", 3)


def test_weighted_techniques_add_up_to_the_picture(gi, corner, tmp_path):
    file, folder, out = corner.save(), tmp_path / "pyramid", tmp_path / "out.exr"
    assert gi("render", file, "-o", out, *COMMON).code == cli.DONE
    done = gi("render", file, "--strategies", folder, *COMMON)
    assert (done.code, done.err) == (cli.DONE, "")
    index = json.loads((folder / "strategies.json").read_text())
    weighted = {(p["s"], p["t"]): picture(folder / p["file"]) for p in index["pictures"] if p["weighted"]}
    assert set(weighted) == {(s, n - s) for n in range(2, 6) for s in range(n)} - {(1, 1)}
    total, whole = sum(weighted.values()), picture(out)
    # Connections are drawn from all vertices in the one, from those of the technique in the other: the same but for noise.
    assert total.mean() == pytest.approx(whole.mean(), rel=0.01)
    assert np.abs(total - whole).mean() < 0.05 * whole.mean()
    # No technique is idle, and the unweighted ones that can be alone have the mean of all.
    assert all(weighted[way].mean() > 0 for way in ((1, 2), (2, 1), (1, 3), (2, 2), (3, 1)))
    unweighted = {(p["s"], p["t"]): p["mean"] for p in index["pictures"] if not p["weighted"]}
    direct = sum(weighted[way].mean() for way in ((0, 3), (1, 2), (2, 1)))
    for way in ((1, 2), (2, 1)):
        assert unweighted[way] == pytest.approx(direct, rel=0.05)
    for name in ("weighted.png", "unweighted.png"):
        assert (folder / name).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_what_cannot_be_shown_is_said(gi, stage, tmp_path):
    file = stage.save()
    done = gi("render", file, "--strategies", tmp_path / "a", "--integrator", "path")
    assert done.code == cli.BAD_ARGUMENTS
    assert "bdpt" in done.err
    done = gi("render", file, "--strategies", tmp_path / "a", "--integrator", "bdpt", "-o", tmp_path / "a.png")
    assert done.code == cli.BAD_ARGUMENTS
    done = gi("render", file, "--strategies", tmp_path / "no" / "a", "--integrator", "bdpt")
    assert done.code == cli.BAD_ARGUMENTS
    assert "no" in done.err


def test_long_paths_that_are_left_out_are_said(gi, stage, tmp_path):
    done = gi("render", stage.save(), "--strategies", tmp_path / "a", "--integrator", "bdpt", "--samples", 1)
    assert done.code == cli.DONE
    assert "more than 8 vertices" in done.err
