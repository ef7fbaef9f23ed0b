"""Irradiance caching: gradients against closed forms, the rules of the cache, and whole pictures against closed forms and path tracing.

The cache is biased on purpose: tolerances below are the bias that its settings allow, and are stated as numbers."""

import itertools
import math
import time

import numpy as np
import pytest
from agreement_scenes import SCENES, camera
from light_scenes import f32, image_sky, lamp, matrix, triangle_scene
from test_closed_forms import cube, lambert, probe, quad, scene_of, shiny, sphere, surface

from gi_engine import native
from gi_engine import scene_data as sd
from gi_engine.session import Session

UP = f32((0, 0, 1))
MANY = {f"{kind}_bounces": 60 for kind in ("max", "diffuse", "glossy", "transmission")}


def irradiance_of(scene, error=0.2):
    return native.module().TestIrradiance(scene, native.embree_path(), error)


def triangles_of(*quads):
    return [t for q in quads for t in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))]


# -------------------------------------------------------------------------------------------------- records

LAMP = ((-0.3, -0.4, 0.5), (0.5, -0.4, 0.6), (0.5, 0.4, 0.7), (-0.3, 0.4, 0.6))
PLACES = [(0, 0, 0), (0.3, 0.1, 0), (-0.6, 0.2, 0), (0.1, -0.9, 0)]


def truth(position, normal=(0, 0, 1)):
    """Irradiance from LAMP of radiance 1."""
    return math.pi * lambert(LAMP, np.asarray(position, float), np.asarray(normal, float))


def slope(f, h=1e-4):
    return np.array([(f(h * e) - f(-h * e)) / (2 * h) for e in np.eye(3)])


def gathered(position, samples, count):
    """Mean and standard error over `count` records."""
    scene = triangle_scene(triangles_of(LAMP))
    rows = irradiance_of(scene).gather(f32(*[position] * count), UP, samples)
    return rows.mean(0), rows.std(0, ddof=1) / math.sqrt(count)


@pytest.mark.parametrize("position", PLACES)
def test_gradients_are_the_slopes_of_irradiance(position):
    mean, error = gathered(position, 1024, 64)
    expected = truth(position)
    assert abs(mean[0] - expected) < 5 * error[0]
    # Strata that the lamp's edge cuts are taken to lie within it as a whole: a few per cent.
    moved = slope(lambda d: truth(np.asarray(position) + d))[:2]
    np.testing.assert_allclose(mean[2:4], moved, atol=5 * error[2:4].max() + 0.05 * np.abs(moved).max())
    # Turned by a small angle towards x and y.
    turned = slope(lambda d: truth(position, d + (0, 0, 1)))[:2]
    np.testing.assert_allclose(mean[5:7], turned, atol=5 * error[5:7].max() + 0.01 * expected)
    assert abs(mean[4]) < 1e-5 * expected and abs(mean[7]) < 1e-5 * expected  # nothing along the normal


# -------------------------------------------------------------------------------------------------- the cache


def filled(places, radius, gradient=(0, 0, 0), error=0.2, normal=UP):
    """A cache of records of 1 + gradient · position, in a scene of 4 m."""
    cache = irradiance_of(triangle_scene([((-2, -2, -2), (2, 2, 2), (2, -2, 2))]), error)
    places = f32(*places)
    radii = np.full(len(places), radius, np.float32) if np.isscalar(radius) else np.array(radius, np.float32)
    cache.insert_linear(places, np.ascontiguousarray(np.broadcast_to(normal, places.shape)), radii, f32(gradient))
    return cache


def test_gradients_make_interpolation_exact_where_light_is_linear():
    rng = np.random.default_rng(1)
    gradient = np.array((0.3, -0.2, 0.0))
    cache = filled(np.column_stack([rng.uniform(-1, 1, (2000, 2)), np.zeros(2000)]), 0.5, gradient)
    at = np.column_stack([rng.uniform(-0.9, 0.9, (500, 2)), np.zeros(500)]).astype(np.float32)
    for freeze in (False, True):
        if freeze:
            cache.freeze()
        found = cache.find(at, UP, UP)
        assert (found[:, 3] == 1).all()
        assert (found[:, 1] > 5).all()
        np.testing.assert_allclose(found[:, 0], 1 + at @ gradient, rtol=1e-5)


