"""The structure of trees: groups, reroutes, muted nodes and links, cycles, nodes that are not supported, bad outputs."""

import bpy
import numpy as np
import pytest

from gi_engine.nodes.compile import Compiler
from gi_engine.nodes.rules import RULES
from gi_engine.scene_data import Scene


def value(stage, number: float):
    node = stage.new("ShaderNodeValue")
    node.outputs[0].default_value = number
    return node.outputs[0]


def group(name: str, inputs=(), outputs=()):
    """A node group with float sockets, and its input and output nodes."""
    tree = bpy.data.node_groups.new(name, "ShaderNodeTree")
    for names, direction in ((inputs, "INPUT"), (outputs, "OUTPUT")):
        for socket, kind in names:
            tree.interface.new_socket(socket, in_out=direction, socket_type=kind)
    return tree, tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")


def add(tree, source, number: float):
    node = tree.nodes.new("ShaderNodeMath")
    tree.links.new(source, node.inputs[0])
    node.inputs[1].default_value = number
    return node.outputs[0]


def test_nested_groups(stage):
    """Ten groups, one in the other, each used twice: the same group gives different values in different places."""
    tree, inside, out = group("0", [("x", "NodeSocketFloat")], [("y", "NodeSocketFloat")])
    tree.links.new(add(tree, inside.outputs[0], 0.01), out.inputs[0])
    for depth in range(1, 6):
        outer, inside, out = group(str(depth), [("x", "NodeSocketFloat")], [("y", "NodeSocketFloat")])
        source = inside.outputs[0]
        for _ in range(2):
            node = outer.nodes.new("ShaderNodeGroup")
            node.node_tree = tree
            outer.links.new(source, node.inputs[0])
            source = node.outputs[0]
        outer.links.new(source, out.inputs[0])
        tree = outer
    node = stage.new("ShaderNodeGroup", node_tree=tree)
    node.inputs[0].default_value = 0.25
    stage.show(node.outputs[0])
    image = stage.check()
    assert np.isclose(image.max(), 0.25 + 32 * 0.01)
    assert not stage.warnings


@pytest.mark.parametrize("kind", ["NodeSocketFloat", "NodeSocketVector", "NodeSocketColor"])
@pytest.mark.parametrize("linked", [False, True])
def test_group_sockets_convert(stage, kind, linked):
    """A value at a group's socket is what the socket is: a colour, say, becomes one number by luminance."""
    tree, inside, out = group("convert", [("x", kind)], [("y", "NodeSocketFloat")])
    tree.links.new(add(tree, inside.outputs[0], 0.1), out.inputs[0])
    node = stage.new("ShaderNodeGroup", node_tree=tree)
    node.inputs[0].default_value = {
        "NodeSocketFloat": 0.3,
        "NodeSocketVector": (0.1, 0.2, 0.9),
        "NodeSocketColor": (0.1, 0.2, 0.9, 1),
    }[kind]
    if linked:
        stage.link(stage.new("ShaderNodeTexCoord").outputs["Generated"], node.inputs[0])
    stage.show(node.outputs[0])
    stage.check()


