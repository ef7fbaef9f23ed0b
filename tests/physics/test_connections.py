"""How paths from the light are joined to those from the eye, by chi²: which light vertices are drawn, and where the lens sees a point."""

import numpy as np
import pytest
from agreement_scenes import CAMERAS
from scipy import stats

from gi_engine import native

SIGNIFICANCE = 1e-3  # of each test
VERTICES, DRAWS = 40, 40_000


def directions_of(u):
    z, a = 1 - 2 * u[:, 0], 2 * np.pi * u[:, 1]
    s = np.sqrt(np.maximum(1 - z * z, 0))
    return np.stack([s * np.cos(a), s * np.sin(a), z], 1).astype(np.float32)


# ------------------------------------------------------------------------------------------------ light vertices


class Vertices:
    """Light vertices all around an eye vertex at the origin that looks up."""

    def __init__(self, seed=1):
        rng = np.random.default_rng(seed)
        self.positions = directions_of(rng.random((VERTICES, 2))) * rng.uniform(0.2, 3, (VERTICES, 1)).astype(
            np.float32
        )
        self.normals = directions_of(rng.random((VERTICES, 2)))
        self.powers = (10.0 ** rng.uniform(-2, 1, VERTICES)).astype(np.float32)
        self.both_sides = (rng.random(VERTICES) < 0.3).astype(np.float32)
        self.choice = native.module().TestLightChoice(self.positions, self.normals, self.powers, self.both_sides)

    def reached(self, both_sides):
        """Those that can be lit from and light the eye vertex at all."""
        lights = ((self.positions * self.normals).sum(1) < 0) | (self.both_sides > 0)
        return lights & ((self.positions[:, 2] > 0) | both_sides)

    def draw(self, count, both_sides=False, seed=2):
        """Columns: number of the draw, vertex, how often it is drawn on average, what is left of u."""
        u = np.random.default_rng(seed).random(DRAWS, np.float32)
        up, origin = np.array([[0, 0, 1]], np.float32), np.zeros((1, 3), np.float32)
        return self.choice.draw(origin, up, both_sides, count, u).astype(np.float64)


def one_of_each(drawn):
    """Any one row of each draw: those of one draw depend on one another."""
    of_draw = np.bincount(drawn[:, 0].astype(int), minlength=DRAWS)
    first = np.concatenate([[0], np.cumsum(of_draw)[:-1]])
    pick = first + (np.random.default_rng(3).random(DRAWS) * of_draw).astype(int)
    return drawn[pick[of_draw > 0]]


@pytest.mark.parametrize("both_sides", [False, True])
@pytest.mark.parametrize("count", [1, 3, 20])
def test_light_vertices_are_drawn_as_often_as_is_claimed(count, both_sides):
    drawn = Vertices().draw(count, both_sides)
    # As many for each u as wished, but for rounding at the end of the running sum.
    of_draw = np.bincount(drawn[:, 0].astype(int), minlength=DRAWS)
    assert (of_draw == count).mean() > 0.999
    assert np.abs(of_draw - count).max() <= 1
    claimed = np.zeros(VERTICES)
    claimed[drawn[:, 1].astype(int)] = drawn[:, 2]
    assert claimed.sum() == pytest.approx(count, rel=1e-3)
    observed = np.bincount(one_of_each(drawn)[:, 1].astype(int), minlength=VERTICES).astype(float)
    expected = claimed / claimed.sum() * observed.sum()
    rare = expected < 5
    assert (~rare).sum() > 5
    assert observed[rare].sum() <= expected[rare].sum() + 5 * np.sqrt(expected[rare].sum() + 1)
    o, e = observed[~rare], expected[~rare]
    assert stats.chisquare(o, e * o.sum() / e.sum()).pvalue > SIGNIFICANCE


@pytest.mark.parametrize("both_sides", [False, True])
def test_every_light_vertex_that_may_matter_has_a_chance(both_sides):
    vertices = Vertices()
    seen = np.bincount(vertices.draw(64, both_sides)[:, 1].astype(int), minlength=VERTICES) > 0
    assert vertices.reached(both_sides).sum() > 5
    np.testing.assert_array_equal(seen, vertices.reached(both_sides))


@pytest.mark.parametrize("count", [1, 3])
def test_what_is_left_of_the_number_is_uniform(count):
    """Whichever vertex it drew: that decides about the shadow ray."""
    drawn = one_of_each(Vertices().draw(count))
    vertex, left = drawn[:, 1].astype(int), drawn[:, 3]
    assert left.min() >= 0
    assert left.max() <= 1
    counts = [np.histogram(left[vertex == v], 10, (0, 1))[0] for v in range(VERTICES)]
    often = [c for c in counts if c.sum() >= 500]
    assert len(often) > 5
    assert min(stats.chisquare(c).pvalue for c in often) > SIGNIFICANCE / len(often)