@pytest.mark.parametrize(
    ("position", "normal", "holds"),
    [
        ((0.10, 0, 0), (0, 0, 1), True),
        ((0.19, 0, 0), (0, 0, 1), True),
        ((0.21, 0, 0), (0, 0, 1), False),  # further than alpha times the radius
        ((0.10, 0, 0), (0, 0, -1), False),  # the other side
        ((0.10, 0, 0), (1, 0, 0), False),
        ((0.00, 0, 0), (math.sin(0.25), 0, math.cos(0.25)), True),  # sqrt(1 - cos) = 0.18
        ((0.00, 0, 0), (math.sin(0.3), 0, math.cos(0.3)), False),
        ((0.05, 0, 0.08), (0, 0, 1), True),  # behind the record's surface, so to speak
        ((0.05, 0, -0.08), (0, 0, 1), False),  # the record is in front of the point
    ],
)
def test_where_a_record_holds(position, normal, holds):
    cache = filled([(0, 0, 0)], 1.0)
    assert cache.find(f32(position), f32(normal), f32(normal))[0, 3] == holds


def test_weights_fade_to_nothing_where_a_record_ends():
    """Crossing the end of a record's sphere is not seen: another record's value goes on without a step."""
    cache = irradiance_of(triangle_scene([((-2, -2, -2), (2, 2, 2), (2, -2, 2))]), 0.2)
    for x, g in ((0.0, 0.0), (0.3, 1.0)):  # of values 1 and 1.3, without gradients between them
        cache.insert_linear(f32((x, 0, 0)), UP, np.array([1.0], np.float32), f32((g, 0, 0)))
    at = np.column_stack([np.linspace(-0.2, 0.5, 2001), np.zeros((2001, 2))]).astype(np.float32)
    values = cache.find(at, UP, UP)[:, 0]
    assert values.min() < 1.01
    assert values.max() > 1.29
    assert np.abs(np.diff(values)).max() < 5e-3


def test_neighbours_clamp_one_another():
    """After any insertions no radius exceeds another's by more than the distance between the two. [Křivánek 2006]"""
    rng = np.random.default_rng(3)
    places = np.column_stack([rng.uniform(-1, 1, (300, 2)), np.zeros(300)])
    radii = filled(places, rng.uniform(0.05, 2.0, 300)).radii()[:, 0]
    distance = np.linalg.norm(places[:, None] - places[None], axis=-1)
    near = distance < 0.2 * radii[:, None]
    excess = np.where(near, radii[:, None] - radii[None, :] - distance, -1)
    assert excess.max() < 1e-5
    assert radii.max() > 0.1


def test_lookups_are_fast():
    """Under a microsecond at 20,000 records, on an idle machine; twice that is let pass."""
    rng = np.random.default_rng(4)
    side = 4.0 / math.sqrt(20_000)
    places = np.column_stack([rng.uniform(-2, 2, (20_000, 2)), np.zeros(20_000)])
    cache = filled(places, 1.0 * side / 0.2)
    cache.freeze()
    x, y = np.meshgrid(np.linspace(-1.9, 1.9, 300), np.linspace(-1.9, 1.9, 300))
    at = np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3).astype(np.float32)
    assert (cache.find(at, UP, UP)[:, 1] > 0).mean() > 0.95
    seconds = min(cache.time(at, UP) for _ in range(5)) / len(at)
    assert seconds < 2e-6, f"{seconds * 1e9:.0f} ns"


# -------------------------------------------------------------------------------------------------- guided rays


def cosine_directions(rng, count):
    """Directions about z that follow the cosine."""
    sin2, phi = rng.random(count), 2 * np.pi * rng.random(count)
    return np.stack([np.sqrt(sin2) * np.cos(phi), np.sqrt(sin2) * np.sin(phi), np.sqrt(1 - sin2)], -1).astype(
        np.float32
    )


def cap(directions):
    """Light from a small bright place low in one direction, and a little from everywhere."""
    return (0.1 + 30 * (directions @ f32(0.8, 0.2, math.sqrt(0.32)) > 0.97)).astype(np.float32)


