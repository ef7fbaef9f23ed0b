"""Light as it leaves luminaires: rays follow their density, and carry all the power that the lamps have.

The density is checked where the light arrives: on a sphere about (or within) the lights, against light sampling, which has its own tests.
"""

import numpy as np
import pytest
from light_scenes import build, emission, f32, lamp, matrix, triangle_scene, with_world
from scipy import integrate, stats

from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder

SAMPLES = 200_000
SIGNIFICANCE = 1e-3  # shared by all cases of a test


def lamps(*lights):
    return sd.Scene(lights=list(lights))


def gradient(name="gradient"):
    """Emission that varies over space, and over directions of a world."""
    builder = ProgramBuilder()
    builder.op("emission", 1.0, builder.op("position"), 3.0)
    return builder.finish(name)


TILTED = matrix((0.3, -0.2, 0.4), (0.8, 0, 0.6), (0, 1, 0), (-0.6, 0, 0.8))
STRETCHED = matrix((0.3, -0.2, 0.4), (1.6, 0, 1.2), (0, 0.5, 0), (-0.6, 0, 0.8))
TRIANGLES = [[(-0.5, -0.4, 0), (0.5, -0.4, 0.2), (0, 0.6, 0.1)], [(0.6, 0, -0.5), (0.7, 0.3, 0.2), (0.5, -0.4, 0.3)]]

LOCAL = {
    "point": lambda: lamps(lamp("POINT", matrix=TILTED)),
    "sphere": lambda: lamps(lamp("POINT", matrix=TILTED, radius=0.4, soft_falloff=False)),
    "soft point": lambda: lamps(lamp("POINT", matrix=TILTED, radius=0.4, soft_falloff=True)),
    "spot": lambda: lamps(lamp("SPOT", matrix=TILTED, spot_size=1.2, spot_blend=0.4)),
    "squeezed spot": lambda: lamps(lamp("SPOT", matrix=STRETCHED, spot_size=0.8, spot_blend=0.2)),
    "spot with a radius": lambda: lamps(
        lamp("SPOT", matrix=TILTED, spot_size=1.0, spot_blend=0.5, radius=0.3, soft_falloff=False)
    ),
    "soft spot": lambda: lamps(lamp("SPOT", matrix=TILTED, spot_size=1.0, spot_blend=0.5, radius=0.3)),
    "rectangle": lambda: lamps(lamp("AREA", matrix=TILTED, size=(0.5, 0.9))),
    "ellipse": lambda: lamps(lamp("AREA", matrix=TILTED, shape="ELLIPSE", size=(0.5, 0.9))),
    "wide spread": lambda: lamps(lamp("AREA", matrix=TILTED, size=(0.5, 0.9), spread=2.0)),
    "narrow spread": lambda: lamps(lamp("AREA", matrix=TILTED, size=(0.5, 0.9), spread=0.4)),
    "beam": lambda: lamps(lamp("AREA", matrix=TILTED, size=(0.5, 0.9), spread=0.0)),
    "triangles": lambda: triangle_scene(TRIANGLES),
    "many": lambda: lamps(
        lamp("POINT", matrix=TILTED), lamp("AREA", (3, 3, 3), matrix=matrix((0, 0, 0.8)), size=(0.5, 0.5))
    ),
}
FAR = {
    "sun": lambda: lamps(lamp("SUN", matrix=TILTED, angle=0.0)),
    "wide sun": lambda: lamps(lamp("SUN", matrix=TILTED, angle=0.8)),
    "even world": lambda: with_world(sd.Scene(), emission()),
    "sky": lambda: with_world(sd.Scene(), gradient()),
}


def directions_of(u):
    z, a = 1 - 2 * u[:, 0], 2 * np.pi * u[:, 1]
    return np.stack(
        [np.sqrt(np.maximum(1 - z * z, 0)) * np.cos(a), np.sqrt(np.maximum(1 - z * z, 0)) * np.sin(a), z], 1
    )


