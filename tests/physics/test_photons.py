"""Photons: the tree they are found in, and the integrators that read them, against closed forms and path tracing."""

import math

import numpy as np
import pytest
from agreement_scenes import CAMERAS, CAUSTICS, SCENES
from light_scenes import lamp, matrix
from scipy.spatial import cKDTree
from test_closed_forms import BOUNCES, looking, quad, scene_of, shiny, sphere, surface

from gi_engine import native
from gi_engine import scene_data as sd
from gi_engine.session import Session

RNG = np.random.default_rng


def clouds():
    for n in (0, 1, 15, 16, 17, 33, 1000, 20_000):
        yield f"{n} points", RNG(n).random((n, 3))
    yield "a plane", RNG(1).random((5000, 3)) * (1, 1, 0)
    yield "a line", RNG(2).random((5000, 3)) * (0, 1, 0)
    yield "clusters", np.repeat(RNG(3).random((10, 3)), 500, 0) + 1e-4 * RNG(4).random((5000, 3))


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(("name", "points"), list(clouds()), ids=lambda x: x if isinstance(x, str) else "")
def test_the_nearest_points_are_found(name, points, threads):
    points = points.astype(np.float32)
    tree = native.module().TestPoints(points, threads)
    places = RNG(5).random((50, 3)).astype(np.float32)
    for count, radius in ((1, 1e9), (7, 0.2), (60, 0.5), (200, 1e9)):
        found = tree.nearest(places, count, radius)
        if not len(points):
            assert (found == -1).all()
            continue
        reach = np.inf if radius > 10 else radius
        distance, _ = cKDTree(points.astype(float)).query(places, count, distance_upper_bound=reach)
        distance = distance.reshape(len(places), count)
        ours = np.linalg.norm(points[found].astype(float) - places[:, None], axis=-1)
        ours = np.sort(np.where(found >= 0, ours, np.inf), axis=1)
        assert all(len(set(row[row >= 0])) == (row >= 0).sum() for row in found)
        np.testing.assert_allclose(ours, distance, rtol=1e-5, atol=1e-6)


def test_equal_points_are_all_found():
    tree = native.module().TestPoints(np.ones((100, 3), np.float32), 1)
    found = tree.nearest(np.ones((1, 3), np.float32), 100, 0.1)
    assert sorted(found[0]) == list(range(100))


def shoot(integrator, scene, position, direction, samples=16, pixels=16, width=0.02, seed=1, threads=2, **parameters):
    """First channel of the picture, and what the integrator measured."""
    half = width / 2
    scene.camera = sd.Camera("camera", "ORTHO", looking(position, direction), (-half, half, -half, half), 0.0, 1e6)
    scene.film = sd.Film(pixels, pixels, filter="BOX", filter_width=1.0)
    settings = sd.Settings(integrator, samples, seed=seed, threads=threads, parameters={**BOUNCES, **parameters})
    with Session(scene, settings) as session:
        while not session.wait():
            pass
        return session.read("Combined")[..., 0].astype(np.float64), session.native.figures()


WAYS = {
    "progressive": ("sppm", {"photons": 20_000, "radius": 40}),
    "gathered": ("photon_map", {"global_photons": 50_000, "caustic_photons": 50_000, "global_light": "GATHERED"}),
    "cached": (
        "photon_map",
        {"global_photons": 50_000, "caustic_photons": 50_000, "global_light": "CACHED", "record_error": 0.1},
    ),
    "read directly": ("photon_map", {"global_photons": 50_000, "caustic_photons": 50_000, "global_light": "PHOTONS"}),
}


def repeated(way, scene, *where, runs=8, **options):
    integrator, parameters = WAYS[way]
    found = np.array(
        [shoot(integrator, scene, *where, seed=k + 1, **parameters, **options)[0].mean() for k in range(runs)]
    )
    return found.mean(), found.std(ddof=1) / math.sqrt(runs)


@pytest.mark.parametrize("way", WAYS)
def test_integrating_sphere(way):
    """A point of light in a sphere of albedo .5: mean irradiance power / (surface (1 - albedo)), here the same everywhere."""
    scene = scene_of(
        (sphere(rings=32), surface(0.5)), lights=[lamp("POINT", (4 * math.pi**2,) * 3, matrix=matrix((0, 0, 0)))]
    )
    mean, error = repeated(way, scene, (0.2, 0.1, 0), (0.5, 0.3, 0.7), width=0.05)
    assert error < 0.025
    assert abs(mean - 1) < 4 * error + 0.01  # 32 rings have half a percent less surface