@pytest.mark.parametrize("seen", [0, 1, 40, 1000])
def test_guided_directions_are_distributed_as_their_weights_say(seen):
    """chi² over equal cells of the hemisphere, against weights integrated by directions that follow the cosine."""
    rng, rays, cells = np.random.default_rng(seen), 200_000, (6, 12)
    met = cosine_directions(rng, seen)
    found = native.module().guided_directions(met, cap(met), rng.random((rays, 3), dtype=np.float32))
    directions, weight = found[:, :3], found[:, 3]
    assert np.abs(np.linalg.norm(directions, axis=1) - 1).max() < 1e-5 and (weight > 0).all()

    def cell_of(d):
        ring = np.minimum((d[:, 0] ** 2 + d[:, 1] ** 2) * cells[0], cells[0] - 1).astype(int)
        turn = np.arctan2(d[:, 1], d[:, 0]) / (2 * np.pi) % 1
        return ring * cells[1] + np.minimum(turn * cells[1], cells[1] - 1).astype(int)

    # Weighed, they follow the cosine: as much in each of the cells.
    where, count = cell_of(directions), cells[0] * cells[1]
    mass, square = (np.bincount(where, w, count) for w in (weight.astype(float), weight.astype(float) ** 2))
    chi2 = ((mass - rays / count) ** 2 / (square - mass**2 / rays)).sum()
    assert chi2 < count + 4.5 * math.sqrt(2 * count), chi2
    if seen == 0:
        assert np.abs(weight - 1).max() < 1e-4


def test_guided_rays_find_the_same_light_with_less_noise():
    rng, rays = np.random.default_rng(3), 100_000
    met = cosine_directions(rng, 800)
    found = native.module().guided_directions(met, cap(met), rng.random((rays, 3), dtype=np.float32))
    guided, plain = cap(found[:, :3]) * found[:, 3], cap(cosine_directions(rng, rays))
    error = math.hypot(guided.std(), plain.std()) / math.sqrt(rays)
    assert abs(guided.mean() - plain.mean()) < 4.5 * error
    assert guided.var() < 0.25 * plain.var(), (guided.var(), plain.var())


# -------------------------------------------------------------------------------------------------- pictures


def render(
    scene, seed=1, pixels=32, samples=16, integrator="irradiance_cache", threads=2, passes=("Combined",), **parameters
):
    scene.film = sd.Film(pixels, pixels, passes=list(passes))
    settings = sd.Settings(integrator, samples, seed=seed, threads=threads, parameters=parameters)
    with Session(scene, settings) as session:
        while not session.wait():
            pass
        assert session.progress()["bad_samples"] == 0
        return [session.read(name).astype(np.float64) for name in passes], session.native.figures()


def near(found, expected, bias):
    error = found.std(ddof=1) / math.sqrt(found.size)
    assert abs(found.mean() - expected) < 4.5 * error + bias * expected, f"{found.mean():.5f} instead of {expected:.5f}"


@pytest.mark.parametrize("albedo", [0.5, 0.8])
@pytest.mark.parametrize("cached_bounces", [1, 4])
def test_closed_furnace(albedo, cached_bounces):
    scene = scene_of((cube(), surface(albedo, 1.0)))
    found = probe(
        scene,
        (0.1, 0.2, -0.1),
        (0.3, 0.5, 0.8),
        integrator="irradiance_cache",
        cached_bounces=cached_bounces,
        record_samples=4096,
        **MANY,
    )
    near(found, 1 / (1 - albedo), 0.02)


@pytest.mark.parametrize("bounces", [0, 1, 2, 3, 7])
def test_integrating_sphere(bounces):
    """n bounces leave 1 - 2^-(n+1), those in the cache and those that are traced alike."""
    bulb = lamp("POINT", (4 * math.pi * math.pi,) * 3, matrix=matrix((0, 0, 0)))
    scene = scene_of((sphere(), surface(0.5)), lights=[bulb])
    limits = {"max_bounces": bounces, "diffuse_bounces": bounces}
    found = probe(scene, (0.2, 0.1, 0.0), (0.5, 0.3, 0.7), integrator="irradiance_cache", **limits)
    near(found, 1 - 0.5 ** (bounces + 1), 0.005)


def test_bowl_under_the_sky():
    scene = scene_of((sphere(top=math.pi / 2), surface(0.8)), world=1.0)
    for towards in ((0, 0, -1), (0.9, 0, -0.3)):
        found = probe(scene, (0, 0, -0.2), towards, integrator="irradiance_cache", **MANY)
        near(found, 0.8 * 0.5 / (1 - 0.8 * 0.5), 0.02)


AGREEING = ["area lamp", "point lamp", "smooth normals", "gloss", "principled", "coat", "metal", "bumpy", "translucent", "transparent shadows", "emissive mesh", "sky"]  # fmt: skip


