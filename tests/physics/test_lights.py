"""Lights: samples follow their densities, both ways of meeting a light agree, and what arrives is what physics says.

Chi² bins lie on the light, where densities are smooth, not on the sphere of directions, where a lamp's edge cuts bins.
"""

import numpy as np
import pytest
from light_scenes import (
    NO_NORMAL,
    ORIGIN,
    UP,
    Samples,
    build,
    emission,
    f32,
    lamp,
    matrix,
    triangle_scene,
    uniforms,
    with_world,
)
from scipy import integrate, stats

from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder

SAMPLES = 100_000
BINS = 20
SIGNIFICANCE = 1e-3  # shared by all cases of a test below


# ---------------------------------------------------------------- surfaces: unit square → points or directions, and back


class Rectangle:
    def __init__(self, center, u, v):  # u, v: whole sides
        self.c, self.u, self.v = (np.asarray(a, float) for a in (center, u, v))

    def point(self, s, t):
        return self.c + (s - 0.5)[:, None] * self.u + (t - 0.5)[:, None] * self.v

    def place(self, p):
        a = np.linalg.lstsq(np.stack([self.u, self.v], 1), (p - self.c).T, rcond=None)[0]
        return a[0] + 0.5, a[1] + 0.5


class Ellipse(Rectangle):
    def point(self, s, t):
        r, a = np.sqrt(s), 2 * np.pi * t
        return super().point(0.5 + 0.5 * r * np.cos(a), 0.5 + 0.5 * r * np.sin(a))

    def place(self, p):
        x, y = super().place(p)
        x, y = 2 * x - 1, 2 * y - 1
        return x * x + y * y, np.mod(np.arctan2(y, x), 2 * np.pi) / (2 * np.pi)


class Triangle:
    def __init__(self, a, b, c):
        self.a, self.b, self.c = (np.asarray(x, float) for x in (a, b, c))

    def point(self, s, t):
        r = np.sqrt(s)
        return self.a + (r * (1 - t))[:, None] * (self.b - self.a) + (r * t)[:, None] * (self.c - self.a)

    def place(self, p):
        b1, b2 = np.linalg.lstsq(np.stack([self.b - self.a, self.c - self.a], 1), (p - self.a).T, rcond=None)[0]
        return (b1 + b2) ** 2, b2 / np.maximum(b1 + b2, 1e-12)


class Cap:
    """Directions within `half_angle` of `axis`, uniform in solid angle over the unit square."""

    direction = True

    def __init__(self, axis, half_angle):
        z = np.asarray(axis, float) / np.linalg.norm(axis)
        x = np.cross(z, [1, 0, 0] if abs(z[0]) < 0.5 else [0, 1, 0])
        x /= np.linalg.norm(x)
        self.frame, self.k = np.stack([x, np.cross(z, x), z], 1), 2 * np.sin(half_angle / 2) ** 2

    def point(self, s, t):
        k, a = s * self.k, 2 * np.pi * t
        r = np.sqrt(k * (2 - k))
        return np.stack([r * np.cos(a), r * np.sin(a), 1 - k], 1) @ self.frame.T

    def place(self, d):
        x, y, z = d @ self.frame[:, 0], d @ self.frame[:, 1], d @ self.frame[:, 2]
        k = np.where(z > 0, (x * x + y * y) / (1 + np.abs(z)), 1 - z)
        return k / self.k, np.mod(np.arctan2(y, x), 2 * np.pi) / (2 * np.pi)


class Equirectangular:
    direction = True

    def point(self, s, t):
        theta, a = np.pi * s, 2 * np.pi * t - np.pi
        return np.stack([np.sin(theta) * np.cos(a), np.sin(theta) * np.sin(a), -np.cos(theta)], 1)

    def place(self, d):
        return np.arctan2(np.hypot(d[:, 0], d[:, 1]), -d[:, 2]) / np.pi, (np.arctan2(d[:, 1], d[:, 0]) + np.pi) / (
            2 * np.pi
        )


