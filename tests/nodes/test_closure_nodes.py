"""Shader nodes: what their rules compile to, and that whatever is not rendered says so."""

from __future__ import annotations

import bpy
import pytest
from gi_engine_native import _core

from gi_engine.nodes.compile import Compiler
from gi_engine.nodes.program import op_table
from gi_engine.nodes.rules import CLOSURE_RULES
from gi_engine.scene_data import Scene

COMPOUND = {"ShaderNodeGroup", "ShaderNodeCustomGroup"}


class Shader:
    """A material under test and what its program came to."""

    def __init__(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.material = bpy.data.materials.new("Under test")
        if self.material.node_tree is None:
            self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.output = self.tree.nodes.new("ShaderNodeOutputMaterial")
        self.warnings: list[str] = []

    def new(self, idname: str, inputs=None, **settings):
        node = self.tree.nodes.new(idname)
        for name, value in settings.items():
            setattr(node, name, value)
        for name, value in (inputs or {}).items():
            if isinstance(value, bpy.types.Node):
                self.tree.links.new(value.outputs[0], node.inputs[name])
            else:
                node.inputs[name].default_value = value
        return node

    def compile(self, node):
        self.tree.links.new(node.outputs[0], self.output.inputs["Surface"])
        return Compiler(Scene(), None, self.warnings.append).material(self.material)

    def ops(self, node) -> list[str]:
        """The names of the closure ops, in order."""
        program, names, at = self.compile(node), [], 0
        by_code = {code: (name, *rest) for name, (code, *rest) in op_table().items()}
        while at < len(program.code):
            name, outputs, inputs, immediates = by_code[int(program.code[at])]
            at += 1 + len(outputs) + len(inputs) + immediates
            if (not outputs and name != "jump_if_zero") or name.endswith("_layer"):
                names.append(name)
        return names

    def shade(self, node):
        p = self.compile(node)
        arguments = (p.code.tolist(), p.constants.tolist(), p.register_count, p.tables.tolist())
        return _core.ShadedPoint(*arguments, (0.0, 0.6, 0.8))


@pytest.fixture
def shader():
    return Shader()


def shader_nodes():
    for name in dir(bpy.types):
        kind = getattr(bpy.types, name)
        if name.startswith("ShaderNode") and name not in COMPOUND and getattr(kind, "bl_rna", None):
            yield name


def test_every_shader_has_a_rule(shader):
    seen = 0
    for name in shader_nodes():
        try:
            node = shader.tree.nodes.new(name)
        except RuntimeError:
            continue  # a base class
        if any(o.type == "SHADER" for o in node.outputs):
            seen += 1
            assert name in CLOSURE_RULES
            shader.compile(node)
        shader.tree.nodes.remove(node)
    assert seen > 20


def test_all_inputs_of_the_principled_bsdf_are_read(shader, monkeypatch):
    from gi_engine.nodes.links import Links
    from gi_engine.nodes.tree_walker import TreeWalker

    read = set()
    value, resolve = TreeWalker.value, Links.resolve

    def noted(walker, context, socket, *rest):
        read.add(socket.name)
        return value(walker, context, socket, *rest)

    def noted_link(links, context, socket):
        read.add(socket.name)
        return resolve(links, context, socket)

    monkeypatch.setattr(TreeWalker, "value", noted)
    monkeypatch.setattr(Links, "resolve", noted_link)
    shows = ("Metallic", "Transmission Weight", "Coat Weight", "Sheen Weight", "Anisotropic", "Emission Strength")
    node = shader.new("ShaderNodeBsdfPrincipled", dict.fromkeys(shows, 0.5))
    shader.compile(node)
    assert {s.name for s in node.inputs} - read == {"Weight"}


def test_principled_emits_and_lets_through_only_what_it_must(shader):
    plain = ["specular_layer", "base_layer"]
    node = shader.new("ShaderNodeBsdfPrincipled")
    assert shader.ops(node) == plain
    node.inputs["Alpha"].default_value = 0.5
    assert shader.ops(node) == ["alpha", *plain]
    node.inputs["Emission Strength"].default_value = 1.0
    assert shader.ops(node) == ["alpha", "emission", *plain]
    node.inputs["Emission Color"].default_value = (0, 0, 0, 1)
    assert shader.ops(node) == ["alpha", *plain]
    off = shader.new("ShaderNodeValue")
    off.outputs[0].default_value = 0.0
    node.inputs["Emission Color"].default_value = (1, 1, 1, 1)
    shader.tree.links.new(off.outputs[0], node.inputs["Emission Strength"])
    assert shader.ops(node) == ["alpha", *plain]  # linked, but known to be 0


def test_principled_has_the_layers_that_show(shader):
    node = shader.new("ShaderNodeBsdfPrincipled", {"Coat Weight": 0.5, "Sheen Weight": 0.5, "Transmission Weight": 0.5})
    assert shader.ops(node) == ["sheen_layer", "coat_layer", "glass_layer", "specular_layer", "base_layer"]
    node.inputs["Metallic"].default_value = 1.0
    assert shader.ops(node) == ["sheen_layer", "coat_layer", "metal_layer"]


def test_mix_shader(shader):
    red = shader.new("ShaderNodeEmission", {"Color": (1, 0, 0, 1), "Strength": 2.0})
    green = shader.new("ShaderNodeEmission", {"Color": (0, 1, 0, 1)})
    mix = shader.new("ShaderNodeMixShader", {0: 0.25, 1: red, 2: green})
    assert shader.shade(mix).emission == pytest.approx((1.5, 0.25, 0))
    outer = shader.new("ShaderNodeMixShader", {0: 0.5, 1: mix, 2: red})
    assert shader.shade(outer).emission == pytest.approx((1.75, 0.125, 0))
    for factor, expected in ((0.0, (2, 0, 0)), (1.0, (0, 1, 0)), (7.0, (0, 1, 0))):
        mix.inputs[0].default_value = factor
        assert shader.shade(mix).emission == pytest.approx(expected)
        assert len(shader.ops(mix)) == 1  # the other branch is not even compiled


def test_mix_with_nothing_and_with_itself(shader):
    red = shader.new("ShaderNodeEmission", {"Color": (1, 0, 0, 1)})
    half = shader.new("ShaderNodeMixShader", {0: 0.5, 1: red})
    assert shader.shade(half).emission == pytest.approx((0.5, 0, 0))
    both = shader.new("ShaderNodeAddShader", {0: red, 1: red})
    assert shader.shade(both).emission == pytest.approx((2, 0, 0))
    assert not shader.warnings


def test_a_factor_that_varies_skips_what_has_no_weight(shader):
    facing = shader.new("ShaderNodeLayerWeight")
    red = shader.new("ShaderNodeEmission", {"Color": (1, 0, 0, 1)})
    glass = shader.new("ShaderNodeBsdfGlass")
    mix = shader.new("ShaderNodeMixShader", {1: red, 2: glass})
    shader.tree.links.new(facing.outputs["Facing"], mix.inputs[0])
    point = shader.shade(mix)
    assert point.lobe_count == 1
    assert point.emission == pytest.approx((0.8, 0, 0), abs=1e-5)  # facing is 1 − cos θ at blend 1/2


def test_groups_and_muted_shaders(shader):
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    inside, outside = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    emission = group.nodes.new("ShaderNodeEmission")
    group.links.new(inside.outputs[0], emission.inputs["Color"])
    group.links.new(emission.outputs[0], outside.inputs[0])
    node = shader.new("ShaderNodeGroup", node_tree=group)
    node.inputs[0].default_value = (0.1, 0.2, 0.3, 1)
    assert shader.shade(node).emission == pytest.approx((0.1, 0.2, 0.3))
    mix = shader.new("ShaderNodeMixShader", {0: 1.0, 1: node})
    mix.mute = True  # passes its first shader on
    assert shader.shade(mix).emission == pytest.approx((0.1, 0.2, 0.3))


@pytest.mark.parametrize(
    ("idname", "ops"),
    [
        ("ShaderNodeVolumeScatter", []),
    ],
)
def test_fallbacks_say_so_once(shader, idname, ops):
    node = shader.new(idname)
    node.name = "Odd one"
    both = shader.new("ShaderNodeAddShader", {0: node, 1: node})
    assert shader.ops(both) == ops * 2
    assert len(shader.warnings) == 1
    assert "'Under test'" in shader.warnings[0]
    assert "'Odd one'" in shader.warnings[0]


@pytest.mark.parametrize("method", ["RANDOM_WALK", "RANDOM_WALK_SKIN", "BURLEY"])
def test_light_below_surfaces_needs_no_fallback(shader, method):
    assert shader.ops(shader.new("ShaderNodeSubsurfaceScattering", falloff=method)) == ["subsurface"]
    shader.compile(shader.new("ShaderNodeBsdfPrincipled", {"Subsurface Weight": 0.3}, subsurface_method=method))
    assert not shader.warnings


@pytest.mark.skipif(bpy.app.version < (5, 2, 0), reason="thin walls came with 5.2")
def test_subsurface_of_a_thin_wall_needs_no_fallback(shader):
    shader.compile(shader.new("ShaderNodeBsdfPrincipled", {"Subsurface Weight": 0.3, "Thin Wall": True}))
    assert not shader.warnings
