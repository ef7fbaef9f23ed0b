"""Zones, closures, bundles and menus in shader trees (Blender 5): Blender flattens them, and the values are those of Cycles."""

import bpy
import pytest

pytestmark = pytest.mark.skipif(
    not hasattr(bpy.types.Material, "inline_shader_nodes"), reason="this Blender has no zones in shader trees"
)


def varying(stage):
    place = stage.new("ShaderNodeTexCoord")
    parts = stage.new("ShaderNodeSeparateXYZ")
    stage.link(place.outputs["Object"], parts.inputs[0])
    return parts.outputs["X"]


def test_repeat_zone(stage):
    """x -> x² + 0.2, three times."""
    begin, end = stage.new("GeometryNodeRepeatInput"), stage.new("GeometryNodeRepeatOutput")
    begin.pair_with_output(end)
    end.repeat_items.new("FLOAT", "x")
    begin.inputs["Iterations"].default_value = 3
    step = stage.new("ShaderNodeMath", operation="MULTIPLY_ADD")
    step.inputs[2].default_value = 0.2
    stage.link(varying(stage), begin.inputs["x"])
    stage.link(begin.outputs["x"], step.inputs[0])
    stage.link(begin.outputs["x"], step.inputs[1])
    stage.link(step.outputs[0], end.inputs["x"])
    stage.show(end.outputs["x"])
    image = stage.check()
    assert not stage.warnings and image.max() > 0.2


def test_closure_zone(stage):
    """A closure that squares its input, evaluated at x."""
    begin, end = stage.new("NodeClosureInput"), stage.new("NodeClosureOutput")
    begin.pair_with_output(end)
    end.input_items.new("FLOAT", "a")
    end.output_items.new("FLOAT", "b")
    square = stage.new("ShaderNodeMath", operation="MULTIPLY")
    for i in (0, 1):
        stage.link(begin.outputs["a"], square.inputs[i])
    stage.link(square.outputs[0], end.inputs["b"])
    evaluate = stage.new("NodeEvaluateClosure")
    evaluate.input_items.new("FLOAT", "a")
    evaluate.output_items.new("FLOAT", "b")
    stage.link(end.outputs["Closure"], evaluate.inputs["Closure"])
    stage.link(varying(stage), evaluate.inputs["a"])
    stage.show(evaluate.outputs["b"])
    assert stage.check().max() > 0.1
    assert not stage.warnings


def test_bundle(stage):
    """What is combined comes out again, by name; joined bundles have the items of both."""
    first, second = stage.new("NodeCombineBundle"), stage.new("NodeCombineBundle")
    first.bundle_items.new("FLOAT", "x")
    second.bundle_items.new("FLOAT", "y")
    stage.link(varying(stage), first.inputs["x"])
    join, apart = stage.new("NodeJoinBundle"), stage.new("NodeSeparateBundle")
    stage.link(first.outputs[0], join.inputs[0])
    stage.link(second.outputs[0], join.inputs[0])
    stage.link(join.outputs[0], apart.inputs[0])
    apart.bundle_items.new("FLOAT", "x")
    stage.show(apart.outputs["x"])
    assert stage.check().max() > 0.1
    assert not stage.warnings


def test_menu_switch(stage):
    choice, menu = stage.new("GeometryNodeMenuSwitch", data_type="FLOAT"), stage.new("FunctionNodeInputMenu")
    stage.link(menu.outputs[0], choice.inputs["Menu"])
    choice.inputs["A"].default_value = 0.1
    stage.link(varying(stage), choice.inputs["B"])
    bpy.context.view_layer.update()
    choice.inputs["Menu"].default_value = "B"
    stage.tree.links.remove(choice.inputs["Menu"].links[0])
    stage.show(choice.outputs[0])
    assert stage.check().max() > 0.1
    assert not stage.warnings
