"""Volumes by closed forms: what passes, glows and is scattered where density changes from place to place, in objects and in the world.

Probes as in test_closed_forms. Where something varies it is tracked, which may not depend on how well the bounds of it are known."""

import math

import numpy as np
import pytest
from light_scenes import emission, lamp, matrix
from test_closed_forms import check, cube, looking, probe, quad, scene_of, surface

from gi_engine import native
from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder
from gi_engine.session import Session

BOUNCES = {f"{kind}_bounces": 1000 for kind in ("max", "volume", "transparent")}
INTEGRATORS = [d["id"] for d in native.integrators()]


def medium(absorbs=None, scatters=None, glows=None, g=0.0, name="volume"):
    """Each: three numbers per metre, or a function that emits the ops of a vector."""
    b = ProgramBuilder()
    values = [value(b) if callable(value) else value or (0.0, 0.0, 0.0) for value in (absorbs, scatters, glows)]
    b.op("volume_coefficients", 1.0, *values, g, 0.0, imm=(0,))
    return b.finish(name)


def nothing(name="material"):
    """A surface that is not there."""
    b = ProgramBuilder()
    b.op("transparent", 1.0, (1, 1, 1))
    program = b.finish(name)
    program.only_volume = True
    return program


def fill(scene, program, volume):
    """Puts `volume` behind `program`."""
    program.volume = len(scene.programs)
    scene.programs.append(volume)
    return scene


def filled(volume, *others, item=None, world=None):
    outside = nothing()
    return fill(scene_of((item or cube(), outside), *others, world=world), outside, volume)


def filled_world(volume, *parts, glow=0.0):
    scene = scene_of(*parts, world=glow)
    return fill(scene, scene.programs[scene.world.program], volume)


def by_height(*scales, falloff=1.0):
    """scales · exp(-falloff z)"""

    def value(b):
        z = b.component(b.op("position"), 2)
        return b.op("vector_scale", scales, b.op("math_exponent", b.op("math_multiply", z, -falloff)))

    return value


def waves(scale, per_metre):
    """scale · (1 + cos(2π per_metre x + π)), in all channels"""

    def value(b):
        x = b.component(b.op("position"), 0)
        wave = b.op("math_cosine", b.op("math_multiply_add", x, 2 * math.pi * per_metre, math.pi))
        return b.op("vector_scale", (scale,) * 3, b.op("math_add", wave, 1.0))

    return value


def seen(scene, position, direction, channel=0, samples=64, **parameters):
    return probe(scene, position, direction, samples, **{**BOUNCES, **parameters})


# -------------------------------------------------------------------------------------------------- what passes


@pytest.mark.parametrize("falloff", [0.5, 3.0])
def test_absorption_that_falls_off_with_height(falloff):
    scene = filled(medium(by_height(0.3, 0.3, 0.3, falloff=falloff)), world=1.0)
    depth = 0.3 * 2 * math.sinh(falloff) / falloff
    check(seen(scene, (0.1, 0.2, 3), (0, 0, -1)), math.exp(-depth), 5e-3)


def test_seen_from_within():
    """Half of the way only."""
    scene = filled(medium(by_height(0.5, 0.5, 0.5)), world=1.0)
    check(seen(scene, (0, 0, 0), (0, 0, 1)), math.exp(-0.5 * (1 - math.exp(-1))), 5e-3)


def test_thin_layers_that_the_bounds_may_miss():
    """32 layers to a metre, while the bounds are of cells of a sixteenth of a metre."""
    scene = filled(medium(waves(0.7, 32)), world=1.0)
    check(seen(scene, (-3, 0.1, 0.2), (1, 0, 0), samples=256), math.exp(-1.4), 5e-3)


@pytest.mark.parametrize("half", [0.01, 0.4])
def test_a_slab_with_sharp_borders(half):
    """Thinner than the cells that bounds are of, or not."""

    def slab(b):
        x = b.op("math_absolute", b.component(b.op("position"), 0))
        return b.op("vector_scale", (0.7 / half,) * 3, b.op("math_less_than", x, half))

    check(seen(filled(medium(slab), world=1.0), (-3, 0.1, 0.2), (1, 0, 0)), math.exp(-1.4), 5e-3)


