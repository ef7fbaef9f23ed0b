"""Where particles are aimed: guided numbers follow the density that is told, which rules nothing out and leads to what is worth it; and
a room that gets its light through a window."""

import math

import numpy as np
import pytest
from light_scenes import lamp, matrix
from scipy import stats
from test_closed_forms import BOUNCES, looking, mesh, quad, scene_of, surface

from gi_engine import native
from gi_engine import scene_data as sd
from gi_engine.session import Session

N, AXES = 100_000, 5
SIGNIFICANCE = 1e-4


def window(u):
    """Worth something in a small box alone, as through a window; the last axes do not matter."""
    low, high = np.array([0.4, 0.7, 0.1]), np.array([0.6, 0.8, 0.3])
    return ((u[:, :3] > low) & (u[:, :3] < high)).all(1).astype(np.float32)


WORTHS = {
    "window": window,
    "smooth": lambda u: (u[:, 0] * np.sin(math.pi * u[:, 3]) ** 2).astype(np.float32),
    "one particle": lambda u: (np.arange(len(u)) == 7).astype(np.float32),
    "rare and strong": lambda u: np.where(u[:, 4] < 1e-3, 1000, u[:, 2] > 0.9).astype(np.float32),
    "nothing": lambda u: np.zeros(len(u), np.float32),
}


def taught(name):
    u = np.random.default_rng(1).random((N, AXES), np.float32)
    return native.module().TestGuide(u, WORTHS[name](u))


@pytest.mark.parametrize("name", WORTHS)
def test_guided_numbers_follow_their_density(name):
    guide = taught(name)
    u = np.random.default_rng(2).random((N, AXES), np.float32)
    table = guide.warp(u)
    found, pdf = table[:, :AXES], table[:, AXES].astype(float)
    assert (found >= 0).all()
    assert (found < 1).all()
    assert pdf.min() >= 0.99 * native.module().TestGuide.even
    # Each weighed by 1/density they are even again: in cells of any two axes.
    for a in range(AXES):
        b, n = (a + 1) % AXES, 8
        cell = (found[:, a] * n).astype(int) * n + (found[:, b] * n).astype(int)
        share, squares = np.bincount(cell, 1 / pdf, n * n) / N, np.bincount(cell, pdf**-2, n * n) / N
        z = (share - 1 / n**2) / np.sqrt(np.maximum(squares - share**2, 1e-12) / N)
        assert 2 * stats.norm.sf(np.abs(z).max()) > SIGNIFICANCE / (n * n * AXES * len(WORTHS)), (name, a)


def test_most_go_where_something_is_to_be_had():
    u = np.random.default_rng(3).random((N, AXES), np.float32)
    assert window(u).mean() < 0.005
    assert window(taught("window").warp(u)[:, :AXES]).mean() > 0.1
    np.testing.assert_array_equal(taught("nothing").warp(u)[:, :AXES], u)


# ------------------------------------------------------------------------------------------------ a room with a window


def wall_with_window(y, half, height, x, z):
    """Of the given half width, with a hole from x[0] to x[1] and z[0] to z[1]."""
    outer = [(-half, y, 0), (half, y, 0), (half, y, height), (-half, y, height)]
    hole = [(x[0], y, z[0]), (x[1], y, z[0]), (x[1], y, z[1]), (x[0], y, z[1])]
    return mesh(outer + hole, [(k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4) for k in range(4)])


