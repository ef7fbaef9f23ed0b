"""Particle tracing: where its power goes, and what its texels hold, against closed forms and path tracing."""

import math

import numpy as np
import pytest
from agreement_scenes import clear_glass, program, rough_glass
from light_scenes import lamp, matrix
from test_closed_forms import BOUNCES, cube, glass, looking, mesh, probe, quad, scene_of, shiny, sphere, surface

from gi_engine import scene_data as sd
from gi_engine.session import Session


def shoot(scene, position, direction, samples=16, pixels=16, width=1e-4, seed=1, threads=2, **parameters):
    """First channel of the picture, and what the integrator measured."""
    half = width / 2
    scene.camera = sd.Camera("camera", "ORTHO", looking(position, direction), (-half, half, -half, half), 0.0, 1e6)
    scene.film = sd.Film(pixels, pixels, filter="BOX", filter_width=1.0)
    settings = sd.Settings("particle", samples, seed=seed, threads=threads, parameters={**BOUNCES, **parameters})
    with Session(scene, settings) as session:
        while not session.wait():
            pass
        return session.read("Combined")[..., 0].astype(np.float64), session.native.figures()


SCENES = {
    "closed box": lambda: scene_of((cube(), surface(0.8, 1.0))),
    "open plates": lambda: scene_of(
        (quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)), surface(0.5, 1.0)),
        (quad((-1, -1, 1), (-1, 1, 1), (1, 1, 1), (1, -1, 1)), surface(0.8)),
    ),
    "mirror and glass": lambda: scene_of(
        (cube(3.0), surface(0.6)),
        (sphere(0.5, 32), glass()),
        (quad((-2, -2, -1), (2, -2, -1), (2, 2, -1), (-2, 2, -1)), shiny(0.0)),
        lights=[lamp("POINT", (30.0,) * 3, matrix=matrix((0, 0, 2)), radius=0.1)],
    ),
    "sun and sky": lambda: scene_of((cube(), surface(0.7)), lights=[lamp("SUN", (3.0,) * 3, angle=0.1)], world=0.3),
}


@pytest.mark.parametrize("name", SCENES)
def test_no_power_is_lost(name):
    """Emitted = absorbed + escaped, to the rounding of single precision."""
    _, found = shoot(SCENES[name](), (0, 0, 0.5), (0, 0, -1), samples=2, pixels=1, particles=20000)
    assert found["emitted power"] > 0
    assert found["created power"] == pytest.approx(0, abs=1e-4 * found["emitted power"])
    spent = found["absorbed power"] + found["escaped power"] - found["created power"]
    assert spent == pytest.approx(found["emitted power"], rel=1e-5)


def repeated(runs, scene, *where, **parameters):
    """Means of independent runs: the pixels of one run share their texels."""
    found = np.array([shoot(scene, *where, seed=k + 1, **parameters)[0].mean() for k in range(runs)])
    return found.mean(), found.std(ddof=1) / math.sqrt(runs)


WAYS = [{"direct": "RAYS"}, {"direct": "TEXELS"}, {"direct": "RAYS", "gather": True}]


@pytest.mark.parametrize("way", WAYS, ids=lambda w: "-".join(map(str, w.values())))
def test_integrating_sphere(way):
    """A point of light in a sphere of albedo .5: mean irradiance power / (surface (1 - albedo)), here the same everywhere."""
    scene = scene_of(
        (sphere(rings=32), surface(0.5)), lights=[lamp("POINT", (4 * math.pi**2,) * 3, matrix=matrix((0, 0, 0)))]
    )
    mean, error = repeated(16, scene, (0.2, 0.1, 0), (0.5, 0.3, 0.7), samples=8, particles=20000, texel_size=0.3, **way)
    assert error < 0.02
    assert abs(mean - 1) < 4 * error + 0.01  # 32 rings have half a percent less surface