@pytest.mark.parametrize("way", WAYS)
def test_bounces_are_counted(way):
    """In that sphere with one bounce between surfaces: of 1/2 + 1/4 + 1/8 … the first two."""
    scene = scene_of(
        (sphere(rings=32), surface(0.5)), lights=[lamp("POINT", (4 * math.pi**2,) * 3, matrix=matrix((0, 0, 0)))]
    )
    mean, error = repeated(way, scene, (0.2, 0.1, 0), (0.5, 0.3, 0.7), width=0.05, diffuse_bounces=1)
    assert abs(mean - 0.75) < 4 * error + 0.01


@pytest.mark.parametrize("way", WAYS)
def test_two_squares(way):
    """Unit squares face to face, 1 m apart, emittance 1 below, albedos .5 and .8: radiosity in the middles."""
    low = quad((-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0))
    high = quad((-0.5, -0.5, 1), (-0.5, 0.5, 1), (0.5, 0.5, 1), (0.5, -0.5, 1))
    scene = scene_of((low, surface(0.5, 1 / math.pi)), (high, surface(0.8)))
    for direction, truth in (((0, 0, -1), 1.0198462), ((0, 0, 1), 0.1947815)):
        mean, error = repeated(way, scene, (0, 0, 0.5), direction)
        assert abs(math.pi * mean - truth) < 4 * math.pi * error + 0.005 * truth


@pytest.mark.parametrize("way", WAYS)
def test_a_mirror_beside_a_floor(way):
    """Point light of 10 W/sr 2 m above the floor, 1 m from an upright mirror: the mirror's share, which no path from the eye finds."""
    floor = quad((0, -8, 0), (16, -8, 0), (16, 8, 0), (0, 8, 0))
    mirror = quad((0, -16, 0), (0, 16, 0), (0, 16, 16), (0, -16, 16))
    light = lamp("POINT", (40 * math.pi,) * 3, matrix=matrix((1, 0, 2)))
    scene = scene_of((floor, surface(1.0)), (mirror, shiny(0.0)), lights=[light])
    mean, error = repeated(way, scene, (1.5, 0, 1), (0, 0, -1), width=0.1)
    assert error < 0.1
    assert abs(math.pi * mean - 2.892147) < 4 * math.pi * error + 0.01


def test_radii_shrink_as_published():
    """[Knaus & Zwicker 2011] with alpha 2/3: .48825 of the first radius after 100 passes."""
    scene = scene_of((sphere(rings=8), surface(0.5)), lights=[lamp("POINT", (1.0,) * 3)])
    _, figures = shoot("sppm", scene, (0, 0, 0), (0, 0, 1), samples=100, pixels=1, photons=10, radius=1, alpha=2 / 3)
    assert figures["radius, pixels"] == pytest.approx(0.48825, abs=2e-3)


SEEDS, PIXELS, BLOCKS = 6, 32, 4
LIMITS = {f"{kind}_bounces": 5 for kind in ("max", "diffuse", "glossy", "transmission")}
BLUR = 0.02  # of a block: what bodies' edges take from discs, or add


def blocks_of(scene, integrator, samples, **parameters):
    """Means of blocks of pictures with seeds of their own: (SEEDS, BLOCKS², 3)."""
    found = []
    for seed in range(SEEDS):
        built = scene()
        built.camera = CAMERAS["perspective"]()
        built.film = sd.Film(PIXELS, PIXELS)
        settings = sd.Settings(integrator, samples, seed=seed + 1, threads=2, parameters={**LIMITS, **parameters})
        with Session(built, settings) as session:
            while not session.wait():
                pass
            assert session.progress()["bad_samples"] == 0
            image = session.read("Combined")[..., :3].astype(np.float64)
        size = PIXELS // BLOCKS
        found.append(image.reshape(BLOCKS, size, BLOCKS, size, 3).mean((1, 3)).reshape(-1, 3))
    return np.array(found)


ALIKE = {
    "sphere lamp",
    "soft lamp",
    "spread",
    "wide sun",
    "lamp without mis",
    "two lamps",
    "metal",
    "coat",
    "bumpy gloss",
}