@pytest.mark.parametrize("name", AGREEING)
def test_pictures_agree_with_path_tracing(name):
    """Blocks of the picture within 2 % of it (bumps 4 %), the picture within 1 % (2 %)."""
    seeds, blocks = 3, 4
    found = {}
    for integrator, samples in (("path", 128), ("irradiance_cache", 32)):
        images = []
        for seed in range(seeds):
            scene = SCENES[name]()
            scene.camera = camera()
            (image,), _ = render(scene, seed + 1, samples=samples, integrator=integrator)
            images.append(image[..., :3].reshape(blocks, 8, blocks, 8, 3).mean((1, 3)))
        found[integrator] = np.array(images)
    path, cache = found["path"], found["irradiance_cache"]
    error = np.sqrt((path.var(0, ddof=1) + cache.var(0, ddof=1)) / seeds)
    allowed = 2.0 if name == "bumpy" else 1.0
    difference = np.abs(path.mean(0) - cache.mean(0))
    assert abs(path.mean() - cache.mean()) < allowed * 0.01 * path.mean() + 3 * np.sqrt((error**2).sum()) / error.size
    assert (difference < allowed * 0.02 * path.mean() + 6 * error).all(), (difference / path.mean()).max()


def test_no_light_comes_through_a_thin_wall():
    """A wall without thickness on a floor, a lamp on its one side: the dark side stays dark up to the wall's foot."""
    room = cube(2.0)
    wall = quad((0, -2, -2), (0, 2, -2), (0, 2, 2), (0, -2, 2))
    bulb = lamp("POINT", (100.0,) * 3, matrix=matrix((1, 0, 0)), radius=0.1)
    scene = scene_of((room, surface(0.8)), (wall, surface(0.8)), lights=[bulb])
    scene.camera = sd.Camera("camera", "ORTHO", matrix((0, 0, 1.9)), (-1, 1, -1, 1), 0.0, 100.0)
    (image,), _ = render(scene, pixels=64)
    left, right = image[:, :31, :3], image[:, 33:, :3]
    assert right.min() > 0.5
    assert left.max() < 5e-3 * right.mean()


def test_cache_samples_show_where_records_lie():
    scene = SCENES["area lamp"]()
    scene.camera = camera()
    (_, records), figures = render(scene, pixels=64, passes=("Combined", "Cache Samples"), error=0.25, min_spacing=3)
    assert figures["cache hit rate"] > 0.98
    assert 50 < figures["cache records of the first bounce"] <= figures["cache records"]
    assert 0.2 * figures["cache records of the first bounce"] < (records > 0).sum() < 0.4 * records.size


def test_a_smaller_error_makes_more_records_and_a_truer_picture():
    def result(**parameters):
        scene = SCENES["smooth normals"]()
        scene.camera = camera()
        (image,), figures = render(scene, samples=64, **parameters)
        return image[..., :3], figures["cache records of the first bounce"]

    reference = np.mean([result(error=0.1, record_samples=2048, min_spacing=1)[0]], 0)
    coarse, few = result(error=0.8, record_samples=2048)
    fine, many = result(error=0.2, record_samples=2048)
    assert many > 1.5 * few
    assert ((fine - reference) ** 2).mean() < ((coarse - reference) ** 2).mean()


def test_blotches_fade_as_records_are_refined():
    """Between seeds, and in blocks, where noise of single pixels has no say."""

    def between_seeds(refinement):
        found = []
        for seed in range(4):
            scene = scene_of((cube(), surface(0.6)), lights=[lamp("POINT", (9.0,) * 3, matrix=matrix((0.3, 0.2, 0.5)))])
            scene.camera = sd.Camera("camera", "ORTHO", matrix((0, 0, 0)), (-0.9, 0.9, -0.9, 0.9), 0.0, 100.0)
            settings = {"record_samples": 32, "refinement": refinement}
            (image,), _ = render(scene, seed + 1, samples=128, **settings)
            found.append(image[..., 0].reshape(4, 8, 4, 8).mean((1, 3)))
        return float((np.var(found, 0, ddof=1) / np.mean(found, 0) ** 2).mean())

    once, refined = between_seeds(0.0), between_seeds(0.5)
    assert refined < 0.25 * once, (refined, once)


def between_seeds(images):
    """Relative variance of one of them, in its pixels."""
    return float((np.var(images, 0, ddof=1) / np.mean(images, 0) ** 2).mean())