@pytest.mark.parametrize("density", [by_height(0.5, 0.2, 1.0), (0.5, 0.2, 1.0)], ids=["varying", "even"])
def test_every_channel_has_its_own_density(density):
    """With the same random numbers for all."""
    scene = filled(medium(density), world=1.0)
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 3), (0, 0, -1)), (-1e-4, 1e-4, -1e-4, 1e-4), 0.0, 1e6)
    scene.film = sd.Film(32, 32, filter="BOX", filter_width=1.0)
    depth = np.array((0.5, 0.2, 1.0)) * (2 * math.sinh(1) if callable(density) else 2.0)
    with Session(scene, sd.Settings("path", 64, threads=2, parameters=BOUNCES)) as session:
        while not session.wait():
            pass
        image = session.read("Combined").astype(np.float64)
    for c in range(3):
        check(image[..., c], math.exp(-depth[c]), 5e-3)


def test_overlapping_volumes_add_up():
    """One varies and one does not, the second within the first."""
    scene = filled(medium(by_height(0.3, 0.3, 0.3)), world=1.0)
    inner = nothing("inner")
    scene.meshes.append(cube(0.5))
    scene.programs.append(inner)
    scene.instances.append(sd.Instance("inner", len(scene.meshes) - 1, matrix(), [len(scene.programs) - 1]))
    fill(scene, inner, medium((0.7, 0.7, 0.7)))
    check(seen(scene, (0.1, 0.2, 3), (0, 0, -1)), math.exp(-0.3 * 2 * math.sinh(1) - 0.7), 5e-3)


def test_turned_and_stretched_objects():
    scene = filled(medium(by_height(0.3, 0.3, 0.3)), world=1.0)
    c, s = math.cos(0.6), math.sin(0.6)
    scene.instances[0].matrix = matrix((0, 0, 0), (2 * c, 2 * s, 0), (-s, c, 0), (0, 0, 0.5))
    check(seen(scene, (0.1, 0.2, 3), (0, 0, -1)), math.exp(-0.3 * 2 * math.sinh(0.5)), 5e-3)


# -------------------------------------------------------------------------------------------------- what glows


def test_emission_that_varies_where_nothing_is_absorbed():
    scene = filled(medium(glows=by_height(0.4, 0.4, 0.4)))
    check(seen(scene, (0, 0, 3), (0, 0, -1)), 0.4 * 2 * math.sinh(1), 5e-3)


def test_emission_seen_through_what_absorbs():
    """∫ ε exp(-∫σ) with ε = 0.4 σ, which is 0.4 (1 - exp(-depth))."""
    scene = filled(medium(by_height(0.5, 0.5, 0.5), None, by_height(0.2, 0.2, 0.2)))
    check(seen(scene, (0, 0, 3), (0, 0, -1)), 0.4 * (1 - math.exp(-0.5 * 2 * math.sinh(1))), 5e-3)


# -------------------------------------------------------------------------------------------------- what is scattered


@pytest.mark.parametrize("g", [0.0, 0.7])
@pytest.mark.parametrize(
    "density", [by_height(1.0, 0.5, 0.2), waves(1.0, 2.3), (1.0, 0.5, 0.2)], ids=["height", "waves", "even"]
)
def test_furnace(density, g):
    """Of albedo 1, under a sky of 1, is not seen."""
    scene = filled(medium(None, density, g=g), world=1.0)
    check(seen(scene, (0.1, 0.2, 3), (0, 0.1, -1), samples=32), 1.0, 5e-3)


# -------------------------------------------------------------------------------------------------- the world


def wall(z, glow=1.0):
    return quad((-3, -3, z), (3, -3, z), (3, 3, z), (-3, 3, z)), surface(0.0, glow)


def test_an_even_world():
    scene = filled_world(medium((0.3, 0.3, 0.3)), wall(-2))
    check(seen(scene, (0, 0, 0), (0, 0, -1)), math.exp(-0.6))


def test_a_world_that_thins_out_with_height():
    scene = filled_world(medium(by_height(0.3, 0.3, 0.3)), wall(-2))
    check(seen(scene, (0, 0, 1), (0, 0, -1)), math.exp(-0.3 * (math.exp(2) - math.exp(-1))), 5e-3)


def test_the_sky_through_a_world_that_thins_out():
    """To infinity, and through what fills an object on the way."""
    scene = filled_world(medium(by_height(0.3, 0.3, 0.3)), wall(-2), glow=1.0)
    check(seen(scene, (0, 0, 0), (0, 0, 1)), math.exp(-0.3), 5e-3)


