"""True displacement without Blender: what displaced surfaces light, and what scenes that are edited make of those before them."""

import dataclasses

import numpy as np
import pytest
from light_scenes import emission, lamp, matrix
from test_closed_forms import mesh, quad
from test_editing import picture, run
from test_irradiance_keeping import room, surface

from gi_engine import native
from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder

SQUARE = ((-0.5, -0.5, 0.4), (0.5, -0.5, 0.4), (0.5, 0.5, 0.4), (-0.5, 0.5, 0.4))


def lift(height):
    """Along the normal, more where x is larger."""
    b = ProgramBuilder()
    at = b.op("vector_dot_product", b.op("position"), (0.5, 0.0, 0.0))
    b.op("move_point", b.op("displacement", b.op("math_add", at, 1.0), 0.0, height, b.op("normal"), imm=(False,)))
    return b.finish("lift")


def lifted(corners, height):
    return tuple((x, y, z + height * (1 + 0.5 * x)) for x, y, z in corners)


def displaced(scene, program, height, bumps=False):
    """The scene with its program `program` displacing what it is on."""
    programs = [*scene.programs, lift(height)]
    programs[program] = dataclasses.replace(programs[program], displacement=len(programs) - 1, bumps_displacement=bumps)
    return dataclasses.replace(scene, programs=programs)


@pytest.mark.parametrize("integrator", ["path", "bdpt", "photon_map"])
@pytest.mark.parametrize("paint", [emission(strength=5.0), surface(0.5)])
def test_lights_as_what_is_there(paint, integrator):
    """A light or a board that is displaced is the same as one that was made so."""
    moved = displaced(room((quad(*SQUARE), paint)), 1, 0.3)
    there = room((quad(*lifted(SQUARE, 0.3)), paint))
    settings = sd.Settings(integrator, 16, seed=1, threads=2)
    found, wanted = (run(s, settings, native.build_scene(s, 2)).read("Combined") for s in (moved, there))
    assert abs(found.mean() - wanted.mean()) < 2e-3 * wanted.mean()
    np.testing.assert_allclose(found, wanted, rtol=0.1, atol=0.02 * wanted.mean())


def edits():
    """A displaced board; then a lamp moves, the board moves, its displacement grows, it is bent, it is displaced no more, and again."""
    plain = room((quad(*SQUARE), surface(0.5)))
    first = displaced(plain, 1, 0.3)
    lit = dataclasses.replace(first, lights=[lamp("POINT", (90.0,) * 3, matrix=matrix((1.0, -1.2, -0.5)), radius=0.0)])
    turned = dataclasses.replace(lit, instances=list(lit.instances))
    turned.instances[1] = dataclasses.replace(first.instances[1], matrix=matrix((0.3, 0.1, 0)))
    higher = dataclasses.replace(displaced(dataclasses.replace(turned, programs=plain.programs), 1, 0.6))
    bent = dataclasses.replace(higher, meshes=[higher.meshes[0], quad(*lifted(SQUARE, 0.2))])
    flat = dataclasses.replace(bent, programs=plain.programs)
    return [first, lit, turned, higher, bent, flat, bent]


def test_edited_scenes_displace_what_was_never_displaced():
    before, pictures = None, []
    for scene in edits():
        before = native.build_scene(scene, 2, movable=True, before=before)
        made = picture(scene, before)
        np.testing.assert_array_equal(made, picture(scene, native.build_scene(scene, 2, movable=True)))
        pictures.append(made)
    assert all(not np.array_equal(a, b) for a, b in zip(pictures, pictures[1:], strict=False))


def test_the_mesh_itself_stays_as_it_was():
    scene = displaced(room((quad(*SQUARE), surface(0.5))), 1, 0.3)
    before = [m.positions.copy() for m in scene.meshes]
    native.build_scene(scene, 2)
    for mesh_before, mesh_now in zip(before, scene.meshes, strict=True):
        np.testing.assert_array_equal(mesh_before, mesh_now.positions)


def test_seams_of_two_materials_do_not_open():
    """What two materials share moves as the first face says; the other's own vertices move as it says."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0)]
    strip = dataclasses.replace(
        mesh(corners, [(0, 1, 2, 3), (1, 4, 5, 2)]),
        tri_face=np.array([0, 0, 1, 1], np.int32),
        face_material=np.array([0, 1], np.int32),
    )
    glow = emission(strength=1.0)
    scene = sd.Scene(meshes=[strip], programs=[glow, glow, lift(0.0), lift(1.0)])
    scene.programs[0] = dataclasses.replace(glow, displacement=2)
    scene.programs[1] = dataclasses.replace(glow, displacement=3)
    scene.instances.append(sd.Instance("strip", 0, matrix(), [0, 1]))
    camera = sd.Camera("camera", "ORTHO", matrix((1, 0.5, 5)), (-1, 1, -0.5, 0.5), 0.0, 100.0)
    seen = native.build_scene(scene, 2).emission_seen(camera, 64, 32)
    assert (seen == 1).all()  # no gap, whichever way one looks down on it


def test_displacement_that_is_not_finite_moves_nothing():
    scene = displaced(room((quad(*SQUARE), surface(0.5))), 1, float("nan"))
    plain = room((quad(*SQUARE), surface(0.5)))
    np.testing.assert_allclose(
        picture(scene, native.build_scene(scene, 2)), picture(plain, native.build_scene(plain, 2)), rtol=1e-3
    )


def test_a_program_that_is_not_there_is_named():
    scene = room((quad(*SQUARE), surface(0.5)))
    scene.programs[1] = dataclasses.replace(scene.programs[1], displacement=99)
    with pytest.raises(ValueError, match="displacement of 'surface'"):
        native.build_scene(scene, 2)