def test_smoothing_takes_blotches_away_and_no_light():
    """Light that comes by way of a small bright patch: records of few rays, and their noise has a long tail."""

    def wall(seed, smoothing, integrator="irradiance_cache", samples=16):
        bulb = lamp("SPOT", (300.0,) * 3, matrix=matrix((0, 0, 0.5), (1, 0, 0), (0, -1, 0), (0, 0, -1)), spot_size=0.4)
        scene = scene_of((cube(), surface(0.5)), lights=[bulb])
        scene.camera = sd.Camera("camera", "ORTHO", matrix((0, 0, 0)), (-0.9, 0.9, -0.9, 0.9), 0.0, 100.0)
        more = {"record_samples": 64, "refinement": 0, "smoothing": smoothing} if integrator != "path" else {}
        (image,), _ = render(scene, seed, samples=samples, integrator=integrator, **more)
        return image[..., 0].reshape(8, 4, 8, 4).mean((1, 3))

    truth = np.array([wall(seed, 0, "path", 512) for seed in (8, 9)])
    rough, smooth = (np.array([wall(seed, s) for seed in range(1, 9)]) for s in (0, 3))
    middle = np.s_[:, 2:6, 2:6]  # elsewhere walls leave few neighbours
    assert between_seeds(smooth[middle]) < 0.45 * between_seeds(rough[middle])
    means = smooth.mean((1, 2))
    error = math.hypot(means.std(ddof=1) / math.sqrt(len(means)), np.ptp(truth.mean((1, 2))))
    assert abs(means.mean() - truth.mean()) < 4 * error + 0.005 * truth.mean()
    off = np.abs(smooth.mean(0) - truth.mean(0))
    assert (off < 0.03 * truth.mean() + 6 * smooth.std(0, ddof=1) / math.sqrt(len(smooth)) + np.ptp(truth, 0)).all()


def test_smoothing_goes_along_a_wall():
    """A narrow strip of floor before a wall, which is near to all of it, but as near all along."""

    def strip(seed, smoothing, integrator="irradiance_cache", samples=8):
        bulb = lamp(
            "SPOT", (300.0,) * 3, matrix=matrix((0.3, 0, 0.6), (1, 0, 0), (0, -1, 0), (0, 0, -1)), spot_size=0.5
        )
        scene = scene_of((cube(), surface(0.6)), lights=[bulb])
        scene.camera = sd.Camera("camera", "ORTHO", matrix((0, 0, 0)), (-1, 1, -1, 1), 0.0, 100.0)
        more = {"record_samples": 64, "refinement": 0, "smoothing": smoothing} if integrator != "path" else {}
        (image,), _ = render(scene, seed, samples=samples, integrator=integrator, **more)
        return image[:3, 4:28, 0].reshape(3, 6, 4).mean(2)

    truth = np.array([strip(seed, 0, "path", 2048) for seed in (8, 9)])
    rough, smooth = (np.array([strip(seed, s) for seed in range(1, 13)]) for s in (0, 3))
    assert between_seeds(smooth) < 0.45 * between_seeds(rough)
    rows = smooth.mean(2)  # at three distances from the wall
    error = np.hypot(rows.std(0, ddof=1) / math.sqrt(len(rows)), np.ptp(truth.mean(2), 0))
    assert (np.abs(rows.mean(0) - truth.mean((0, 2))) < 4 * error + 0.01 * truth.mean()).all()


def test_records_that_are_sure_are_left_as_they_are():
    """A shadow's edge in indirect light, records of many rays: smoothing must not blur what no noise hides."""

    def picture(smoothing):
        scene = SCENES["smooth normals"]()
        scene.camera = camera()
        (image,), _ = render(scene, samples=16, record_samples=8192, refinement=0, smoothing=smoothing)
        return image[..., :3]

    assert np.abs(picture(3) - picture(0)).max() < 0.02 * picture(0).mean()