def bins_of(position, direction):
    """A coarse grid over where a ray meets the sphere and how."""

    def cell(v, rows, columns):
        v = v / np.linalg.norm(v, axis=1, keepdims=True)
        i = np.clip(((v[:, 2] + 1) / 2 * rows).astype(int), 0, rows - 1)
        return i * columns + np.clip(
            ((np.arctan2(v[:, 1], v[:, 0]) / np.pi + 1) / 2 * columns).astype(int), 0, columns - 1
        )

    return cell(position, 6, 8) * 24 + cell(direction, 4, 6)


def first_on_sphere(origin, direction, radius):
    """Where rays first meet the sphere about the origin from outside, or leave it from inside; NaN: nowhere."""
    b, c = (origin * direction).sum(1), (origin * origin).sum(1) - radius**2
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b * b - c)
    t = np.where(c > 0, -b - root, -b + root)
    return np.where((t > 0)[:, None], origin + t[:, None] * direction, np.nan)


@pytest.mark.parametrize("name", [*LOCAL, *FAR])
def test_rays_follow_their_density(name):
    rng = np.random.default_rng(3)
    inside = name in FAR
    radius, sign = (0.8, 1.0) if inside else (4.0, -1.0)
    lights = build((FAR if inside else LOCAL)[name]())
    u = rng.random((2, SAMPLES, 3), np.float32)
    emitted = lights.emit(*u)
    origin, direction, light = emitted[:, :3].astype(float), emitted[:, 3:6].astype(float), emitted[:, 9]
    arrived = first_on_sphere(origin, direction, radius)
    counted = (light >= 0) & np.isfinite(arrived[:, 0]) & (emitted[:, 6] != 0)
    observed = np.bincount(bins_of(arrived[counted], direction[counted]), minlength=48 * 24)

    # The same, expected: ∫∫ pdf_emit |cos| dω dA over the sphere, directions by light sampling.
    position = (radius * directions_of(rng.random((SAMPLES, 2)))).astype(np.float32)
    normal = (sign * position / radius).astype(np.float32)
    area = 4 * np.pi * radius**2
    table = np.concatenate(
        [
            np.c_[
                t := lights.sample(position, normal, rng.random((SAMPLES, 3), np.float32), light=k),
                lights.pdf_emit(position, np.ascontiguousarray(t[:, :3]), k),
            ]
            for k in range(lights.count)
        ]
    )
    wi, pdf_dir, pdf_emit = table[:, :3], table[:, 7], table[:, 10]
    cos = (wi * np.tile(normal, (lights.count, 1))).sum(1)
    good = (table[:, 9] >= 0) & (cos > 0) & (table[:, 4] != 0)
    weight = np.where(good, cos * pdf_emit / np.where(good, pdf_dir, 1) * area, 0) / SAMPLES
    bins = bins_of(np.tile(position, (lights.count, 1))[good], -wi[good])
    expected = np.bincount(bins, weight[good], 48 * 24) * SAMPLES
    variance = np.bincount(bins, weight[good] ** 2, 48 * 24) * SAMPLES**2 + np.maximum(expected, 1)
    if not inside:
        assert expected.sum() == pytest.approx(counted.sum(), abs=5 * np.sqrt(variance.sum()))
    full = expected > 20
    assert observed[~full].sum() <= expected[~full].sum() + 6 * np.sqrt(variance[~full].sum()) + 5
    p = 2 * stats.norm.sf(np.abs(observed - expected)[full] / np.sqrt(variance[full]))
    assert p.min() > SIGNIFICANCE / (full.sum() * len(LOCAL | FAR)), (
        observed[full][p.argmin()],
        expected[full][p.argmin()],
    )


@pytest.mark.parametrize("name", [*LOCAL, *FAR])
def test_power_is_radiance_over_density(name):
    """What arrives a metre on, as light sampling sees it, is the power that was sent."""
    lights = build((LOCAL | FAR)[name]())
    rng = np.random.default_rng(4)
    table = lights.emit(*rng.random((2, 20_000, 3), np.float32), along=1.0)
    sent = table[:, 9] >= 0
    power, arrived = table[sent, 6], table[sent, 10]
    seen = arrived != 0
    assert seen.mean() > (0.85 if "soft" in name else 0.999)
    np.testing.assert_allclose(arrived[seen], power[seen], rtol=5e-4, atol=1e-6)
    assert (table[sent, 13][seen] > 0).all()