# ------------------------------------------------------------------------------------------------ the lens

RAYS, POINTS = 100_000, 1_000_000
RADIUS = 3.0  # of a sphere about the camera


def on_sphere(origin, direction):
    """Where rays leave the sphere about the origin; NaN: they begin outside."""
    b, c = (origin * direction).sum(1), (origin * origin).sum(1) - RADIUS**2
    with np.errstate(invalid="ignore"):
        t = -b + np.sqrt(b * b - c)
    return np.where((c < 0)[:, None], origin + t[:, None] * direction, np.nan)


class Lens:
    def __init__(self, name):
        self.camera = CAMERAS[name]()
        self.native = native.module().TestLens(self.camera)
        self.turn, self.place = self.camera.matrix[:3, :3].astype(np.float64), self.camera.matrix[:3, 3]
        self.rng = np.random.default_rng(5)

    def rays(self, count):
        """Film and lens numbers; origins and directions as the camera has them in the middle of the world."""
        film, u = self.rng.random((2, count, 2), np.float32)
        rays = self.native.rays(film, u).astype(np.float64)
        return film, u, rays[:, :3] - self.place, rays[:, 3:]

    def join(self, points, u):
        return self.native.join((points + self.place).astype(np.float32), u).astype(np.float64)

    def bins(self, points):
        """About the camera's axis, finer where it looks."""
        local = points @ self.turn / RADIUS
        ring = np.arccos(np.clip(-local[:, 2], -1, 1)) / np.pi
        around = (np.arctan2(local[:, 1], local[:, 0]) / np.pi + 1) / 2
        return np.minimum(ring * 40, 39).astype(int) * 12 + np.minimum(around * 12, 11).astype(int)


@pytest.mark.parametrize("name", CAMERAS)
def test_rays_come_by_as_densely_as_the_lens_claims(name):
    lens = Lens(name)
    _, _, origin, direction = lens.rays(RAYS)
    points = on_sphere(origin, direction)
    observed = np.bincount(lens.bins(points[np.isfinite(points[:, 0])]), minlength=480)

    # The same, expected: the density over the sphere, of what falls on the film.
    points = RADIUS * directions_of(lens.rng.random((POINTS, 2), np.float32)).astype(np.float64)
    found = lens.join(points, lens.rng.random((POINTS, 2), np.float32))
    film, density = found[:, 4:6], found[:, 6]
    cosine = np.abs((points * found[:, :3]).sum(1)) / RADIUS
    inside = ((film >= 0) & (film <= 1)).all(1) & (
        np.linalg.norm(points + found[:, :3] * found[:, 3:4], axis=1) < RADIUS
    )
    weight = np.where(inside, density * cosine, 0) * 4 * np.pi * RADIUS**2 / POINTS * RAYS
    of = lens.bins(points)
    expected = np.bincount(of, weight, 480)
    variance = np.bincount(of, weight**2, 480) + expected
    full = expected > 20
    assert full.sum() > 20
    assert expected.sum() == pytest.approx(observed.sum(), abs=5 * np.sqrt(variance.sum()))
    assert observed[~full].sum() <= expected[~full].sum() + 6 * np.sqrt(variance[~full].sum()) + 5
    statistic = ((observed - expected)[full] ** 2 / variance[full]).sum()
    assert stats.chi2.sf(statistic, full.sum()) > SIGNIFICANCE


@pytest.mark.parametrize("name", CAMERAS)
def test_points_are_joined_to_the_film_where_their_rays_began(name):
    lens = Lens(name)
    film, u, origin, direction = lens.rays(2000)
    solved = "panorama, depth" in name
    found = lens.join(origin + direction * 1.7, u)
    seen = found[:, 6] > 0
    assert seen.mean() > (0.95 if solved else 0.999)
    if lens.camera.kind == "PANO":  # about the poles many places of the film see a point, and one place many
        seen &= np.abs(film[:, 1] - 0.5) < 0.4
    np.testing.assert_allclose(found[seen, :3], -direction[seen], atol=1e-4)
    np.testing.assert_allclose(found[seen, 3], 1.7, atol=1e-3)
    np.testing.assert_allclose(found[seen, 4:6], film[seen], atol=2e-4)
    # Both ways round it is one density: the weights rest on it. Of panoramas with depth of field it is an approximation.
    np.testing.assert_allclose(found[seen, 7] / found[seen, 6], 1, rtol=0.3 if solved else 2e-3)