@pytest.mark.parametrize("name", [name for name in SCENES | CAUSTICS if name not in ALIKE])
@pytest.mark.parametrize("way", ["progressive", "gathered", "cached"])
def test_photons_agree_with_path_tracing(way, name):
    integrator, parameters = WAYS[way]
    if way == "progressive":
        parameters = {"photons": 40_000, "radius": 1}
    scene = (SCENES | CAUSTICS)[name]
    truth, found = blocks_of(scene, "bdpt", 16), blocks_of(scene, integrator, 16, **parameters)
    error = np.sqrt((truth.var(0, ddof=1) + found.var(0, ddof=1)) / SEEDS) + 1e-6
    off = np.abs(truth.mean(0) - found.mean(0))
    assert (off < 9 * error + BLUR * truth.mean(0)).all()
    whole = np.sqrt((truth.mean(1).var(0, ddof=1) + found.mean(1).var(0, ddof=1)) / SEEDS)
    assert (np.abs(truth.mean((0, 1)) - found.mean((0, 1))) < 5 * whole + 0.5 * BLUR * truth.mean((0, 1))).all()


@pytest.mark.parametrize("name", ["mirror and diffuse", "clear glass", "gloss", "rough glass"])
@pytest.mark.parametrize("way", ["progressive", "gathered"])
def test_without_caustics_they_agree_with_path_tracing(way, name):
    """Blender's switches: what diffuse surfaces see of others loses its gloss and glass."""
    integrator, parameters = WAYS[way]
    off = {"caustics_reflective": False, "caustics_refractive": False}
    scene = (SCENES | CAUSTICS)[name]
    truth = blocks_of(scene, "path", 64, **off)
    found = blocks_of(scene, integrator, 16, **off, **(parameters | ({"radius": 1} if way == "progressive" else {})))
    whole = np.sqrt((truth.mean(1).var(0, ddof=1) + found.mean(1).var(0, ddof=1)) / SEEDS)
    assert (np.abs(truth.mean((0, 1)) - found.mean((0, 1))) < 5 * whole + 0.5 * BLUR * truth.mean((0, 1))).all()
    assert (np.abs(blocks_of(scene, "path", 64).mean((0, 1)) - truth.mean((0, 1))) > 5 * whole).any()  # it matters


def bulb_in_a_ball():
    return scene_of((sphere(rings=32), surface(0.5)), lights=[lamp("POINT", (1.0,) * 3, matrix=matrix())])


def wished(seed=1, **parameters):
    """Irradiance read where the eye looks, the error it is said to have, and what is told."""
    scene = bulb_in_a_ball()
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 0), (0.5, 0.3, 0.7)), (-0.4, 0.4, -0.4, 0.4), 0.0, 1e6)
    scene.film = sd.Film(16, 16, filter="BOX", filter_width=1.0)
    few = {"global_photons": 1000, "caustic_photons": 10, "global_light": "PHOTONS"}
    settings = sd.Settings("photon_map", 1, seed=seed, threads=2, parameters={**BOUNCES, **few, **parameters})
    with Session(scene, settings) as session:
        while not session.wait():
            pass
        told = next(m for m in session.native.messages() if m.startswith("global photons: error"))
        image = session.read("Combined")[..., 0].astype(np.float64)
        return image, session.native.figures()["global photon error"], told


def test_photons_are_sent_until_the_error_is_met():
    runs = [wished(seed, photon_error=8) for seed in range(1, 9)]
    assert all(error <= 0.08 and told.endswith("as wished") for _, error, told in runs)
    images = np.array([image for image, _, _ in runs])
    measured = math.sqrt((images.var(0, ddof=1) / images.mean(0) ** 2).mean())
    assert 0.5 * np.mean([error for _, error, _ in runs]) < measured < 0.08


def test_photons_end_with_the_memory():
    _, error, told = wished(photon_error=0.5, photon_memory=1)
    assert error > 0.005 and told.endswith("memory is used up")


