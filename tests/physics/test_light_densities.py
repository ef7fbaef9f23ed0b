"""Samples of lights and of the world follow their densities, and both ways of meeting a light agree."""

import numpy as np
import pytest
from light_scenes import NO_NORMAL, ORIGIN, UP, Samples, build, emission, f32, image_sky, uniforms, with_world
from light_surfaces import CASES, SIGNIFICANCE, Equirectangular, surface_p_value

from gi_engine import scene_data as sd


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("normal", [UP, NO_NORMAL], ids=["surface", "volume"])
def test_samples_follow_their_density(name, normal):
    scene, surface = CASES[name]
    p = surface_p_value(build(scene), surface, ORIGIN, normal)
    assert p > SIGNIFICANCE / (2 * len(CASES))


@pytest.mark.parametrize("name", ["sphere from inside", "uniform world", "rectangle"])
def test_samples_follow_their_density_where_surfaces_transmit(name):
    scene, surface = CASES[name]
    assert surface_p_value(build(scene), surface, ORIGIN, UP, transmission=True) > SIGNIFICANCE


@pytest.mark.parametrize("name", CASES)
def test_sampled_and_found_light_agree(name):
    scene, _ = CASES[name]
    lights = build(scene)
    s = Samples(lights.sample(ORIGIN, UP, uniforms(20_000, 2)))
    found = lights.eval(ORIGIN, UP, s.wi)
    # Rays to the very edge may miss.
    met = found[:, 3] > 0
    assert met.mean() > 0.998
    np.testing.assert_allclose(found[met, 3], s.pdf[met], rtol=2e-3)
    np.testing.assert_allclose(found[met, :3], s.radiance[met], rtol=2e-3)
    assert (s.pdf > 0).all() and not s.delta.any()


# ---------------------------------------------------------------- world


@pytest.mark.parametrize("resolution", [64, 32])
def test_world_samples_follow_their_density(resolution):
    lights = build(image_sky(sampling="MANUAL", map_resolution=resolution))
    # Bright texels have 16 x 16 steps inside: a whole number of nodes for each.
    rule = {"order": 16, "midpoints": True}
    assert surface_p_value(lights, Equirectangular(), ORIGIN, UP, bins=64, rule=rule) > SIGNIFICANCE


@pytest.mark.parametrize("fields", [{}, {"sampling": "MANUAL", "map_resolution": 48}])
def test_world_map_finds_all_light(fields):
    lights = build(image_sky(**fields))
    n = 1536  # a multiple of the image's sides
    s, t = (a.ravel() for a in np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n, indexing="ij"))
    wi = Equirectangular().point(s, t).astype(np.float32)
    weight = np.maximum(wi[:, 2], 0) * np.sin(np.pi * s) * (2 * np.pi**2 / n**2)
    expected = (lights.eval(ORIGIN, UP, wi)[:, 0] * weight).sum()
    mean, error = Samples(lights.sample(ORIGIN, UP, uniforms(100_000, 4))).irradiance(UP)
    assert abs(mean - expected) < 4 * error + 2e-3 * expected
    # Directions drawn without the map would be off by thirty times as much.
    assert error < 0.01 * expected


@pytest.mark.parametrize("radiance", [0.0, 0.3, 0.9, 50.0])
def test_share_of_the_worlds_light_above_a_radiance(radiance):
    """By the importance map, which is a little blurred."""
    lights = build(image_sky())
    n = 1536
    s, t = (a.ravel() for a in np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n, indexing="ij"))
    found = lights.eval(ORIGIN, UP, Equirectangular().point(s, t).astype(np.float32))[:, 0]
    weight = np.sin(np.pi * s)
    expected = (np.maximum(found - radiance, 0) * weight).sum() / (found * weight).sum()
    assert lights.world_share_above(radiance) == pytest.approx(expected, abs=0.03)


def test_share_of_an_even_world_above_a_radiance():
    lights = build(with_world(sd.Scene(), emission(strength=2.0)))
    assert lights.world_share_above(0.5) == pytest.approx(0.75)
    assert lights.world_share_above(2.0) == 0.0


def test_world_without_sampling_is_left_to_rays():
    lights = build(image_sky(sampling="NONE"))
    assert lights.count == 0
    found = lights.eval(ORIGIN, UP, f32((0, 0.6, 0.8)))[0]
    assert found[0] > 0 and found[3] == 0
