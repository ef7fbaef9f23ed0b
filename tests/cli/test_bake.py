"""`gi-engine bake`: the light of a floor into an EXR, by path tracing and by particles; what cannot be baked is said."""

import numpy as np
import OpenEXR
import pytest

from gi_engine import cli


def picture(path) -> np.ndarray:
    """(height, width, 3)"""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for part in file.parts for name, channel in part.channels.items()}
    return np.stack([next(v for k, v in channels.items() if k.split(".")[-1] == c) for c in "RGB"], -1)


def test_both_integrators_bake_the_same_light(gi, stage, tmp_path):
    file, found = stage.save(), {}
    for integrator in ("path", "particle"):
        out = tmp_path / f"{integrator}.exr"
        common = ("--object", "floor", "--image", out, "--size", "16x16", "--integrator", integrator, "--samples", 32)
        done = gi("bake", file, *common, "--no-denoise")
        assert done.code == cli.DONE, done.err
        found[integrator] = picture(out)
        assert found[integrator].shape == (16, 16, 3) and found[integrator].mean() > 0
    assert found["particle"].mean() == pytest.approx(found["path"].mean(), rel=0.05)


def test_an_unknown_object_is_named_and_no_file_is_made(gi, stage, tmp_path):
    done = gi("bake", stage.save(), "--object", "ceiling", "--image", tmp_path / "out.exr")
    assert done.code not in (cli.DONE,) and "ceiling" in done.err
    assert not (tmp_path / "out.exr").exists()