def test_furnace_of_a_world_that_thins_out():
    def both_ways(b):
        z = b.op("math_absolute", b.component(b.op("position"), 2))
        return b.op("vector_scale", (0.3, 0.1, 0.5), b.op("math_exponent", b.op("math_multiply", z, -1.0)))

    scene = filled_world(medium(None, both_ways), glow=1.0)
    check(seen(scene, (0, 0, 0), (0.2, 0, 1), samples=32), 1.0, 5e-3)


@pytest.mark.parametrize("glow", [0.0, 0.2])
def test_rays_that_would_take_too_long_go_on_in_even_steps(glow):
    """Beside what is so thick that its bounds ask for more lookups than a ray may have, in the same cells."""

    def thick_beside(b):
        x = b.component(b.op("position"), 0)
        return b.op(
            "vector_scale", (1.0,) * 3, b.op("math_multiply_add", b.op("math_less_than", x, 0.0), 2e6 - 0.5, 0.5)
        )

    scene = filled(medium(thick_beside, None, (glow,) * 3), world=1.0)
    image = seen(scene, (2e-3, 0.1, 3), (0, 0, -1), samples=4, pixels=8)
    check(image, math.exp(-1.0) + glow / 0.5 * (1.0 - math.exp(-1.0)), 5e-3)


def test_rays_that_would_take_too_long_are_told_of():
    """A world whose density grows without bounds."""
    scene = filled_world(medium(None, by_height(0.3, 0.3, 0.3, falloff=5.0)), glow=1.0)
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 9), (0, 0.1, -1)), (-1, 1, -1, 1), 0.0, 1e6)
    scene.film = sd.Film(8, 8)
    with Session(scene, sd.Settings("path", 2, threads=2, parameters={"volume_bounces": 2})) as session:
        while not session.wait():
            pass
        assert any("through volumes" in text for text in session.native.messages())


def test_an_object_within_the_world():
    outside = nothing()
    scene = filled_world(medium((0.2, 0.2, 0.2)), (cube(), outside), wall(-2))
    fill(scene, outside, medium(by_height(0.3, 0.3, 0.3)))
    check(seen(scene, (0, 0, 2), (0, 0, -1)), math.exp(-0.2 * 4 - 0.3 * 2 * math.sinh(1)), 5e-3)


# -------------------------------------------------------------------------------------------------- every integrator


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("density", [(0.4, 0.4, 0.4), by_height(0.4, 0.4, 0.4)], ids=["even", "varying"])
def test_every_integrator_sees_a_luminaire_through_what_absorbs(integrator, density):
    scene = filled(medium(density), wall(-3))
    depth = 0.4 * (2 * math.sinh(1) if callable(density) else 2.0)
    check(probe(scene, (0.1, 0.2, 3), (0, 0, -1), 64, integrator=integrator), math.exp(-depth), 5e-3)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_every_integrator_sees_a_luminaire_from_within(integrator):
    """Neither end of the way lies outside."""
    scene = filled(
        medium((0.4, 0.4, 0.4)),
        (quad((-0.5, -0.5, -0.5), (0.5, -0.5, -0.5), (0.5, 0.5, -0.5), (-0.5, 0.5, -0.5)), emission()),
    )
    check(probe(scene, (0.1, 0.2, 0.5), (0, 0, -1), 16, integrator=integrator), math.exp(-0.4))


@pytest.mark.parametrize("integrator", [i for i in INTEGRATORS if i != "light"])
def test_every_integrator_lights_a_surface_through_what_absorbs(integrator):
    """The sun above a small floor, with a slab between that all its light goes through at right angles. Light tracing, which hardly ever
    comes by so small a spot, is compared with path tracing (agreement_scenes)."""
    floor = quad((-0.2, -0.2, -3), (0.2, -0.2, -3), (0.2, 0.2, -3), (-0.2, 0.2, -3)), surface(0.5)

    def seen_floor(volume):
        scene = filled(volume, floor)
        scene.lights.append(lamp("SUN", matrix=matrix((0, 0, 5)), angle=0.0))
        return probe(scene, (0.05, 0.02, -2), (0, 0, -1), 16, width=0.01, integrator=integrator, pixels=16)

    clear, tinted = seen_floor(medium((0.0, 0.0, 0.0))), seen_floor(medium((0.4, 0.4, 0.4)))
    assert clear.mean() > 0
    check(tinted / clear.mean(), math.exp(-0.8), 0.02)
