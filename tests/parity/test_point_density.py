"""Point Density, which Blender has up to 4.5: the glow of a volume by it, as in Cycles, in every interpolation and space, of vertices and of
particles, where a place is and elsewhere. Its rows in the table of nodes are on surfaces, where there is none."""

import bpy
import numpy as np
import pytest

from . import compare
from .studio import Case, camera, cube, empty, node, tree_of

pytestmark = pytest.mark.skipif(
    not hasattr(bpy.types, "ShaderNodeTexPointDensity"), reason="Point Density went with Blender 5"
)


def points(particles: bool):
    """Where the density is: the corners of a small crooked shape, or what it emits."""
    mesh = bpy.data.meshes.new("points")
    mesh.from_pydata(
        [(-0.3, -0.3, -0.2), (0.4, -0.2, 0.0), (0.0, 0.4, 0.1), (0.1, 0.0, 0.5)], [], [(0, 1, 2), (0, 1, 3)]
    )
    item = bpy.data.objects.new("points", mesh)
    bpy.context.scene.collection.objects.link(item)
    item.location, item.rotation_euler = (0.1, -0.1, 0.05), (0.2, 0.3, 0.4)
    if particles:
        made = item.modifiers.new("dust", "PARTICLE_SYSTEM").particle_system.settings
        made.count, made.frame_start, made.frame_end, made.lifetime = 30, 1, 1, 100
        made.physics_type, made.emit_from = "NO", "FACE"
    return item


def elsewhere(tree):
    """What is looked up is moved, turned and smaller."""
    place = node(tree, "ShaderNodeNewGeometry").outputs["Position"]
    inputs = {"Vector": place, "Location": (0.1, 0.15, -0.1), "Rotation": (0.3, 0.0, 0.5), "Scale": (1.3, 1.2, 1.4)}
    return node(tree, "ShaderNodeMapping", None, inputs).outputs[0]


def glowing(space: str, interpolation: str, color_source: str, moved: bool):
    particles = color_source.startswith("PARTICLE")
    made = bpy.data.materials.new("dust")
    tree = tree_of(made)
    item = points(particles)
    properties = {
        "point_source": "PARTICLE_SYSTEM" if particles else "OBJECT",
        "object": item,
        "resolution": 24,
        "radius": 0.25,
        "space": space,
        "interpolation": interpolation,
        "particle_color_source" if particles else "vertex_color_source": color_source,
    }
    inputs = {"Vector": elsewhere(tree)} if moved else None
    density = node(tree, "ShaderNodeTexPointDensity", properties, inputs)
    if particles:
        density.particle_system = item.particle_systems[0]
    color = node(tree, "ShaderNodeVectorMath", {"operation": "ABSOLUTE"}, {0: density.outputs["Color"]})
    strength = node(tree, "ShaderNodeMath", {"operation": "MULTIPLY"}, {0: density.outputs["Density"], 1: 10.0})
    glow = node(tree, "ShaderNodeEmission", None, {"Color": color.outputs[0], "Strength": strength.outputs[0]})
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(glow.outputs[0], out.inputs["Volume"])
    return made


# Space, interpolation, what colours are from, whether it is looked up elsewhere.
CASES = {
    "closest": ("WORLD", "Closest", "VERTEX_NORMAL", False),
    "linear": ("WORLD", "Linear", "VERTEX_NORMAL", False),
    "cubic": ("WORLD", "Cubic", "VERTEX_NORMAL", False),
    "object": ("OBJECT", "Linear", "VERTEX_NORMAL", False),
    "particles": ("WORLD", "Linear", "PARTICLE_VELOCITY", False),
    "age": ("OBJECT", "Linear", "PARTICLE_AGE", False),
    "moved": ("WORLD", "Linear", "VERTEX_NORMAL", True),
    "object, moved": ("OBJECT", "Linear", "VERTEX_NORMAL", True),
}


@pytest.mark.parametrize("case", CASES)
def test_as_in_cycles(case):
    compare.register_once()
    scene = empty((32, 32))
    cube(glowing(*CASES[case]), 0.8, rotation=(0.1, 0.2, 0.3))
    camera((0, -4, 1), (0, 0, 0), 26.0)
    scene.frame_set(5)
    compare.neutral(scene, 512)
    scene.cycles.volume_step_rate = 0.1
    pairs = compare.render_pairs(scene)
    assert np.mean(pairs["CYCLES"]) > 1e-3  # something glows
    agreement = compare.agreement(case, pairs, Case("", None).tolerance)
    assert agreement.agrees, str(agreement)