def test_kept_photons_make_the_same_picture():
    scene = CAUSTICS["mirror and diffuse"]

    def render(kept=None, **parameters):
        built = scene()
        built.camera, built.film = CAMERAS["perspective"](), sd.Film(16, 16)
        settings = sd.Settings("photon_map", 2, threads=2, parameters={**LIMITS, **WAYS["gathered"][1], **parameters})
        with Session(built, settings, kept=kept) as session:
            while not session.wait():
                pass
            return session.read("Combined"), session.native.kept()

    image, kept = render()
    again, kept_again = render(kept, global_photons=1, caustic_photons=1)  # which would be dark
    np.testing.assert_allclose(again, image, rtol=1e-3, atol=1e-5)
    assert {name: table.shape for name, table in kept.items()} == {name: t.shape for name, t in kept_again.items()}
    for spoil in (lambda t: t[1:].__setitem__((0, 3), np.nan), lambda t: t[1:].__setitem__((0, 10), 0.5)):
        damaged = {name: np.array(table) for name, table in kept.items()}
        spoil(damaged["caustic"])
        with pytest.raises(Exception, match="'caustic', row 1: no photon"):
            render(damaged)


def terms(scene, position, direction, width=0.02, **options):
    """The picture and the terms that it is the sum of, first channels."""
    names = ["Combined", "Direct", "Specular", "Caustic", "Global"]
    half = width / 2
    scene.camera = sd.Camera("camera", "ORTHO", looking(position, direction), (-half, half, -half, half), 0.0, 1e6)
    scene.film = sd.Film(16, 16, filter="BOX", filter_width=1.0, passes=names)
    settings = sd.Settings("photon_map", 32, threads=2, parameters={**BOUNCES, **WAYS["gathered"][1], **options})
    with Session(scene, settings) as session:
        while not session.wait():
            pass
        return [session.read(name)[..., 0].astype(np.float64) for name in names]


def test_terms_make_the_picture():
    scene = CAUSTICS["mirror and diffuse"]()
    picture, *parts = terms(scene, (0, 0, 0.9), (0.2, 0.3, -1), width=1.5)
    assert all(part.mean() > 1e-3 for part in parts)
    np.testing.assert_allclose(sum(parts), picture, rtol=1e-4, atol=1e-6)


def test_the_caustic_term_is_what_mirrors_throw():
    """The floor beside a mirror: what comes straight, 10 cos θ / r² = 2, is the direct term; the rest is the mirror's."""
    floor = quad((0, -8, 0), (16, -8, 0), (16, 8, 0), (0, 8, 0))
    mirror = quad((0, -16, 0), (0, 16, 0), (0, 16, 16), (0, -16, 16))
    light = lamp("POINT", (40 * math.pi,) * 3, matrix=matrix((1, 0, 2)))
    scene = scene_of((floor, surface(1.0)), (mirror, shiny(0.0)), lights=[light])
    direct = 10 * 2 / (0.5**2 + 2**2) ** 1.5
    for without, caustic in ((True, 0.0), (False, 2.892147 - direct)):
        _, *parts = terms(
            scene, (1.5, 0, 1), (0, 0, -1), width=0.1, caustic_photons=400_000, caustics_reflective=not without
        )
        found = [math.pi * part.mean() for part in parts]
        np.testing.assert_allclose(found, [direct, 0, caustic, 0], rtol=0.06, atol=1e-6)


def test_photons_are_shown():
    """A lamp in the middle of a sphere: as many photons on each square metre, and a disc of the neighbours' number."""
    scene = scene_of((sphere(rings=32), surface(0.5)), lights=[lamp("POINT", (1.0,) * 3, matrix=matrix())])
    names = ["Combined", "Photons", "Photon Density", "Photon Radius"]
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 0), (0.5, 0.3, 0.7)), (-0.2, 0.2, -0.2, 0.2), 0.0, 1e6)
    scene.film = sd.Film(16, 16, filter="BOX", filter_width=1.0, passes=names)
    settings = sd.Settings(
        "photon_map", 8, threads=2, parameters={**BOUNCES, "global_photons": 50_000, "global_count": 50}
    )
    with Session(scene, settings) as session:
        while not session.wait():
            pass
        stored = session.native.figures()["global photons"]
        photons, density, radius = (session.read(name)[..., 0].astype(np.float64) for name in names[1:])
    truth = stored / (4 * math.pi)
    assert density.mean() == pytest.approx(truth, rel=0.2)  # photons are aimed, a little
    assert 50 / (math.pi * radius.mean() ** 2) == pytest.approx(truth, rel=0.2)
    disc = math.pi * (0.2 / 16) ** 2
    assert photons.mean() == pytest.approx(truth * disc, rel=0.4)