@pytest.mark.parametrize("way", WAYS, ids=lambda w: "-".join(map(str, w.values())))
def test_two_squares(way):
    """Unit squares face to face, 1 m apart, emittance 1 below, albedos .5 and .8: radiosity in the middles."""
    low = quad((-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0))
    high = quad((-0.5, -0.5, 1), (-0.5, 0.5, 1), (0.5, 0.5, 1), (0.5, -0.5, 1))
    scene = scene_of((low, surface(0.5, 1 / math.pi)), (high, surface(0.8)))
    for direction, truth in (((0, 0, -1), 1.0198462), ((0, 0, 1), 0.1947815)):
        mean, error = repeated(8, scene, (0, 0, 0.5), direction, samples=8, particles=20000, texel_size=0.1, **way)
        assert abs(math.pi * mean - truth) < 4 * math.pi * error + 0.005 * truth
        assert math.pi * error < 0.02 * truth


@pytest.mark.parametrize("fill", [clear_glass, rough_glass])
def test_what_lies_in_glass_is_path_tracing_s(fill):
    """A grey disc in a ball of glass under an even sky: there light is denser than paths from the eye know of."""

    def scene():
        disc = quad((-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0))
        return scene_of((sphere(rings=32), program(fill)), (disc, surface(0.5)), world=1.0)

    where = ((0, 0, 0.1), (0, 0, -1))
    truth = np.array([probe(scene(), *where, samples=64, seed=k).mean() for k in range(4)])
    mean, error = repeated(8, scene(), *where, samples=4, particles=40000, texel_size=0.2)
    assert error < 0.01 * truth.mean()
    assert abs(mean - truth.mean()) < 4 * math.hypot(error, truth.std(ddof=1) / 2) + 0.005 * truth.mean(), (
        mean,
        error,
        truth,
    )


def room():
    """A box of light grey with a darker one on its floor and a lamp below the ceiling; all diffuse."""
    block = cube(0.3)
    block.positions[:, 2] -= 0.7
    lamps = [lamp("AREA", (10.0,) * 3, matrix=matrix((0.3, 0.2, 0.95)), size=(0.4, 0.3))]
    return scene_of((cube(), surface(0.7)), (block, surface(0.4)), lights=lamps)


def blocks(image):
    return image.reshape(4, 8, 4, 8).mean((1, 3))


@pytest.fixture(scope="module")
def traced():
    """The room's floor by path tracing: blocks and their errors."""
    scene, half = room(), 0.9
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 0.9), (0, 0, -1)), (-half, half, -half, half), 0.0, 1e6)
    scene.film = sd.Film(32, 32, filter="BOX", filter_width=1.0)
    found = []
    for seed in range(4):
        with Session(scene, sd.Settings("path", 256, seed=100 + seed, parameters=BOUNCES)) as session:
            while not session.wait():
                pass
            found.append(blocks(session.read("Combined")[..., 0].astype(np.float64)))
    return np.mean(found, 0), np.std(found, 0, ddof=1) / 2


# Largest relative error of a block that texels of this size may make: measured, twice as much allowed.
BIAS = [
    ("RAYS", 0.05, False, 0.004),
    ("RAYS", 0.2, False, 0.03),
    ("RAYS", 0.2, True, 0.008),
    ("TEXELS", 0.05, False, 0.02),
    ("TEXELS", 0.2, False, 0.2),
]


@pytest.mark.parametrize(("direct", "size", "gather", "bias"), BIAS)
def test_a_diffuse_room_is_path_tracing_s(traced, direct, size, gather, bias):
    """Block by block; the floor goes on under the box, whose foot must be neither dark nor bright for it."""
    truth, error = traced
    way = {"direct": direct, "texel_size": size, "gather": gather}
    runs = [blocks(shoot(room(), (0, 0, 0.9), (0, 0, -1), 6, 32, 1.8, k, particles=60000, **way)[0]) for k in range(4)]
    mean, noise = np.mean(runs, 0), np.std(runs, 0, ddof=1) / 2
    both = np.sqrt((error**2).mean() + (noise**2).mean())  # of few runs: pooled
    assert both < 0.01 * truth.mean()
    assert (np.abs(mean - truth) < 4 * both + bias * truth).all(), (mean / truth).round(3)


