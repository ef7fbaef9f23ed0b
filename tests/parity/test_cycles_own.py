"""Where Cycles disagrees with itself: why rows of the table of nodes cannot agree with it. Fails when a new Blender has mended it."""

import bpy
import numpy as np
import pytest

from . import compare
from .cases_hair import STRANDS, tuft
from .studio import ball, camera, empty, link, material, node, world


def lit_by_a_patch_of_sky(coat: float, sampling: str):
    """A ball of hair below a bright patch of sky, met by chance ("NONE") or looked for ("MANUAL")."""
    scene = empty((24, 24))
    ball(
        material("hair", "ShaderNodeBsdfHairPrincipled", {"model": "CHIANG", "parametrization": "COLOR"}, Coat=coat),
        0.4,
        rings=16,
    )
    world((0, 0, 0))
    tree = scene.world.node_tree
    place = node(tree, "ShaderNodeTexCoord").outputs["Generated"]
    x = node(tree, "ShaderNodeSeparateXYZ", None, {0: place}).outputs["X"]
    patch = node(tree, "ShaderNodeMath", {"operation": "GREATER_THAN"}, {0: x, 1: 0.8})
    bright = node(tree, "ShaderNodeMath", {"operation": "MULTIPLY"}, {0: patch.outputs[0], 1: 5.0})
    sky = node(tree, "ShaderNodeBackground", None, {"Color": bright.outputs[0]})
    out = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputWorld")
    tree.links.new(sky.outputs[0], out.inputs[0])
    scene.world.cycles.sampling_method, scene.world.cycles.sample_map_resolution = sampling, 256
    camera((0, -4, 0), (0, 0, 0), 14.0)
    compare.neutral(scene, 256)
    scene.cycles.max_bounces, scene.cycles.transmission_bounces, scene.cycles.glossy_bounces = 1, 0, 0
    return scene


def chance_over_choice(engine: str, coat: float) -> float:
    """How much brighter the ball is where the patch of sky is met by chance."""
    means = []
    for sampling in ("NONE", "MANUAL"):
        scene = lit_by_a_patch_of_sky(coat, sampling)
        means.append(np.mean([compare.render(scene, engine, seed).mean() for seed in (1, 2)]))
    return means[0] / means[1]


def test_coated_hair_depends_on_how_lights_are_sampled():
    """Cycles draws the first reflection as wide as without the coat, and weighs it as if it were as narrow as with it."""
    compare.register_once()
    assert chance_over_choice(compare.ENGINES[0], 0.65) > 1.4
    assert chance_over_choice(compare.ENGINES[0], 0.0) == pytest.approx(1, abs=0.12)
    assert chance_over_choice(compare.ENGINES[1], 0.65) == pytest.approx(1, abs=0.12)


def strands_between_panels(engine: str, sampling: str) -> float:
    """Mean of a tuft between two panels that glow, met by chance ("NONE") or looked for, too ("FRONT_BACK")."""
    scene = empty((32, 32))
    tuft(STRANDS["reflection, wide"]("hair"))
    world((0, 0, 0))
    glow = material("glow", "ShaderNodeEmission", None, Strength=2.0)
    glow.cycles.emission_sampling = sampling
    for z in (5.0, -5.0):
        mesh = bpy.data.meshes.new("panel")
        mesh.from_pydata([(-6, -6, z), (6, -6, z), (6, 6, z), (-6, 6, z)], [], [(0, 1, 2, 3)])
        mesh.materials.append(glow)
        link("panel", mesh).visible_camera = False
    camera((0, 0, 4), (0, 0, 0), 14.0)
    compare.neutral(scene, 64)
    return np.mean([compare.render(scene, engine, seed).mean() for seed in (1, 2, 3)])


def test_strands_lose_light_where_lamps_are_sampled():
    """Cycles evaluates Hair BSDF on one side of a strand and samples it on both: what is behind counts as found twice. It was 18 % here; 3 %
    in GI Engine, which keeps the edges of the closure alone (hair_strand.h)."""
    compare.register_once()
    theirs, ours = (
        strands_between_panels(engine, "NONE") / strands_between_panels(engine, "FRONT_BACK")
        for engine in compare.ENGINES
    )
    assert theirs > 1.12
    assert 1.0 < ours < 1.06
