"""Lights as unit squares, for chi² tests of their sampling, and a case of each kind.

Bins lie on the light, where densities are smooth, not on the sphere of directions, where a lamp's edge cuts bins.
"""

import numpy as np
from light_scenes import Samples, emission, lamp, matrix, triangle_scene, uniforms, with_world
from scipy import stats

from gi_engine import scene_data as sd

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
