"""What arrives from lights is what physics says: closed forms, and what uniform directions find."""

import numpy as np
import pytest
from light_scenes import ORIGIN, UP, Samples, build, emission, f32, lamp, matrix, triangle_scene, uniforms, with_world
from light_surfaces import area_case
from scipy import integrate

from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder

K = 10.0  # watts


def corner_factor(a, b, c):
    """Differential element, parallel rectangle a × b with a corner on the element's normal at distance c. [Howell B-4]"""
    x, y = a / c, b / c
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * np.pi)


def disk_factor(r, h, a):
    """Differential element, parallel disk of radius r, height h, its centre a aside."""
    z = h * h + a * a
    return 0.5 * (1 - (z - r * r) / np.sqrt((z + r * r) ** 2 - 4 * r * r * a * a))


def spread_irradiance(k, area, half, height, radius):
    """On the axis of a disk lamp with slats, or of any lamp that covers what they let through."""
    theta = np.linspace(0, min(half, np.arctan(radius / height)), 20_001)
    f = (np.tan(half) - np.tan(theta)) / (np.tan(half) - half) * np.cos(theta) * np.sin(theta)
    return k / (np.pi * area) * 2 * np.pi * integrate.trapezoid(f, theta)


POINT_E = K / (4 * np.pi * 4)
CLOSED = {
    "rectangle": (area_case(color=(K,) * 3)[0], K / 2 * 4 * corner_factor(0.5, 1, 2)),
    "rectangle, corner above": (area_case(position=(0.5, 1, 1.5), color=(K,) * 3)[0], K / 2 * corner_factor(1, 2, 1.5)),
    "rectangle scaled by its object": (
        area_case(x=(3, 0, 0), y=(0, 0.5, 0), color=(K,) * 3)[0],
        K / 3 * 4 * corner_factor(1.5, 0.5, 2),
    ),
    "rectangle mirrored": (area_case(x=(-1, 0, 0), color=(K,) * 3)[0], K / 2 * 4 * corner_factor(0.5, 1, 2)),
    "rectangle not normalised": (area_case(color=(K,) * 3, normalize=False)[0], K * 4 * corner_factor(0.5, 1, 2)),
    "rectangle from behind": (area_case(z=(0, 0, -1), color=(K,) * 3)[0], 0),
    "disk": (area_case(size=(2, 2), ellipse=True, color=(K,) * 3)[0], K / np.pi * disk_factor(1, 2, 0)),
    "disk aside": (
        area_case(position=(0.7, 0, 2), size=(2, 2), ellipse=True, color=(K,) * 3)[0],
        K / np.pi * disk_factor(1, 2, 0.7),
    ),
    "spread 60°": (
        area_case(size=(2, 2), ellipse=True, spread=np.pi / 3, color=(K,) * 3)[0],
        spread_irradiance(K, np.pi, np.pi / 6, 2, 1),
    ),
    "spread 20°, wide lamp": (
        area_case(size=(4, 3), spread=np.pi / 9, color=(K,) * 3)[0],
        spread_irradiance(K, 12, np.pi / 18, 2, 9),
    ),
    "spread 2°": (area_case(size=(4, 3), spread=np.pi / 90, color=(K,) * 3)[0], K / 12),
    "spread 0": (area_case(size=(4, 3), spread=0, color=(K,) * 3)[0], K / 12),
    "point": (sd.Scene(lights=[lamp("POINT", (K,) * 3)]), POINT_E),
    "point not normalised": (sd.Scene(lights=[lamp("POINT", (K,) * 3, normalize=False)]), 4 * POINT_E),
    "sphere": (sd.Scene(lights=[lamp("POINT", (K,) * 3, radius=0.8, soft_falloff=False)]), POINT_E),
    "sphere not normalised": (
        sd.Scene(lights=[lamp("POINT", (K,) * 3, radius=0.8, soft_falloff=False, normalize=False)]),
        K * 0.64 / 4,
    ),
    "soft falloff": (sd.Scene(lights=[lamp("POINT", (K,) * 3, radius=0.8)]), POINT_E * 4 / (4 + 0.64)),
    "spot": (sd.Scene(lights=[lamp("SPOT", (K,) * 3, spot_size=0.5)]), POINT_E),
    "spot with a sphere": (
        sd.Scene(lights=[lamp("SPOT", (K,) * 3, spot_size=1.5, radius=0.2, soft_falloff=False)]),
        POINT_E,
    ),
    "sun": (sd.Scene(lights=[lamp("SUN", (K,) * 3)]), K),
    "sun, wide": (sd.Scene(lights=[lamp("SUN", (K,) * 3, angle=1.0)]), K),
    "sun not normalised": (
        sd.Scene(lights=[lamp("SUN", (K,) * 3, angle=1.0, normalize=False)]),
        K * np.pi * np.sin(0.5) ** 2,
    ),
    "uniform sky": (with_world(sd.Scene(), emission(strength=K)), K * np.pi),
    "nori triangle": (triangle_scene([[(-1, -1, 2), (1, -1, 2), (0, 1, 2)]], emission(strength=K)), None),
}


@pytest.mark.parametrize("name", CLOSED)
def test_irradiance(name):
    scene, expected = CLOSED[name]
    if expected is None:  # Lambert's formula
        v = np.array([(-1, -1, 2), (1, -1, 2), (0, 1, 2)], float)
        v /= np.linalg.norm(v, axis=1, keepdims=True)
        w = np.roll(v, -1, 0)
        c = np.cross(v, w)
        angle = np.arctan2(np.linalg.norm(c, axis=1), (v * w).sum(1))
        expected = K * 0.5 * abs((c[:, 2] / np.linalg.norm(c, axis=1) * angle).sum())
    mean, error = Samples(build(scene).sample(ORIGIN, UP, uniforms(200_000, 3))).irradiance(UP)
    assert abs(mean - expected) <= 4 * error + 1e-4 * expected, f"{mean:.6f} ± {error:.6f}, expected {expected:.6f}"


