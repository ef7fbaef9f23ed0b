"""How light is spread below surfaces (Christensen and Burley) and by particles in water (Fournier and Forand): densities, samplers, and
whole renders by closed forms."""

import math

import numpy as np
import pytest
from scipy import integrate, stats
from test_closed_forms import check, looking, probe, quad, scene_of

from gi_engine import native
from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder
from gi_engine.session import Session

REACH = 16.0  # of the profile's length
LEGACY = 0.25 / math.pi  # lengths by radii
PROFILE = 3  # the op's immediate


def profile(d=1.0):
    return native.module().TestDiffusionProfile(d)


def part_within(r, d=1.0):
    def whole(x):
        return 1 - 0.25 * np.exp(-x) - 0.75 * np.exp(-x / 3)

    return whole(np.minimum(r / d, REACH)) / whole(REACH)


# -------------------------------------------------------------------- below surfaces


@pytest.mark.parametrize("d", [1.0, 0.003, 70.0])
def test_a_profile_is_normalized(d):
    r = np.linspace(0, REACH * d, 200_001, dtype=np.float32)
    assert integrate.trapezoid(profile(d).density(r), r) == pytest.approx(1, abs=1e-4)
    assert (profile(d).density(np.float32([1.001 * REACH * d])) == 0).all()


@pytest.mark.parametrize("d", [1.0, 0.003])
def test_distances_are_drawn_by_their_density(d):
    u = np.random.default_rng(1).random(200_000, np.float32)
    r = profile(d).sample(u)
    assert r.min() >= 0 and r.max() <= REACH * d
    assert stats.kstest(r, lambda x: part_within(x, d)).pvalue > 0.01
    edges = d * np.append(np.linspace(0, 12, 61), REACH)
    observed, _ = np.histogram(r, edges)
    expected = [integrate.quad(lambda x: float(profile(d).density(np.float32([x]))[0]), a, b)[0]
                for a, b in zip(edges, edges[1:], strict=False)]  # fmt: skip
    assert stats.chisquare(observed, np.array(expected) * len(u) / sum(expected)).pvalue > 0.01


def test_distances_grow_with_the_number():
    r = profile().sample(np.linspace(0, 1 - 2**-24, 10_001, dtype=np.float32))
    assert (np.diff(r) >= 0).all() and r[0] == 0 and r[-1] == pytest.approx(REACH, rel=1e-3)


def spreading(d, albedo=(1.0, 1.0, 1.0), name="wax"):
    b = ProgramBuilder()
    radius = tuple(length / LEGACY for length in (d if isinstance(d, tuple) else (d,) * 3))
    b.op("subsurface", 1.0, albedo, 1.0, radius, 1.4, 1.0, 0.0, (0, 0, 0), imm=(PROFILE,))
    return b.finish(name)


def plane(left=-50.0, right=50.0):
    return quad((left, -50, 0), (right, -50, 0), (right, 50, 0), (left, 50, 0))


@pytest.mark.parametrize("d", [0.01, 0.2])
def test_nothing_is_lost_below_a_wide_plane(d):
    check(probe(scene_of((plane(), spreading(d)), world=1.0), (0, 0, 1), (0, 0.3, -1)), 1.0, 2e-3)


@pytest.mark.parametrize("a", [0.02, 0.2, 0.6])
def test_what_comes_out_beyond_an_edge_is_lost(a, d=0.2):
    """The plane ends at a distance a: of the light that comes out r away, the part within an angle acos(a / r) of the edge's direction."""
    lost = integrate.quad(
        lambda r: float(profile(d).density(np.float32([r]))[0]) * math.acos(a / r) / math.pi, a, REACH * d, limit=200
    )[0]
    scene = scene_of((plane(left=-a), spreading(d)), world=1.0)
    check(probe(scene, (0, 0, 1), (0, 0, -1), samples=256), 1 - lost, 2e-3)


def test_each_channel_has_its_own_length():
    """And one without a length is diffuse."""
    d, a = (0.05, 0.3, 0.0), 0.1
    scene = scene_of((plane(left=-a), spreading(d, (0.8, 0.6, 0.4))), world=1.0)
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 1), (0, 0, -1)), (-1e-4, 1e-4, -1e-4, 1e-4), 0.0, 1e6)
    scene.film = sd.Film(32, 32, filter="BOX", filter_width=1.0)
    with Session(scene, sd.Settings("path", 256, threads=2, parameters={"diffuse_bounces": 0})) as session:
        while not session.wait():
            pass
        image = session.read("Combined").astype(np.float64)
    for c, albedo in enumerate((0.8, 0.6, 0.4)):
        lost = 0.0
        if d[c]:
            r = np.linspace(a, REACH * d[c], 100_001, dtype=np.float32)
            lost = integrate.trapezoid(profile(d[c]).density(r) * np.arccos(np.minimum(a / r, 1)) / math.pi, r)
        check(image[..., c], albedo * (1 - lost), 2e-3)


