"""Lamps without power or size, of extreme power, emissive on one side, or shown to some rays alone."""

import numpy as np
import pytest
from light_scenes import NO_NORMAL, ORIGIN, UP, Samples, build, emission, f32, lamp, matrix, triangle_scene, uniforms

from gi_engine import scene_data as sd


def test_emissive_triangles_shine_on_both_sides():
    corners = [(-1, -0.5, 2), (1, -0.3, 1.5), (0.1, 1, 2.5)]
    a, b = (
        Samples(build(triangle_scene([c])).sample(ORIGIN, UP, uniforms(1000))).irradiance(UP)[0]
        for c in (corners, corners[::-1])
    )
    assert a > 0
    np.testing.assert_allclose(a, b, rtol=0.01)


@pytest.mark.parametrize("sampling, lights", [("NONE", 0), ("AUTO", 1), ("FRONT", 1), ("BACK", 1), ("FRONT_BACK", 1)])
def test_emission_sampling_decides_which_side_is_sampled(sampling, lights):
    program = emission()
    program.emission_sampling = sampling
    up_facing = [(-1, -1, 2), (1, -1, 2), (0, 1, 2)]
    built = build(triangle_scene([up_facing], program))
    assert built.count == lights
    if not lights:
        return
    position = f32((0, 0, 0), (0, 0, 4))
    lit = built.sample(position, NO_NORMAL, uniforms(2))[:, 9] >= 0
    assert lit.tolist() == {"FRONT": [False, True], "BACK": [True, False]}.get(sampling, [True, True])
    # What is not sampled is left to rays, with full weight.
    found = np.stack(
        [built.eval(position[i : i + 1], NO_NORMAL, f32(d))[0] for i, d in enumerate([(0, 0, 1), (0, 0, -1)])]
    )
    assert (found[:, 0] > 0).all()
    assert ((found[:, 3] > 0) == lit).all()


def test_lamps_without_power_or_size_are_left_out():
    empty = np.zeros((4, 4), np.float32)
    empty[3, 3] = 1
    lamps = [
        lamp("POINT", (0, 0, 0)),
        lamp("AREA", size=(0, 1)),
        lamp("AREA", matrix=empty),
        lamp("AREA", (0, 0, 0)),
        lamp("SUN", (0, 0, 0)),
    ]
    lights = build(sd.Scene(lights=lamps))
    assert lights.count == 0
    assert (lights.sample(ORIGIN, UP, uniforms(10))[:, 9] == -1).all()
    assert (lights.eval(ORIGIN, UP, f32((0, 0, 1))) == 0).all()


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA", "SUN"])
@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"radius": 0.0},
        {"radius": 1e-20},
        {"radius": 1e20},
        {"angle": np.pi * 2},
        {"spot_size": np.pi},
        {"spot_size": 0.0},
        {"size": (1e-20, 1)},
        {"spread": 1e-6},
    ],
)
def test_extreme_lamps_give_finite_light(kind, fields):
    for m in (
        matrix(),
        matrix((0, 0, 1e-20)),
        matrix((0, 0, 1e15)),
        matrix(z=(0, 0, 0)),
        matrix((0, 0, 1), x=(1e-12, 0, 0)),
    ):
        lights = build(sd.Scene(lights=[lamp(kind, matrix=m, **fields)]))
        table = lights.sample(ORIGIN, UP, uniforms(200))
        table = table[table[:, 9] >= 0]
        assert np.isfinite(np.delete(table, 3, 1)).all()
        assert (table[:, 7] > 0).all()


def test_rays_see_only_lamps_that_show_themselves_to_them():
    wi = f32((0, 0, 1))
    camera, diffuse, glossy = sd.CAMERA, sd.DIFFUSE, sd.GLOSSY
    lights = build(sd.Scene(lights=[lamp("AREA", visibility=diffuse)]))
    assert [lights.eval(ORIGIN, UP, wi, visibility=v)[0, 0] > 0 for v in (camera, diffuse, glossy)] == [
        False,
        True,
        False,
    ]
    lights = build(sd.Scene(lights=[lamp("AREA", use_mis=False, visibility=camera | diffuse)]))
    assert [lights.eval(ORIGIN, UP, wi, visibility=v)[0, 0] > 0 for v in (camera, diffuse, glossy)] == [
        True,
        False,
        False,
    ]


def test_lamps_are_found_among_many():
    rng = np.random.default_rng(11)
    lamps = [lamp("POINT", matrix=matrix(p), radius=0.3) for p in rng.uniform(-5, 5, (200, 3))]
    wi = rng.normal(size=(2000, 3))
    wi = (wi / np.linalg.norm(wi, axis=1, keepdims=True)).astype(np.float32)
    together = build(sd.Scene(lights=lamps)).eval(ORIGIN, NO_NORMAL, wi)[:, 0]
    one_by_one = sum(build(sd.Scene(lights=[x])).eval(ORIGIN, NO_NORMAL, wi)[:, 0] for x in lamps)
    assert (together > 0).sum() > 300
    np.testing.assert_allclose(together, one_by_one, rtol=1e-4)
