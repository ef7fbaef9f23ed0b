"""Denoising of the finished picture by Blender's own library."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from gi_engine import engine
from gi_engine.bake import blender_folders
from gi_engine.cleaner import Cleaner
from gi_engine.denoise import Stopped, denoise

from .conftest import add, mesh


@pytest.fixture
def noisy(scene):
    """A square under a wide lamp, at one sample."""
    scene.render.resolution_x = scene.render.resolution_y = 64
    add(scene, "Square", mesh(), location=(-0.5, -0.5, 0), scale=(4, 4, 4))
    lamp = add(scene, "Lamp", bpy.data.lights.new("Lamp", "AREA"), location=(0, 0, 2))
    lamp.data.size = 3
    lamp.data.energy = 100
    scene.gi_engine.use_denoising = True
    return scene


def roughness(image):
    """Mean difference of neighbours, relative to the mean."""
    grey = image[..., :3].mean(-1)[8:-8, 8:-8]
    return np.abs(np.diff(grey, axis=1)).mean() / grey.mean()


def test_the_picture_is_clean_and_the_noisy_one_is_kept(noisy, rendered):
    found = rendered(noisy)
    combined, before = found["ViewLayer.Combined"], found["ViewLayer.Noisy Image"]
    assert roughness(before) > 0.05
    assert roughness(combined) < 0.25 * roughness(before)
    assert combined[..., :3].mean() == pytest.approx(before[..., :3].mean(), rel=0.03)


def test_without_the_library_it_warns_and_leaves_the_picture(noisy, rendered, monkeypatch):
    said = []
    monkeypatch.setattr(engine, "denoise", lambda *_: None)
    monkeypatch.setattr(engine.GIEngine, "warn", lambda self, message: said.append(message))
    found = rendered(noisy)
    assert np.array_equal(found["ViewLayer.Combined"], found["ViewLayer.Noisy Image"])
    assert said == ["this Blender brings no denoiser: the picture stays as it is"]


def test_it_can_be_stopped():
    """Soon, not only before it begins."""
    pixels = np.random.default_rng(1).random((256, 256, 4)).astype(np.float32)
    asked = []
    assert denoise(pixels, {}, blender_folders(), stopped=lambda: asked.append(1) or False).shape == pixels.shape
    assert len(asked) > 3
    for last in (1, len(asked) // 2):
        again = []
        with pytest.raises(Stopped):
            denoise(pixels, {}, blender_folders(), stopped=lambda a=again, n=last: a.append(1) or len(a) >= n)
        assert len(again) < len(asked)


def test_the_denoising_thread_outlives_work_that_fails():
    cleaner, done = Cleaner(), []
    cleaner.submit(lambda: 1 / 0)
    cleaner.wait()
    cleaner.submit(lambda: done.append(1))
    cleaner.wait()
    assert done == [1]
