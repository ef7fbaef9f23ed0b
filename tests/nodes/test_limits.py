"""Deep graphs and long lists of closures: rendered as far as there is room, with a word where there is not."""

import time

import bpy
import numpy as np


def chain(stage, length: int):
    """x -> 0.999 x + 0.0005, `length` times."""
    place, parts = stage.new("ShaderNodeTexCoord"), stage.new("ShaderNodeSeparateXYZ")
    stage.link(place.outputs["Object"], parts.inputs[0])
    value = parts.outputs["X"]
    for _ in range(length):
        node = stage.new("ShaderNodeMath", operation="MULTIPLY_ADD")
        node.inputs[1].default_value, node.inputs[2].default_value = 0.999, 0.0005
        stage.link(value, node.inputs[0])
        value = node.outputs[0]
    return value


def test_two_thousand_nodes_in_a_row(stage):
    stage.show(chain(stage, 2000))
    start = time.perf_counter()
    image = stage.ours()
    assert time.perf_counter() - start < 20.0
    assert np.isfinite(image).all() and image.max() > 0.4 and not stage.warnings


def test_many_closures_are_told_of(stage):
    """Sixty add up to what fits; nothing breaks."""
    shader = None
    for i in range(60):
        glossy = stage.new("ShaderNodeBsdfAnisotropic")
        glossy.inputs["Color"].default_value = (0.01, 0.01, 0.01, 1)
        glossy.inputs["Roughness"].default_value = 0.1 + 0.01 * i
        both = stage.new("ShaderNodeAddShader")
        stage.link(glossy.outputs[0], both.inputs[0])
        if shader:
            stage.link(shader, both.inputs[1])
        shader = both.outputs[0]
    output = next(n for n in stage.tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    stage.link(shader, output.inputs["Surface"])
    bpy.context.view_layer.update()
    assert np.isfinite(stage.ours()).all()
    (warning,) = stage.warnings
    assert "closures" in warning and "Under test" in warning