def cone_power(size, blend):
    """Of a spot of 1 W: the share of the sphere, its edge a smoothstep."""
    c = np.linspace(np.cos(size / 2), 1, 200_001)
    s = np.clip((c - np.cos(size / 2)) / ((1 - np.cos(size / 2)) * blend), 0, 1)
    return integrate.trapezoid(s * s * (3 - 2 * s), c) / 2


AREA = sum(0.5 * np.linalg.norm(np.cross(np.subtract(t[1], t[0]), np.subtract(t[2], t[0]))) for t in TRIANGLES)
BALL = np.pi  # m² across: scenes without geometry have a ball of 1 m
POWER = {
    "point": 1,
    "sphere": 1,
    "soft point": 1,
    "spot": cone_power(1.2, 0.4),
    "spot with a radius": cone_power(1.0, 0.5),
    "soft spot": cone_power(1.0, 0.5),
    "rectangle": 1,
    "ellipse": 1,
    "wide spread": 1,
    "narrow spread": 1,
    "beam": 1,
    "triangles": 2 * np.pi * AREA,
    "many": 4,
    "sun": BALL,
    "wide sun": BALL * 2 * (1 - np.cos(0.4)) / np.sin(0.4) ** 2,  # 1 W/m² on a surface that faces it
    "even world": 4 * np.pi * BALL,
}


@pytest.mark.parametrize("name", POWER)
def test_emitted_power_is_the_lamps(name):
    lights = build((LOCAL | FAR)[name]())
    table = lights.emit(*np.random.default_rng(5).random((2, SAMPLES, 3), np.float32))
    power = np.where(table[:, 9] >= 0, table[:, 6], 0).astype(float)
    assert power.mean() == pytest.approx(POWER[name], abs=4.5 * power.std() / np.sqrt(SAMPLES) + 2e-4 * POWER[name])


def test_textured_emission_has_the_power_of_its_texture():
    """A square in the plane z = 0 whose radiance is 3 x."""
    lights = build(triangle_scene([[(0, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 0, 0), (1, 1, 0), (0, 1, 0)]], gradient()))
    table = lights.emit(*np.random.default_rng(6).random((2, SAMPLES, 3), np.float32))
    power = np.where(table[:, 9] >= 0, table[:, 6], 0).astype(float)
    assert power.mean() == pytest.approx(2 * np.pi * 1.5, abs=4.5 * power.std() / np.sqrt(SAMPLES))


def test_many_emitters_send_light_evenly():
    """A field of 100,000 triangles of one size: as many rays from each thousand."""
    k = np.arange(100_000)
    place = np.stack([k % 400, k // 400, 0 * k], 1)
    lights = build(triangle_scene(place[:, None] + np.array([(0, 0, 0), (0.5, 0, 0), (0, 0.5, 0)])))
    table = lights.emit(*np.random.default_rng(8).random((2, SAMPLES, 3), np.float32))
    sent = table[:, 9] >= 0
    assert sent.mean() > 0.999
    counts = np.bincount((table[sent, 9] // 1000).astype(int), minlength=100)
    assert stats.chisquare(counts).pvalue > SIGNIFICANCE


def test_lamps_of_soft_falloff_turn_to_whoever_looks():
    """Close to such a lamp, what has left it at its rim is not what is seen there."""
    lights = build(LOCAL["soft point"]())
    u = np.random.default_rng(7).random((2, 1000, 3), np.float32)
    assert (lights.emit(*u, along=0.01)[:, 10] == 0).mean() > 0.3
    assert (lights.emit(*u, along=100.0)[:, 10] == 0).mean() < 0.01


def test_densities_of_where_nothing_is_sent():
    lights = build(LOCAL["spot"]())
    assert lights.pdf_emit(f32((0, 0, 3)), f32((0.6, 0, -0.8)), 0)[0, 0] == 0
    lights = build(LOCAL["sphere"]())
    assert lights.pdf_emit(f32((0.3, -0.2, 0.5)), f32((0, 0, 1)), 0)[0, 0] == 0
