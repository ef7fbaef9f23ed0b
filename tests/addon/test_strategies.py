"""The button that renders every strategy of bidirectional path tracing."""

from __future__ import annotations

import bpy
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