def test_shader_in_a_group(stage):
    tree, inside, out = group("shader", [("Color", "NodeSocketColor")], [("Shader", "NodeSocketShader")])
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(inside.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], out.inputs[0])
    node = stage.new("ShaderNodeGroup", node_tree=tree)
    stage.link(stage.new("ShaderNodeTexCoord").outputs["Generated"], node.inputs[0])
    stage.link(node.outputs[0], next(n for n in stage.tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Surface"])
    assert stage.check().any()


def test_empty_group(stage):
    node = stage.new("ShaderNodeGroup", node_tree=bpy.data.node_groups.new("Empty", "ShaderNodeTree"))
    assert not node.outputs
    stage.emission.inputs["Color"].default_value = (0.5, 0.25, 0.125, 1)
    stage.check()


def test_reroutes(stage):
    source = stage.new("ShaderNodeTexCoord").outputs["Generated"]
    for _ in range(20):
        node = stage.new("NodeReroute")
        stage.link(source, node.inputs[0])
        source = node.outputs[0]
    stage.show(source)
    assert stage.check().any()


def test_dangling_reroute(stage):
    stage.emission.inputs["Color"].default_value = (0.5, 0.25, 0.125, 1)
    stage.show(stage.new("NodeReroute").outputs[0])
    stage.check()


@pytest.mark.parametrize(
    "idname", ["ShaderNodeMath", "ShaderNodeMix", "ShaderNodeSeparateXYZ", "ShaderNodeValToRGB", "ShaderNodeFresnel"]
)
def test_muted_node(stage, idname):
    node = stage.new(idname)
    if node.inputs[0].enabled:
        stage.link(stage.new("ShaderNodeTexCoord").outputs["Generated"], node.inputs[0])
    stage.show(next(o for o in node.outputs if o.enabled))
    node.mute = True
    stage.check()


def test_muted_link(stage):
    stage.emission.inputs["Color"].default_value = (0.5, 0.25, 0.125, 1)
    link = stage.link(value(stage, 0.75), stage.emission.inputs["Color"])
    link.is_muted = True
    assert np.allclose(stage.check().max((0, 1)), (0.5, 0.25, 0.125))


def test_cycle(stage):
    """One warning that names material and node, and an image."""
    first, second = stage.new("ShaderNodeMath"), stage.new("ShaderNodeMath")
    stage.link(first.outputs[0], second.inputs[0])
    stage.link(second.outputs[0], first.inputs[0])
    stage.show(second.outputs[0])
    image = stage.ours()
    assert np.isfinite(image).all()
    (warning,) = stage.warnings
    assert "Under test" in warning and "Math" in warning and "cycle" in warning


def test_fallback_warns_once(stage, monkeypatch):
    monkeypatch.delitem(RULES, "ShaderNodeTexMagic")  # as a node of a Blender to come
    node = stage.new("ShaderNodeTexMagic")
    node.name = "Odd one"
    stage.link(stage.new("ShaderNodeNewGeometry").outputs["Position"], node.inputs["Vector"])  # or Blender works it out
    stage.show(node.outputs[0])
    stage.link(node.outputs[0], stage.emission.inputs["Strength"])
    assert np.isfinite(stage.ours()).all()
    (warning,) = stage.warnings
    assert "Under test" in warning and "Odd one" in warning


def test_no_output(stage):
    for node in [n for n in stage.tree.nodes if n.type == "OUTPUT_MATERIAL"]:
        stage.tree.nodes.remove(node)
    assert not stage.check().any()
    (warning,) = stage.warnings
    assert "Under test" in warning


def test_nothing_linked_to_the_output(stage):
    stage.tree.links.clear()
    assert not stage.check().any()


def test_long_chain(stage):
    """A thousand nodes one after the other: deeper than Python's usual recursion, more values than registers."""
    source = stage.new("ShaderNodeTexCoord").outputs["Generated"]
    for i in range(1000):
        node = stage.new("ShaderNodeVectorMath", operation="ADD" if i % 2 else "SUBTRACT")
        stage.link(source, node.inputs[0])
        node.inputs[1].default_value = (0.01 * (i // 2),) * 3
        source = node.outputs[0]
    stage.show(source)
    assert stage.check(tolerance=1e-3).any()


def test_many_values_alive(stage):
    """A wide tree: all leaves are needed by one sum."""
    total = value(stage, 0.0)
    coordinates = stage.new("ShaderNodeNewGeometry").outputs["Position"]
    for i in range(200):
        leaf, node = stage.new("ShaderNodeVectorMath", operation="SCALE"), stage.new("ShaderNodeVectorMath")
        stage.link(coordinates, leaf.inputs[0])
        next(s for s in leaf.inputs if s.identifier == "Scale").default_value = 0.001 * i
        stage.link(leaf.outputs[0], node.inputs[0])
        stage.link(total, node.inputs[1])
        total = node.outputs[0]
    stage.show(total)
    stage.check(tolerance=1e-3)


def compiler(warnings):
    return Compiler(Scene(), bpy.context.evaluated_depsgraph_get(), warnings.append)


def test_no_material_is_grey():
    program = compiler([]).material(None)
    assert np.float32(0.8) in program.constants


def test_same_material_same_program(stage):
    stage.show(stage.new("ShaderNodeTexCoord").outputs["Generated"])
    first, second = (compiler([]).material(stage.material) for _ in range(2))
    assert (first.code == second.code).all() and (first.constants == second.constants).all()


@pytest.mark.skipif(bpy.app.version >= (5, 0, 0), reason="materials always use their nodes from 5.0 on")
def test_nodes_switched_off(stage):
    stage.material.use_nodes = False
    stage.material.diffuse_color = (0.1, 0.2, 0.3, 1.0)
    program = compiler([]).material(stage.material)
    assert np.float32(0.3) in program.constants