def test_negative_lamps_subtract():
    lamps = [lamp("POINT", (K,) * 3), lamp("AREA", (-2,) * 3)]
    lights = build(sd.Scene(lights=lamps))
    mean, error = Samples(lights.sample(ORIGIN, UP, uniforms(100_000))).irradiance(UP)
    expected = POINT_E - 2 * 4 * corner_factor(0.5, 0.5, 2)
    assert abs(mean - expected) < 4 * error


@pytest.mark.parametrize("blend", [0.0, 0.15, 1.0])
def test_spot_edge_is_a_smoothstep(blend):
    size = 1.0
    lights = build(sd.Scene(lights=[lamp("SPOT", (K,) * 3, spot_size=size, spot_blend=blend)]))
    x = np.linspace(0, 1.3, 40)
    position = np.stack([x, 0 * x, 0 * x], 1).astype(np.float32)
    table = lights.sample(position, UP, np.full((40, 3), 0.5, np.float32))
    cos = 2 / np.hypot(x, 2)
    edge = np.cos(size / 2)
    s = np.clip((cos - edge) / ((1 - edge) * blend), 0, 1) if blend else (cos > edge).astype(float)
    expected = K / (4 * np.pi) / (x * x + 4) * s * s * (3 - 2 * s)
    np.testing.assert_allclose(table[:, 4], expected, rtol=1e-4, atol=1e-6)


def test_spot_squeezed_by_its_object():
    lights = build(sd.Scene(lights=[lamp("SPOT", (K,) * 3, spot_size=1.0, matrix=matrix((0, 0, 2), x=(0.5, 0, 0)))]))
    edge = 2 * np.tan(0.5)
    position = f32((0.49 * edge, 0, 0), (0.51 * edge, 0, 0), (0, 0.99 * edge, 0), (0, 1.01 * edge, 0))
    lit = lights.sample(position, UP, np.full((4, 3), 0.5, np.float32))[:, 9] >= 0
    assert lit.tolist() == [True, False, True, False]


def painted(kind):
    """Emission that changes from place to place: red is the x coordinate of `kind`."""
    builder = ProgramBuilder()
    builder.op("emission", 1.0, builder.op(kind), 1.0)
    return builder.finish("painted")


# Partly covered lamps: no closed form, so sampled light against light found by uniform directions.
FOUND = {
    "spread, half over the edge": area_case(position=(0.9, 0.3, 2), size=(2, 1), spread=1.0),
    "spread, ellipse half over the edge": area_case(position=(0.9, 0.3, 2), size=(2, 1), spread=1.0, ellipse=True),
    "spread, disk half over the edge": area_case(position=(0.9, 0.3, 2), size=(2, 2), spread=0.8, ellipse=True),
    "spot through a facing disk": (
        sd.Scene(lights=[lamp("SPOT", radius=0.9, spot_size=0.6, spot_blend=0.5, matrix=matrix((0.3, 0, 2)))]),
        None,
    ),
    "spot through a large sphere": (
        sd.Scene(lights=[lamp("SPOT", radius=1.8, soft_falloff=False, spot_size=0.4, spot_blend=0.5)]),
        None,
    ),
    "sheared ellipse": area_case((0.1, 0, 1), y=(0.7, 1, 0), ellipse=True),
    "many at once": (
        with_world(
            sd.Scene(
                lights=[
                    lamp("POINT", (K,) * 3, radius=0.5),
                    lamp("AREA", (3,) * 3, size=(1, 1), matrix=matrix((1, 1, 1))),
                    lamp("SUN", angle=0.8),
                ],
                meshes=triangle_scene([[(-1, -0.5, 2), (1, -0.3, 1.5), (0.1, 1, 2.5)]]).meshes,
                instances=[sd.Instance("triangles", 0, matrix(), [0])],
                programs=[emission(strength=3)],
            ),
            emission(strength=0.1, name="world"),
        ),
        None,
    ),
    "painted triangles": (
        triangle_scene(
            [[(1, -1, 2), (3, -1, 1), (2, 2, 2)], [(0, 0, 1), (0.5, 0, 1), (0, 0.5, 1)]], painted("position")
        ),
        None,
    ),
    "painted lamp": (
        sd.Scene(lights=[lamp("AREA", program=0, matrix=matrix((0.5, 0, 1)))], programs=[painted("position")]),
        None,
    ),
    "two lamps in one place": (sd.Scene(lights=[lamp("AREA"), lamp("AREA", (2, 2, 2))]), None),
}


@pytest.mark.parametrize("name", FOUND)
def test_sampled_irradiance_is_what_rays_find(name):
    lights = build(FOUND[name][0])
    rng = np.random.default_rng(5)
    n = 1_000_000
    r, a = np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n)
    wi = np.stack([r * np.cos(a), r * np.sin(a), np.sqrt(1 - r * r)], 1).astype(np.float32)
    found = np.pi * lights.eval(ORIGIN, UP, wi)[:, 0].astype(float)
    mean, error = Samples(lights.sample(ORIGIN, UP, uniforms(200_000, 6))).irradiance(UP)
    both = np.hypot(error, found.std() / np.sqrt(n))
    assert abs(mean - found.mean()) < 4 * both + 1e-4 * mean, (
        f"sampled {mean:.5f}, found {found.mean():.5f} ± {both:.5f}"
    )
