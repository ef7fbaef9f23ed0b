"""Nodes that ask about the point, its object and its path, against Cycles."""

import pytest

OUTPUTS = {
    "ShaderNodeTexCoord": ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection"),
    "ShaderNodeNewGeometry": ("Position", "Normal", "Tangent", "True Normal", "Incoming", "Parametric", "Backfacing"),
    "ShaderNodeObjectInfo": ("Location", "Color", "Alpha", "Object Index", "Material Index", "Random"),
    "ShaderNodeLightPath": (
        "Is Camera Ray",
        "Is Shadow Ray",
        "Is Diffuse Ray",
        "Ray Length",
        "Ray Depth",
        "Transparent Depth",
    ),
    "ShaderNodeCameraData": ("View Vector", "View Z Depth", "View Distance"),
    "ShaderNodeFresnel": ("Fac",),
    "ShaderNodeLayerWeight": ("Fresnel", "Facing"),
    "ShaderNodeLightFalloff": ("Quadratic", "Linear", "Constant"),
    "ShaderNodeTangent": ("Tangent",),
}


@pytest.mark.parametrize(("idname", "output"), [(n, o) for n, outputs in OUTPUTS.items() for o in outputs])
def test_output(stage, idname, output):
    stage.material.pass_index = 5
    stage.show(stage.new(idname).outputs[output])
    image = stage.check()
    assert not stage.warnings
    if output not in {"Is Shadow Ray", "Is Diffuse Ray", "Ray Depth", "Transparent Depth", "Backfacing"}:
        assert image.any()


@pytest.mark.parametrize("hard", [False, True])
@pytest.mark.parametrize("output", ["Pointiness", "Random Per Island"])
def test_outputs_that_look_at_edges(stage, output, hard):
    """Up to Blender 4.5 sharp edges part a mesh."""
    if hard:
        stage.harden()
    stage.show(stage.new("ShaderNodeNewGeometry").outputs[output])
    assert stage.check().any()
