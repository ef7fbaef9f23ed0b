"""Ray portals: what is seen through them, the light that comes through them, and that none passes them straight but what a transparent part lets pass."""

import numpy as np
import pytest
from agreement_scenes import ball, program, wide
from light_scenes import lamp, matrix
from test_agreement import SEEDS, assert_agree, render
from test_closed_forms import BOUNCES, check, cube, looking, probe, quad, scene_of, surface

from gi_engine import native
from gi_engine import scene_data as sd

ALL = [d["id"] for d in native.integrators()]
CARRYING = [d["id"] for d in native.integrators() if "portals" in d["carries"]]
DEEP = [i for i in CARRYING if i not in ("whitted", "distributed")]  # those with light between diffuse surfaces


def portal(beside=(0, 0, 0), direction=(0, 0, 0), color=(1, 1, 1), transparent=0.0, diffuse=0.0):
    """Leads `beside` the place that is met; the rest of a white surface is transparent or diffuse."""

    def fill(b):
        place = b.op("vector_add", b.op("position"), beside)
        b.op("ray_portal", 1.0 - transparent - diffuse, color, place, direction, imm=(any(beside),))
        if transparent:
            b.op("transparent", transparent, (1, 1, 1))
        if diffuse:
            b.op("diffuse", diffuse, (1, 1, 1), 0.0, (0, 0, 0))

    return program(fill, "portal")


def facing_up(z, half=1.0):
    return quad((-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z))


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize(
    ("look", "seen"),
    [
        (portal((0, 0, 10), color=(0.25, 0.5, 1.0)), 0.25 * 3.0),  # above the lower light, below the upper
        (portal(), 2.0),
        (portal(direction=(0, 0, 2)), 3.0),
        (portal((0, 0, 10), transparent=0.4), 0.6 * 3.0 + 0.4 * 2.0),
    ],
)
def test_shows_what_lies_where_it_leads(integrator, look, seen):
    """A camera looks down on a portal between two lights, of 2 below it and of 3 high above; the way through ends below or above."""
    lower, upper = facing_up(-5.0), quad(*((x, y, 8.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))))
    scene = scene_of((facing_up(0.0), look), (lower, surface(0.0, 2.0)), (upper, surface(0.0, 3.0)))
    image = probe(scene, (0, 0, 2), (0, 0, -1), samples=16, pixels=8, integrator=integrator)
    error = image.std(ddof=1) / 8 + 1e-5
    assert abs(image.mean() - seen) < 5 * error


@pytest.mark.parametrize("integrator", DEEP)
@pytest.mark.parametrize("look", [portal((20, 0, 0)), portal((20, 0, 0), transparent=0.3, diffuse=0.2)])
def test_two_furnaces_joined(integrator, look):
    """A box with a portal in the middle that leads into another one, both aglow: radiance 2 everywhere, however it comes."""
    scene = scene_of((cube(), surface(0.5, 1.0)), (cube(), surface(0.5, 1.0)), (facing_up(0.1, 0.5), look))
    scene.instances[1].matrix = matrix((20, 0, 0))
    limits = BOUNCES | {"transparent_bounces": 200}
    known = {p["name"] for d in native.integrators() if d["id"] == integrator for p in d["parameters"]}
    few = {k: v for k, v in limits.items() if k in known}
    image = probe(
        scene, (0.6, 0.2, -0.5), (0.1, 0.3, -1), samples=64, pixels=16, width=0.3, integrator=integrator, **few
    )
    check(image, 2.0, rounding=5e-3)


def test_no_light_passes_straight():
    """A lamp above a portal, a floor below it: the floor is lit by what is transparent."""
    bulb = lamp("POINT", (50.0,) * 3, matrix=matrix((0, 0, 2.0)))

    def seen(look, integrator):
        scene = scene_of((facing_up(-1.0, 0.9), surface(0.8)), (facing_up(0.0, 5.0), look), lights=[bulb])
        return probe(scene, (0, 0, -0.5), (0, 0.2, -1), samples=64, pixels=8, width=0.1, integrator=integrator).mean()

    assert seen(portal((0, 0, 30)), "light") == 0.0
    for integrator in ("path", "bdpt"):
        assert seen(portal((0, 0, 30)), integrator) == 0.0
        half, all_of_it = (seen(portal((0, 0, 30), transparent=share), integrator) for share in (0.5, 1.0))
        assert half == pytest.approx(0.5 * all_of_it, rel=0.01)
        assert half > 0.0


def shaft():
    """A room lit by a lamp, and through a portal in it by a glowing floor far away."""
    scene = ball(surface(0.5), wide())
    for part, look in (
        (quad((-0.7, -0.2, 0.3), (0.2, -0.2, 0.3), (0.2, 0.7, 0.5), (-0.7, 0.7, 0.5)), portal((0, 0, 50), (0, 0, -1))),
        (facing_up(49.0, 3.0), surface(0.3, 2.0)),
    ):
        scene.meshes.append(part)
        scene.programs.append(look)
        scene.instances.append(sd.Instance(look.name, len(scene.meshes) - 1, matrix(), [len(scene.programs) - 1]))
    scene.camera = sd.Camera(
        "camera", "PERSP", looking((1.3, -3.0, 1.2), (-1.2, 3.0, -1.4)), (-0.6, 0.6, -0.6, 0.6), 0.1, 100.0
    )
    return scene


@pytest.mark.parametrize("integrator", ["bdpt", "vcm"])
def test_light_through_portals_agrees_with_path_tracing(integrator):
    def blocks(name, samples):
        images = np.array([render(shaft(), name, samples, seed + 1) for seed in range(SEEDS)])
        return images.reshape(SEEDS, 4, 8, 4, 8, 3).mean((2, 4)).reshape(SEEDS, -1)

    assert_agree(blocks("path", 32), blocks(integrator, 12))
