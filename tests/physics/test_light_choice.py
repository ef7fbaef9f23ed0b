"""Choosing among many lights."""

import numpy as np
import pytest
from light_scenes import (
    NO_NORMAL,
    ORIGIN,
    UP,
    Samples,
    build,
    emission,
    lamp,
    matrix,
    triangle_scene,
    uniforms,
    with_world,
)
from light_surfaces import SAMPLES, SIGNIFICANCE, chi2_p_value

from gi_engine import scene_data as sd


def many_lights(n, seed=3):
    rng = np.random.default_rng(seed)
    center = rng.uniform(-5, 5, (n, 1, 3))
    triangles = center + rng.normal(0, 0.2, (n, 3, 3))
    lamps = [
        lamp("POINT", tuple(rng.uniform(1, 50, 3)), matrix=matrix(p), radius=0.1) for p in rng.uniform(-5, 5, (10, 3))
    ]
    lamps.append(lamp("SPOT", (20,) * 3, matrix=matrix((1, 1, 3)), spot_size=0.6))
    lamps.append(lamp("SUN", (0.3,) * 3))
    scene = triangle_scene(triangles, emission(strength=5))
    scene.lights = lamps
    return with_world(scene, emission(strength=0.05, name="world"))


@pytest.mark.parametrize("normal", [UP, NO_NORMAL], ids=["surface", "volume"])
def test_choice_follows_its_probabilities(normal):
    lights = build(many_lights(300))
    rng = np.random.default_rng(1)
    for position in rng.uniform(-6, 6, (4, 1, 3)).astype(np.float32):
        p = lights.pick_probabilities(position, normal)[0].astype(float)
        assert p.sum() < 1 + 1e-4
        s = Samples(lights.sample(position, normal, uniforms(SAMPLES)))
        observed = np.bincount(s.light, minlength=lights.count).astype(float)
        # A chosen triangle or spot may have nothing to send here; the lights that always answer tell.
        assert (observed <= p * SAMPLES + 5 * np.sqrt(p * SAMPLES) + 1).all()
        always = observed > 0.5 * p * SAMPLES
        always &= p * SAMPLES > 20
        assert p[always].sum() > 0.5
        rest = SAMPLES - observed[always].sum()
        assert (
            chi2_p_value(np.append(observed[always], rest), np.append(p[always], 1 - p[always].sum()) * SAMPLES)
            > SIGNIFICANCE / 8
        )


def test_choice_sums_to_one_where_every_light_shines():
    lamps = [lamp("POINT", (1, 1, 1), matrix=matrix(p)) for p in np.random.default_rng(2).uniform(-3, 3, (100, 3))]
    lights = build(with_world(sd.Scene(lights=lamps), emission()))
    position = np.random.default_rng(4).uniform(-4, 4, (50, 3)).astype(np.float32)
    np.testing.assert_allclose(lights.pick_probabilities(position, UP).sum(1), 1, atol=1e-5)


def test_near_lights_are_chosen_before_far_ones():
    lamps = [lamp("POINT", (1, 1, 1), matrix=matrix((x, 0, 1))) for x in (0.0, 100.0)]
    p = build(sd.Scene(lights=lamps)).pick_probabilities(ORIGIN, UP)[0]
    assert p[0] > 0.999


def test_choice_knows_how_strong_a_lamps_program_is():
    lamps = [lamp("POINT", program=k, matrix=matrix((x, 0, 2))) for k, x in enumerate((-1.0, 1.0))]
    p = build(sd.Scene(lights=lamps, programs=[emission(strength=1), emission(strength=9)])).pick_probabilities(
        ORIGIN, UP
    )[0]
    np.testing.assert_allclose(p, [0.1, 0.9], rtol=1e-4)


def test_choice_loses_no_light():
    """Sum over all lights, one by one, against choosing among them."""
    lights = build(many_lights(60))
    for position in np.random.default_rng(8).uniform(-4, 4, (3, 1, 3)).astype(np.float32):
        each = [
            Samples(lights.sample(position, UP, uniforms(4000, k), light=k)).irradiance(UP) for k in range(lights.count)
        ]
        mean, error = Samples(lights.sample(position, UP, uniforms(400_000, 9))).irradiance(UP)
        expected, spread = sum(m for m, _ in each), np.sqrt(sum(e * e for _, e in each))
        assert abs(mean - expected) < 4 * np.hypot(error, spread), f"{mean} against {expected}"
