"""Graphs of 3 to 12 nodes drawn at random give the values of Cycles, pixel by pixel. The seed is fixed: a failure can be looked at."""

from __future__ import annotations

import random

import bpy
import numpy as np

from . import compare, node_rows, node_suite
from .cases_nodes import emitting
from .studio import Unavailable, empty, node, put, sheet, tile_region

GRAPHS, SEED = 49, 20
TOLERATED = 0.01  # part of a graph's pixels: jumps of several nodes add up
# Nodes whose values depend on their inputs and the place alone.
KINDS = (
    "ShaderNodeMath", "ShaderNodeVectorMath", "ShaderNodeMix", "ShaderNodeMapRange", "ShaderNodeClamp", "ShaderNodeValToRGB",
    "ShaderNodeRGBCurve", "ShaderNodeHueSaturation", "ShaderNodeInvert", "ShaderNodeGamma", "ShaderNodeBrightContrast",
    "ShaderNodeSeparateXYZ", "ShaderNodeCombineXYZ", "ShaderNodeSeparateColor", "ShaderNodeCombineColor", "ShaderNodeMapping",
    "ShaderNodeVectorRotate", "ShaderNodeTexNoise", "ShaderNodeTexVoronoi", "ShaderNodeTexWave", "ShaderNodeTexMagic",
    "ShaderNodeTexGradient", "ShaderNodeTexChecker", "ShaderNodeFresnel", "ShaderNodeLayerWeight", "ShaderNodeNewGeometry",
    "ShaderNodeObjectInfo", "ShaderNodeRGBToBW", "ShaderNodeBump", "ShaderNodeNormalMap", "ShaderNodeVectorTransform",
)  # fmt: skip


def graph(tree, given: dict, draw: random.Random):
    """Each node takes some of its inputs from what is there already; the last one is what shows."""
    sockets = [given["P"], given["X"], given["C"], given["N"]]
    for _ in range(draw.randint(3, 12)):
        made = node(tree, draw.choice(KINDS))
        node_rows.prepare(made)
        for prop in node_rows.own_properties(made):
            if prop.type == "ENUM" and not prop.is_enum_flag and draw.random() < 0.5:
                setattr(made, prop.identifier, draw.choice(node_rows.enum_values(made, prop)))
        if "Scale" in made.inputs and made.bl_idname.startswith("ShaderNodeTex"):
            made.inputs["Scale"].default_value *= node_rows.FINE
        for socket in node_rows.moving(made):
            # How a texture is made stays as it is, or it would be finer than pixels.
            if draw.random() < 0.6 and (socket.type != "VALUE" or not made.bl_idname.startswith("ShaderNodeTex")):
                put(tree, socket, draw.choice(sockets))
        sockets += [s for s in made.outputs if s.enabled]
    return sockets[-1]


def test_random_graphs_agree():
    compare.register_once()
    draw = random.Random(SEED)

    def maker(seed):
        def make(name):
            try:
                return emitting(name, lambda tree, given: graph(tree, given, random.Random(seed)))
            except (AttributeError, TypeError, Unavailable) as error:
                raise Unavailable(str(error)) from error

        return make

    seeds = [draw.randrange(1 << 30) for _ in range(GRAPHS)]
    case = sheet("graphs", {f"graph {s}": maker(s) for s in seeds}, node_suite.patch, node_suite.nothing, samples=1)
    scene = empty(case.size)
    case.build(scene)
    compare.neutral(scene, 1)
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    theirs, ours = (compare.render(scene, engine, 11) for engine in compare.ENGINES)
    compared, wrong = 0, []
    for i, seed in enumerate(seeds):
        if bpy.data.materials.get(f"graph {seed}") is None:
            continue
        where = tile_region(case, i)
        found = node_suite.pixels_of(node_rows.Row("graph", str(seed)), theirs[where][None], ours[where][None], [])
        compared += bool(np.isfinite(theirs[where]).all())
        if found.wrong > TOLERATED:
            wrong.append(f"graph {seed}: {100 * found.wrong:.1f} % of the pixels, by up to {found.worst:.3g}")
    assert compared > 0.9 * GRAPHS
    assert not wrong, "\n".join(wrong)
