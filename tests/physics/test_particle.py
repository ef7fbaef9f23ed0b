"""Particle tracing: where its power goes, and what its texels hold, against closed forms and path tracing."""

import numpy as np
import pytest
from light_scenes import lamp, matrix
from test_closed_forms import BOUNCES, cube, glass, looking, quad, scene_of, shiny, sphere, surface

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