def bin_masses(lights, surface, position, normal, bins, order=6, midpoints=False, **options):
    """∫ pdf_dir dω over the bins of the unit square; by midpoints where the density has steps inside the bins."""
    x, w = np.polynomial.legendre.leggauss(order)
    if midpoints:
        x, w = (2 * np.arange(order) + 1) / order - 1, np.full(order, 2 / order)
    nodes = ((np.arange(bins)[:, None] + 0.5 + 0.5 * x) / bins).ravel()
    weights = np.tile(0.5 * w / bins, bins)
    s, t = (a.ravel() for a in np.meshgrid(nodes, nodes, indexing="ij"))

    def direction(s, t):
        p = surface.point(s, t)
        return (
            p
            if getattr(surface, "direction", False)
            else (p - position) / np.linalg.norm(p - position, axis=1, keepdims=True)
        )

    h = 1e-6
    ds = (direction(s + h, t) - direction(s - h, t)) / (2 * h)
    dt = (direction(s, t + h) - direction(s, t - h)) / (2 * h)
    solid_angle = np.linalg.norm(np.cross(ds, dt), axis=1)
    pdf = lights.eval(position, normal, direction(s, t).astype(np.float32), **options)[:, 3]
    mass = pdf * solid_angle * np.outer(weights, weights).ravel()
    return mass.reshape(bins, order, bins, order).sum((1, 3)).ravel()


def chi2_p_value(observed, expected):
    few = expected < 5
    if few.any():
        observed, expected = (
            np.append(observed[~few], observed[few].sum()),
            np.append(expected[~few], expected[few].sum()),
        )
    if expected[-1] < 5:
        observed[-2] += observed[-1]
        expected[-2] += expected[-1]
        observed, expected = observed[:-1], expected[:-1]
    return stats.chi2.sf(((observed - expected) ** 2 / expected).sum(), max(len(expected) - 1, 1))


def surface_p_value(lights, surface, position, normal, bins=BINS, rule=None, **options):
    s = Samples(lights.sample(position, normal, uniforms(SAMPLES), **options))
    where = s.wi if getattr(surface, "direction", False) else position + s.wi * s.distance[:, None]
    a, b = surface.place(where.astype(float))
    inside = (a > -1e-3) & (a < 1 + 1e-3) & (b > -1e-3) & (b < 1 + 1e-3)
    assert inside.mean() > 0.999, f"{(~inside).sum()} samples off the light"
    i, j = (np.clip((x * bins).astype(int), 0, bins - 1) for x in (a, b))
    observed = np.bincount(i * bins + j, minlength=bins * bins).astype(float)
    mass = bin_masses(lights, surface, position, normal, bins, **(rule or {}), **options)
    assert mass.sum() < 1.002, f"the density integrates to {mass.sum():.5f}"
    expected = mass * SAMPLES
    return chi2_p_value(
        np.append(observed, SAMPLES - observed.sum()), np.append(expected, max(1 - mass.sum(), 0) * SAMPLES)
    )


# ---------------------------------------------------------------- cases

AREA = {"size": (1.0, 2.0), "matrix": matrix((0, 0, 2))}
TILTED = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])  # columns x y z


def area_case(position=(0, 0, 2), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1), size=(1.0, 2.0), ellipse=False, **fields):
    surface = (Ellipse if ellipse else Rectangle)(position, np.array(x) * size[0], np.array(y) * size[1])
    return sd.Scene(
        lights=[
            lamp(
                "AREA",
                matrix=matrix(position, x, y, z),
                size=size,
                shape="ELLIPSE" if ellipse else "RECTANGLE",
                **fields,
            )
        ]
    ), surface


def sphere_case(kind, center, radius, **fields):
    d = np.linalg.norm(center)
    inside = d < radius
    surface = Cap(center, np.pi if inside else np.arcsin(radius / d))
    return sd.Scene(lights=[lamp(kind, matrix=matrix(center), radius=radius, soft_falloff=False, **fields)]), surface


def facing_disk_case(center, radius):
    cap = Cap(center, 1)
    surface = Ellipse(center, 2 * radius * cap.frame[:, 0], 2 * radius * cap.frame[:, 1])
    return sd.Scene(lights=[lamp("POINT", matrix=matrix(center), radius=radius)]), surface


def triangle_case(*corners):
    return triangle_scene([corners]), Triangle(*corners)