def test_the_sky_is_cached_and_the_sun_is_not():
    """A room open to one side, under a sky with a small bright sun in it: the picture is path tracing's, with less grain."""

    def floor(seed, integrator="irradiance_cache", samples=16, **parameters):
        scene = image_sky(sun=3000.0)
        corners = list(itertools.product((-1, 1), repeat=3))
        for axis, side in ((0, -1), (1, -1), (1, 1), (2, -1), (2, 1)):
            a, b, c, d = (p for p in corners if p[axis] == side)
            scene.meshes.append(quad(a, b, d, c))
            scene.programs.append(surface(0.5))
            scene.instances.append(
                sd.Instance(f"wall {axis} {side}", len(scene.meshes) - 1, matrix(), [len(scene.programs) - 1])
            )
        scene.camera = sd.Camera("camera", "ORTHO", matrix((0, 0, 0)), (-0.9, 0.9, -0.9, 0.9), 0.0, 100.0)
        (image,), _ = render(scene, seed, samples=samples, integrator=integrator, **parameters)
        return image[..., 0]

    path = np.array([floor(seed, "path", 512) for seed in range(1, 5)])
    cached, sampled = (np.array([floor(seed, cached_sky=limit) for seed in range(1, 5)]) for limit in (4.0, 0.0))
    assert between_seeds(cached) < 0.5 * between_seeds(sampled)
    for found in (cached, sampled):
        means = found.mean((1, 2))
        error = math.hypot(means.std(ddof=1), path.mean((1, 2)).std(ddof=1)) / 2
        assert abs(means.mean() - path.mean()) < 4 * error + 0.01 * path.mean()
    blocks = [a.reshape(4, 8, 4, 8, 4).mean((2, 4)) for a in (cached, path)]
    error = np.sqrt(sum(b.var(0, ddof=1) / len(b) for b in blocks))
    assert (np.abs(blocks[0].mean(0) - blocks[1].mean(0)) < 0.03 * path.mean() + 6 * error).all()


def test_caustics_leave_grain_and_no_spots():
    """What a mirror ball throws of a small lamp on a wall: the same light, whether records know all of it or what is not too bright.
    One diffuse bounce: records of deeper ones know all of it, and the rarest of what they find is no matter of this."""

    def wall(seed, integrator="irradiance_cache", samples=64, **parameters):
        light = lamp("AREA", (200.0,) * 3, matrix=matrix((0.3, 0.2, 0.7)), size=(0.1, 0.1))
        scene = scene_of((cube(), surface(0.5)), (sphere(0.3), shiny(0.0)), lights=[light])
        scene.camera = sd.Camera("camera", "ORTHO", matrix((0, 0, -0.5)), (-0.9, 0.9, -0.9, 0.9), 0.0, 100.0)
        (image,), _ = render(scene, seed, samples=samples, integrator=integrator, diffuse_bounces=1, **parameters)
        return image[..., 0]

    truth = np.mean([wall(seed, "bdpt", 512) for seed in (8, 9)], 0)
    spots = {}
    for limit in (10.0, 1e9):
        found = np.array([wall(seed, cached_caustics=limit, refinement=0, smoothing=0) for seed in range(1, 13)])
        means = found.mean((1, 2))
        assert abs(means.mean() - truth.mean()) < 4 * means.std(ddof=1) / math.sqrt(len(means)) + 0.01 * truth.mean()
        spots[limit] = np.mean(found > 1.25 * truth)
    assert spots[10.0] < 0.4 * spots[1e9], spots


def test_branches_take_noise_away_where_light_is_not_cached():
    """On a metal sheet, seen from so near that nothing changes within a pixel."""
    sheet = quad((-0.4, -0.4, 0), (0.4, -0.4, 0), (0.4, 0.4, 0), (-0.4, 0.4, 0))

    def metal(seed, branches):
        light = lamp("POINT", (20.0,) * 3, matrix=matrix((0.5, 0.4, 0.6)))
        scene = scene_of((cube(), surface(0.5)), (sheet, shiny(0.6)), lights=[light])
        scene.camera = sd.Camera("camera", "ORTHO", matrix((0, 0, 0.9)), (-0.2, 0.2, -0.2, 0.2), 0.0, 100.0)
        (image,), _ = render(scene, seed, samples=4, branches=branches, refinement=0)
        return image[..., :3]

    one, four = (np.array([metal(seed, branches) for seed in range(1, 13)]) for branches in (1, 4))
    assert between_seeds(four) < 0.25 * between_seeds(one), (between_seeds(four), between_seeds(one))
    spread = np.hypot(*(images.mean((1, 2, 3)).std(ddof=1) / math.sqrt(len(images)) for images in (one, four)))
    assert abs(four.mean() - one.mean()) < 3.5 * spread


def test_cancel_ends_the_overture():
    scene = SCENES["area lamp"]()
    scene.camera = camera()
    scene.film = sd.Film(256, 256)
    settings = sd.Settings("irradiance_cache", 4, parameters={"record_samples": 16384, "error": 0.05})
    with Session(scene, settings) as session:
        time.sleep(0.3)
        assert session.progress()["passes"] == 0
        assert session.progress()["stage"].startswith("irradiance cache, bounce ")
        start = time.perf_counter()
        session.native.cancel()
        while not session.wait():
            pass
        assert time.perf_counter() - start < 0.5