def test_light_leaves_by_the_side_it_went_in_by():
    """A sheet seen from behind, lit from there alone."""
    scene = scene_of((plane(), spreading(0.05)), world=1.0)
    check(probe(scene, (0, 0, -1), (0, 0.2, 1)), 1.0, 2e-3)


# -------------------------------------------------------------------- particles in water

WATERS = [
    (0.1, 1.33),
    (0.018, 1.1),
    (0.3, 1.05),
    (0.499, 1.5),
    (0.05, 1.0 + math.sqrt(2 / 3)),
    (0.2, 1.0 + math.sqrt(4 / 3)),
    (0.1, 2.5),
]


@pytest.mark.parametrize("backscatter, ior", WATERS)
def test_the_density_is_the_slope_of_its_parts(backscatter, ior):
    phase = native.module().TestFournierForand(backscatter, ior)
    edges = np.cos(np.radians(np.linspace(2, 180, 90))).astype(np.float32)
    within = phase.part_within(edges)
    assert (np.diff(within) > 0).all()
    assert within[-1] == pytest.approx(1, abs=1e-5)
    x, w = np.polynomial.legendre.leggauss(16)
    a, b = edges[:-1].astype(float), edges[1:].astype(float)
    at = (0.5 * (a + b)[:, None] + 0.5 * (b - a)[:, None] * x).astype(np.float32)
    densities = phase.density(np.ascontiguousarray(at.ravel())).reshape(at.shape)
    assert (densities > 0).all()
    np.testing.assert_allclose(np.pi * (densities * w).sum(-1) * (a - b), np.diff(within), rtol=1e-3, atol=2e-6)


@pytest.mark.parametrize("backscatter, ior", WATERS)
def test_so_much_is_scattered_back(backscatter, ior):
    phase = native.module().TestFournierForand(backscatter, ior)
    assert 1 - phase.part_within(np.float32([0.0]))[0] == pytest.approx(backscatter, abs=1e-5)


@pytest.mark.parametrize("backscatter, ior", WATERS)
def test_angles_are_drawn_by_their_density(backscatter, ior):
    """By parts of the light, since most of it goes almost straight on."""
    phase = native.module().TestFournierForand(backscatter, ior)
    u = np.random.default_rng(2).random(100_000, np.float32)
    cosines = phase.sample(u)
    assert (np.abs(cosines) <= 1).all()
    away = cosines < 1 - 1e-5  # nearer to straight on single precision cannot tell them apart
    np.testing.assert_allclose(phase.part_within(cosines[away]), u[away], atol=2e-4)
    assert away.mean() == pytest.approx(1 - phase.part_within(np.float32([1 - 1e-5]))[0], abs=0.01)
    edges = np.cos(np.radians(np.array([0.5, 1, 2, 4, 8, 15, 30, 50, 70, 90, 110, 130, 150, 165, 180]))).astype(
        np.float32
    )
    expected = np.diff(phase.part_within(edges), prepend=0.0)
    observed = np.histogram(-cosines, np.concatenate([[-1.0], -edges.astype(float)]))[0]
    enough = expected * len(u) > 5
    assert stats.chisquare(
        np.append(observed[enough], observed[~enough].sum() + 1e-9),
        np.append(expected[enough], expected[~enough].sum() + 1e-14) / expected.sum() * len(u),
    ).pvalue > 0.01  # fmt: skip


def test_a_mix_of_media_is_drawn_by_what_it_says():
    """Dust in water: nothing is lost in a white furnace filled with both."""
    from test_volumes import filled, seen

    b = ProgramBuilder()
    for imm, first, second in ((4, 0.1, 1.33), (0, 0.4, 0.0)):
        b.op("volume_coefficients", 1.0, (0, 0, 0), (0.5, 0.5, 0.5), (0, 0, 0), first, second, imm=(imm,))
    check(seen(filled(b.finish("water"), world=1.0), (-3, 0.1, 0.2), (1, 0, 0)), 1.0, 5e-3)