def spread_case(ellipse):
    """The circle that a narrow spread lets through lies within the lamp."""
    scene, _ = area_case(size=(5, 4), spread=0.7, ellipse=ellipse)
    r = 2 * np.tan(0.35)
    return scene, Ellipse((0, 0, 2), (2 * r, 0, 0), (0, 2 * r, 0))


CASES = {
    "rectangle": area_case(),
    "rectangle far": area_case(position=(0, 0, 900)),
    "rectangle close": area_case(position=(0.2, 0.3, 0.1)),
    "rectangle at a grazing angle": area_case(position=(3, 0, 0.2)),
    "rectangle very close": area_case(position=(0.2, 0.3, 0.001)),
    "rectangle tilted": area_case((0.5, 0.2, 1.5), *TILTED.T),
    "rectangle mirrored and scaled": area_case((0.1, 0, 1), x=(-2, 0, 0), y=(0, 0.5, 0), z=(0, 0, 3)),
    "rectangle sheared": area_case((0.1, 0, 1), y=(0.7, 1, 0)),
    "ellipse": area_case(ellipse=True),
    "ellipse tilted": area_case((0.5, 0.2, 1.5), *TILTED.T, ellipse=True),
    "spread, rectangle": spread_case(False),
    "spread, ellipse": spread_case(True),
    "sphere": sphere_case("POINT", (1, 0.5, 2), 0.7),
    "sphere far": sphere_case("POINT", (100, 50, 200), 0.1),
    "sphere from inside": sphere_case("POINT", (0.2, 0.1, 0.3), 1.0),
    "spot with a sphere from inside": sphere_case("SPOT", (0.2, 0.1, 0.3), 1.0),
    "spot with a sphere": sphere_case("SPOT", (0, 0, 2), 0.3, spot_size=2.0),
    "facing disk": facing_disk_case((1, 0.5, 2), 0.7),
    "sun": (sd.Scene(lights=[lamp("SUN", angle=0.5)]), Cap((0, 0, 1), 0.25)),
    "sun as seen from Earth": (
        sd.Scene(lights=[lamp("SUN", angle=0.00918, matrix=matrix(x=TILTED[:, 0], y=TILTED[:, 1], z=TILTED[:, 2]))]),
        Cap(TILTED[:, 2], 0.00459),
    ),
    "triangle": triangle_case((-1, -0.5, 2), (1, -0.3, 1.5), (0.1, 1, 2.5)),
    "triangle close": triangle_case((-1, -0.8, 0.1), (1, -0.8, 0.1), (0.1, 2, 0.1)),
    "triangle far": triangle_case((-1, -0.5, 90), (1, -0.3, 90), (0.1, 1, 91)),
    "triangle, a sliver": triangle_case((-3, 0, 1), (3, 0, 1), (0, 0.02, 1.2)),
    "uniform world": (with_world(sd.Scene(), emission()), Equirectangular()),
}


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


# ---------------------------------------------------------------- closed forms

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


# ---------------------------------------------------------------- world


def image_sky(resolution=64, sun=2000.0, **fields):
    """A gradient with one bright pixel."""
    height, width = resolution // 2, resolution
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] *= np.linspace(0.0, 1.0, height, dtype=np.float32)[:, None, None]
    pixels[height * 3 // 4, width // 3, :3] = sun
    builder = ProgramBuilder()
    color, _ = builder.op("environment", builder.op("object_position"), imm=(0, 0, 0))
    builder.op("emission", 1.0, color, 1.0)
    scene = sd.Scene(images=[[sd.Image("sky", pixels)]])
    return with_world(scene, builder.finish("sky"), **fields)


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


# ---------------------------------------------------------------- choosing


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


# ---------------------------------------------------------------- odd lamps


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


def test_negative_lamps_subtract():
    lamps = [lamp("POINT", (K,) * 3), lamp("AREA", (-2,) * 3)]
    lights = build(sd.Scene(lights=lamps))
    mean, error = Samples(lights.sample(ORIGIN, UP, uniforms(100_000))).irradiance(UP)
    expected = POINT_E - 2 * 4 * corner_factor(0.5, 0.5, 2)
    assert abs(mean - expected) < 4 * error


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