def windowed_room(sun, sky, field=10.0):
    """4 m × 4 m × 3 m, a window of a square metre, on a field of the given half width."""
    h, t, f = 2.0, 3.0, field
    parts = [
        (quad((-f, -f, -0.1), (f, -f, -0.1), (f, f, -0.1), (-f, f, -0.1)), surface(0.3)),
        (quad((-h, -h, 0), (h, -h, 0), (h, h, 0), (-h, h, 0)), surface(0.6)),
        (quad((-h, -h, t), (-h, h, t), (h, h, t), (h, -h, t)), surface(0.8)),
        (quad((-h, -h, 0), (-h, h, 0), (-h, h, t), (-h, -h, t)), surface(0.7)),
        (quad((h, -h, 0), (h, -h, t), (h, h, t), (h, h, 0)), surface(0.5)),
        (quad((-h, -h, 0), (-h, -h, t), (h, -h, t), (h, -h, 0)), surface(0.7)),
        (wall_with_window(h, h, t, (-0.5, 0.5), (1, 2)), surface(0.7)),
    ]
    z = np.array((0.3, 1, 0.9)) / np.linalg.norm((0.3, 1, 0.9))
    x = np.cross((0, 0, 1), z) / np.linalg.norm(np.cross((0, 0, 1), z))
    lights = [lamp("SUN", (5.0,) * 3, matrix=matrix((0, 0, 0), x, np.cross(z, x), z), angle=0.01)]
    return scene_of(*parts, lights=lights if sun else [], world=1.0 if sky else None)


RUNS = 8


def seen(scene, integrator, samples, **parameters):
    """(RUNS, blocks): relative to the mean of the picture nothing is."""
    scene.camera = sd.Camera(
        "camera", "PERSP", looking((0, 1.8, 1.5), (0.2, -1, -0.35)), (-0.8, 0.8, -0.8, 0.8), 0.01, 1e6
    )
    scene.film = sd.Film(24, 24, filter="BOX", filter_width=1.0)
    found = []
    for seed in range(RUNS):
        settings = sd.Settings(
            integrator, samples, seed=seed + 1, threads=2, parameters={**dict.fromkeys(BOUNCES, 6), **parameters}
        )
        with Session(scene, settings) as session:
            while not session.wait():
                pass
            picture = session.read("Combined")[..., 0].astype(np.float64)
        found.append(picture.reshape(4, 6, 4, 6).mean((1, 3)).ravel())
    return np.array(found)


@pytest.mark.parametrize(("sun", "sky", "particles", "gain"), [(True, False, 80_000, 4.0), (False, True, 160_000, 1.1)])
def test_light_through_a_window(sun, sky, particles, gain):
    """The same mean as path tracing has, of particles that are aimed and of some that are not; less variance when they are. Particles of a
    sky come from so many places and sides that a few passes show little of it."""
    scene, way = windowed_room(sun, sky), {"texel_size": 0.1, "particles": particles}
    aimed, even = (seen(scene, "particle", 4, aim=aim, **way) for aim in (1, 0))
    truth = seen(scene, "path", 128)
    for found in (aimed, even):
        error = np.sqrt((found.var(0, ddof=1).mean() + truth.var(0, ddof=1).mean()) / RUNS)
        assert abs(found.mean() - truth.mean()) < 4 * error / math.sqrt(4) + 0.005 * truth.mean()
        assert (np.abs(found.mean(0) - truth.mean(0)) < 5 * error + 0.02 * truth.mean(0)).all()
    relative = [(found.var(0, ddof=1) / truth.mean(0) ** 2).mean() for found in (aimed, even)]
    assert relative[0] < relative[1] / gain, relative


def test_the_way_is_found_where_next_to_no_particle_comes_to_what_is_seen():
    """Of a sun over a field of 100 m, one particle in tens of thousands enters by the window: aiming by what is read alone has hardly
    anything to start from, and eleven times this variance."""
    scene, way = windowed_room(True, False, field=50.0), {"texel_size": 0.1, "particles": 100_000}
    found, truth = seen(scene, "particle", 2, aim=1, **way), seen(scene, "path", 128)
    assert (found.var(0, ddof=1) / truth.mean(0) ** 2).mean() < 1.5
    error = np.sqrt((found.var(0, ddof=1).mean() + truth.var(0, ddof=1).mean()) / RUNS)
    assert abs(found.mean() - truth.mean()) < 4 * error / math.sqrt(4) + 0.005 * truth.mean()