def picture(scene, size, **parameters):
    return shoot(scene, (0, 0, 0.9), (0, 0, -1), 8, size, 1.8, particles=200000, **parameters)[0]


@pytest.mark.parametrize(("n", "foot"), [(7, 0.03), (8, 0.0), (8, 1e-3), (16, 0.25)])
def test_no_seams_and_no_leaks(n, foot):
    """One floor of many triangles, a wall of no thickness across it, light on one side: as one floor of two triangles, and dark
    behind the wall, wherever its foot crosses the texels or stands on their rows."""
    wall = quad((foot, -1, 0), (foot, 1, 0), (foot, 1, 1), (foot, -1, 1))
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    corners = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    faces = [(k, k + 1, k + n + 2, k + n + 1) for k in (i * (n + 1) + j for i in range(n) for j in range(n))]
    whole = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    beam = lamp("AREA", (30.0,) * 3, matrix=matrix((-0.5, 0, 0.5)), size=(0.1, 0.1))
    found = []
    for floor in (mesh(corners, faces), whole):
        scene = scene_of((floor, surface(0.8)), (wall, surface(0.0)), lights=[beam])
        found.append(picture(scene, 36, direct="TEXELS", texel_size=0.15))
    pixels = int((foot + 0.9) / 0.05 + 1e-3)  # up to the wall
    for image in found:
        assert (image[:, :pixels] > 0).all()
        assert image[:, pixels + 2 :].max() < 1e-3 * image.max()
    ratio = found[0][:, : pixels - 1] / found[1][:, : pixels - 1]
    assert abs(ratio.mean() - 1) < 0.02
    assert ratio.std() < 0.1


@pytest.mark.parametrize("size", [0.02, 0.5])
def test_fine_meshes_are_merged_and_coarse_ones_divided(size):
    """The same ball, its triangles much smaller and larger than the texels: light of a sky is even on either."""
    ball = scene_of((sphere(1.0, 48), surface(0.5)), world=1.0)
    mean, error = repeated(
        6, ball, (0.3, 0.2, 3), (0, 0, -1), samples=8, direct="TEXELS", particles=100000, texel_size=size
    )
    assert abs(mean - 0.5) < 4 * error + 0.005
    assert error < (0.05 if size < 0.1 else 0.01)


def test_memory_bounds_the_texels():
    scene = room()
    scene.film = sd.Film(4, 4)
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 0.9), (0, 0, -1)), (-1, 1, -1, 1), 0.0, 1e6)
    told = []
    for megabytes in (1, 1000):
        with Session(
            scene, sd.Settings("particle", 1, parameters={"texel_size": 0.004, "texel_memory": megabytes})
        ) as session:
            while not session.wait():
                pass
            told.append(session.native.messages()[0])
    sizes = [float(text.split("about ")[1].split(" m")[0]) for text in told]
    assert sizes[1] == pytest.approx(0.004)
    assert sizes[0] > 2 * sizes[1]


def test_luminaires_that_send_nothing_are_named():
    scene = room()
    scene.programs[1] = surface(0.4, 2.0, name="Embers")
    scene.programs[1].emission_sampling = "NONE"
    scene.programs.append(surface(glow=1.0, name="Sky"))
    scene.world = sd.World(program=len(scene.programs) - 1, sampling="NONE")
    scene.film = sd.Film(4, 4)
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 0.9), (0, 0, -1)), (-1, 1, -1, 1), 0.0, 1e6)
    with Session(scene, sd.Settings("particle", 1, parameters={"particles": 100})) as session:
        while not session.wait():
            pass
        assert any(m.endswith(": material 'Embers', the world") for m in session.native.messages())
