"""Lamps and the world: colours in Cycles' units, shapes, visibility."""

from __future__ import annotations

import math

import bpy
import pytest

from gi_engine.scene_data import CAMERA, DIFFUSE, VISIBLE_TO_ALL

from .conftest import add, named


def lamp(scene, kind: str, name: str = "Lamp", **properties):
    data = bpy.data.lights.new(name, kind)
    for key, value in properties.items():
        setattr(data, key, value)
    return add(scene, name, data)


def test_strength_is_colour_times_energy_times_exposure(scene, render_export):
    lamp(scene, "POINT", energy=10, color=(1, 0.5, 0.25), exposure=2)
    assert render_export().scene.lights[0].color == pytest.approx((40, 20, 10))


def test_temperature_tints(scene, render_export):
    warm = lamp(scene, "SUN", energy=2, color=(1, 0.5, 1), use_temperature=True, temperature=2000).data
    tint = warm.temperature_color
    color = render_export().scene.lights[0].color
    assert color == pytest.approx((2 * tint[0], tint[1], 2 * tint[2]))
    assert color[0] > color[2]


def test_shapes(scene, render_export):
    lamp(scene, "POINT", "Point", shadow_soft_size=0.3, use_soft_falloff=False)
    lamp(scene, "SPOT", "Spot", spot_size=1.0, spot_blend=0.4, shadow_soft_size=0.2)
    lamp(scene, "SUN", "Sun", angle=0.1)
    for shape in ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"):
        lamp(scene, "AREA", shape, shape=shape, size=2, size_y=3, spread=1.5, normalize=shape != "DISK")
    lights = render_export().scene.lights
    point, spot, sun = (named(lights, name) for name in ("Point", "Spot", "Sun"))
    assert point.radius == pytest.approx(0.3) and not point.soft_falloff
    assert (spot.spot_size, spot.spot_blend, spot.radius) == pytest.approx((1.0, 0.4, 0.2)) and spot.soft_falloff
    assert sun.angle == pytest.approx(0.1)
    expected = {
        "SQUARE": ("RECTANGLE", (2, 2)), "RECTANGLE": ("RECTANGLE", (2, 3)),
        "DISK": ("ELLIPSE", (2, 2)), "ELLIPSE": ("ELLIPSE", (2, 3)),
    }  # fmt: skip
    for name, shape in expected.items():
        found = named(lights, name)
        assert (found.shape, found.size) == shape and found.spread == pytest.approx(1.5)
        assert found.normalize == (name != "DISK")


def test_options_that_cycles_owns(scene, render_export):
    item = lamp(scene, "AREA")
    item.data.cycles.max_bounces = 3
    item.data.cycles.use_multiple_importance_sampling = False
    item.data.use_shadow = False
    item.visible_diffuse = False
    item.visible_camera = False
    found = render_export().scene.lights[0]
    assert found.max_bounces == 3 and not found.use_mis and not found.cast_shadow
    assert found.visibility == VISIBLE_TO_ALL & ~CAMERA & ~DIFFUSE


def test_portals_give_no_light(scene, render_export):
    lamp(scene, "AREA").data.cycles.is_portal = True
    assert not render_export().scene.lights


def test_hidden_lamps_are_left_out(scene, render_export):
    lamp(scene, "POINT", "Hidden").hide_render = True
    lamp(scene, "POINT", "Shown")
    assert [light.name for light in render_export().scene.lights] == ["Shown"]


def test_world_settings(scene, render_export):
    assert render_export().scene.world.program == -1
    world = scene.world = bpy.data.worlds.new("World")
    world.cycles.sampling_method, world.cycles.sample_map_resolution = "MANUAL", 512
    world.cycles.max_bounces = 7
    world.cycles_visibility.camera = False
    exported = render_export().scene
    assert exported.programs[exported.world.program].name == "World"
    assert (exported.world.sampling, exported.world.map_resolution, exported.world.max_bounces) == ("MANUAL", 512, 7)
    assert exported.world.visibility == VISIBLE_TO_ALL & ~CAMERA


def test_a_spot_of_a_full_cone_stays_finite(scene, render_export):
    lamp(scene, "SPOT", spot_size=math.pi)
    assert render_export().scene.lights[0].spot_size == pytest.approx(math.pi)
