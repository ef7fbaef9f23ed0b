"""The button that renders every strategy of bidirectional path tracing."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from gi_engine import strategies

from .conftest import add, mesh


@pytest.fixture
def lit(scene):
    add(scene, "Floor", mesh("Floor", ((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))))
    lamp = bpy.data.lights.new("Lamp", "POINT")
    add(scene, "Lamp", lamp, location=(0, 0, 1))
    scene.camera.location, scene.camera.rotation_euler = (0, 0, 3), (0, 0, 0)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 16, 12, 100
    scene.cycles.samples, scene.cycles.max_bounces = 2, 0
    scene.gi_engine.integrator = "bdpt"
    return scene


def test_the_button(lit, tmp_path):
    settings = lit.render.image_settings
    before = settings.file_format, settings.color_mode, settings.color_depth
    assert bpy.ops.gi_engine.render_strategies(directory=str(tmp_path)) == {"FINISHED"}
    names = {path.name for path in tmp_path.iterdir()}
    ways = strategies.techniques(0)
    assert names == {
        *(f"s{s}_t{t}{end}.exr" for s, t in ways for end in ("", "_unweighted")),
        "weighted.png", "unweighted.png", "strategies.json",
    }  # fmt: skip
    assert (settings.file_format, settings.color_mode, settings.color_depth) == before
    assert "Strategies" not in bpy.data.images


def test_other_integrators_have_none(lit, tmp_path):
    lit.gi_engine.integrator = "path"
    with pytest.raises(RuntimeError, match="has no strategies"):
        bpy.ops.gi_engine.render_strategies(directory=str(tmp_path))
    assert not list(tmp_path.iterdir())


def test_the_sheet_is_labelled(lit):
    """What is over a picture and beside a row, and the pictures in their places."""
    pictures = {way: np.full((30, 40, 3), 0.1 * (way[0] + 1), np.float32) for way in strategies.techniques(1)}
    canvas = strategies.sheet(pictures, {2: 1.0, 3: 1.0, 4: 0.25})[::-1]
    text = (strategies.label("s2 t1", 1)[::-1] > 0, strategies.label("x1/4", 1)[::-1] > 0)
    inked = canvas[..., 0] == np.float32(strategies.INK)
    for label in text:
        windows = np.lib.stride_tricks.sliding_window_view(inked, label.shape)
        assert (windows == label).all((2, 3)).sum() == 1
    edge, strip = strategies.EDGE, 5 + 2 * strategies.EDGE
    margin = 4 * len("x1/4") + 2 * edge
    row = (
        strip + 30 + strip
    )  # the second row's pictures: three of them, right of the middle of four columns' first half
    for s in range(3):
        left = margin + s * 42 + 42 // 2
        np.testing.assert_array_equal(canvas[row : row + 30, left : left + 40], np.float32(0.1 * (s + 1)))


def test_labels_can_be_read():
    """By eye, here: the letter s and the digit 7."""
    rows = ["".join(" #"[int(v > 0)] for v in row) for row in strategies.label("s7", 1)[::-1]]
    assert rows == [" ## ### ", "#     # ", " #   #  ", "  # #   ", "##  #   "]
