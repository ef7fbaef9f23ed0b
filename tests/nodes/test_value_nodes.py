"""Nodes on numbers, vectors and colours, against Cycles: every operation at every pixel of a varied surface."""

import bpy
import pytest


def items(idname: str, name: str) -> list[str]:
    return [item.identifier for item in getattr(bpy.types, idname).bl_rna.properties[name].enum_items]


def socket(node, identifier: str):
    """By identifier: sockets that the node's mode hides have no name."""
    return next(s for s in (*node.inputs, *node.outputs) if s.identifier == identifier)


def spread(stage, scale=(3.0, 2.5, 2.0), offset=(-1.5, -1.2, -1.1)):
    """A vector with positive and negative components."""
    node = stage.new("ShaderNodeVectorMath", operation="MULTIPLY_ADD")
    stage.link(stage.new("ShaderNodeTexCoord").outputs["Generated"], node.inputs[0])
    node.inputs[1].default_value, node.inputs[2].default_value = scale, offset
    return node.outputs[0]


def numbers(stage, **how):
    node = stage.new("ShaderNodeSeparateXYZ")
    stage.link(spread(stage, **how), node.inputs[0])
    return node.outputs


@pytest.mark.parametrize(
    ("operation", "clamp"), [(o, False) for o in items("ShaderNodeMath", "operation")] + [("TANGENT", True)]
)
def test_math(stage, operation, clamp):
    node = stage.new("ShaderNodeMath", operation=operation, use_clamp=clamp)
    for output, target in zip(numbers(stage), node.inputs, strict=True):
        stage.link(output, target)
    stage.show(node.outputs[0])
    stage.check(outliers=0.05)


@pytest.mark.parametrize("operation", items("ShaderNodeVectorMath", "operation"))
def test_vector_math(stage, operation):
    node = stage.new("ShaderNodeVectorMath", operation=operation)
    stage.link(spread(stage), node.inputs[0])
    stage.link(
        spread(stage, scale=(0.5, -0.4, 0.3), offset=(0.4, -0.5, 0.6)), node.inputs[1]
    )  # away from 0: fewer jumps
    stage.link(stage.new("ShaderNodeTexCoord").outputs["UV"], node.inputs[2])
    stage.link(numbers(stage, offset=(0.2, 0.2, 0.2))[0], socket(node, "Scale"))
    stage.show(next(o for o in node.outputs if o.enabled))
    stage.check(outliers=0.05)


def link_mix(stage, node, kind: str):
    stage.link(spread(stage), socket(node, f"A_{kind}"))
    stage.link(stage.new("ShaderNodeTexCoord").outputs["UV"], socket(node, f"B_{kind}"))
    stage.link(numbers(stage, offset=(-0.4, 0.2, 0.2))[0], socket(node, "Factor_Float"))
    stage.link(spread(stage, offset=(-0.4, 0.2, 0.2)), socket(node, "Factor_Vector"))
    stage.show(socket(node, f"Result_{kind}"))


@pytest.mark.parametrize("blend", items("ShaderNodeMix", "blend_type"))
def test_blend_modes(stage, blend):
    node = stage.new("ShaderNodeMix", data_type="RGBA", blend_type=blend, clamp_factor=True)
    link_mix(stage, node, "Color")
    stage.check(outliers=0.05)


@pytest.mark.parametrize("clamp", [False, True])
@pytest.mark.parametrize(("data", "mode", "kind"), [
    ("FLOAT", "UNIFORM", "Float"), ("VECTOR", "UNIFORM", "Vector"), ("VECTOR", "NON_UNIFORM", "Vector"), ("RGBA", "UNIFORM", "Color"),
])  # fmt: skip
def test_mix(stage, data, mode, kind, clamp):
    node = stage.new("ShaderNodeMix", data_type=data, factor_mode=mode, clamp_factor=clamp, clamp_result=clamp)
    link_mix(stage, node, kind)
    stage.check()


def test_old_mix(stage):
    node = stage.new("ShaderNodeMixRGB", blend_type="OVERLAY", use_clamp=True)
    stage.link(numbers(stage)[0], node.inputs["Fac"])
    stage.link(spread(stage), node.inputs["Color1"])
    stage.link(stage.new("ShaderNodeTexCoord").outputs["UV"], node.inputs["Color2"])
    stage.show(node.outputs[0])
    stage.check()


@pytest.mark.parametrize("clamp", [False, True])
@pytest.mark.parametrize("data", items("ShaderNodeMapRange", "data_type"))
@pytest.mark.parametrize("interpolation", items("ShaderNodeMapRange", "interpolation_type"))
@pytest.mark.parametrize("turned", [False, True])
def test_map_range(stage, data, interpolation, clamp, turned):
    node = stage.new("ShaderNodeMapRange", data_type=data, interpolation_type=interpolation, clamp=clamp)
    ends = (0.8, -0.4) if turned else (-0.4, 0.8)
    if data == "FLOAT":
        names, values, made = ("From Min", "From Max", "To Min", "To Max"), (*ends, 2.0, -0.5), node.outputs["Result"]
        stage.link(numbers(stage)[0], node.inputs["Value"])
    else:
        names, made = ("From_Min_FLOAT3", "From_Max_FLOAT3", "To_Min_FLOAT3", "To_Max_FLOAT3"), node.outputs["Vector"]
        values = [(v, v + 0.1, v - 0.1) for v in (*ends, 2.0, -0.5)]
        stage.link(spread(stage), node.inputs["Vector"])
    for name, value in zip(names, values, strict=True):
        socket(node, name).default_value = value
    stage.show(made)
    stage.check(outliers=0.1)  # steps have edges


@pytest.mark.parametrize("kind", ["MINMAX", "RANGE"])
def test_clamp(stage, kind):
    node = stage.new("ShaderNodeClamp", clamp_type=kind)
    for output, target in zip(numbers(stage), node.inputs, strict=True):
        stage.link(output, target)
    stage.show(node.outputs[0])
    stage.check()


COLOR_NODES = {
    "ShaderNodeGamma": {"Gamma": 0.7},
    "ShaderNodeBrightContrast": {"Bright": 0.1, "Contrast": 0.4},
    "ShaderNodeInvert": {"Fac": 0.8},
    "ShaderNodeHueSaturation": {"Hue": 0.62, "Saturation": 1.6, "Value": 0.8, "Fac": 0.9},
    "ShaderNodeRGBToBW": {},
}


@pytest.mark.parametrize("idname", COLOR_NODES)
def test_color_nodes(stage, idname):
    node = stage.new(idname)
    for name, value in COLOR_NODES[idname].items():
        node.inputs[name].default_value = value
    stage.link(spread(stage, offset=(-0.3, -0.1, 0.0)), node.inputs["Color"])
    stage.show(node.outputs[0])
    stage.check()


@pytest.mark.parametrize(
    ("idname", "scale", "offset"), [("ShaderNodeBlackbody", 12500.0, 300.0), ("ShaderNodeWavelength", 420.0, 370.0)]
)
def test_spectra(stage, idname, scale, offset):
    node = stage.new(idname)
    stage.link(numbers(stage, scale=(scale,) * 3, offset=(offset,) * 3)[0], node.inputs[0])
    stage.show(node.outputs[0])
    stage.check(tolerance=2e-2 if "Blackbody" in idname else 2e-4)  # Cycles' black body is a fit


@pytest.mark.parametrize("interpolation", ["LINEAR", "EASE", "CONSTANT", "B_SPLINE", "CARDINAL"])
@pytest.mark.parametrize("output", ["Color", "Alpha"])
def test_color_ramp(stage, interpolation, output):
    node = stage.new("ShaderNodeValToRGB")
    ramp = node.color_ramp
    ramp.interpolation = interpolation
    ramp.elements.new(0.4).color = (0.9, 0.2, 0.1, 0.3)
    ramp.elements[0].position = 0.1
    stage.link(numbers(stage)[0], node.inputs["Fac"])
    stage.show(node.outputs[output])
    stage.check(outliers=0.05)


@pytest.mark.parametrize("extend", ["HORIZONTAL", "EXTRAPOLATED"])
@pytest.mark.parametrize("idname", ["ShaderNodeRGBCurve", "ShaderNodeVectorCurve", "ShaderNodeFloatCurve"])
def test_curves(stage, idname, extend):
    node = stage.new(idname)
    node.mapping.extend = extend
    for i, curve in enumerate(node.mapping.curves):
        curve.points.new(0.3, 0.5 + 0.1 * i)
    node.mapping.update()
    node.inputs[0].default_value = 0.85
    single = idname == "ShaderNodeFloatCurve"
    stage.link(numbers(stage)[0] if single else spread(stage), node.inputs[1])
    stage.show(node.outputs[0])
    stage.check()


@pytest.mark.parametrize("mode", ["RGB", "HSV", "HSL"])
def test_separate_and_combine(stage, mode):
    """Apart, channels changed places, and together again."""
    apart, together = stage.new("ShaderNodeSeparateColor", mode=mode), stage.new("ShaderNodeCombineColor", mode=mode)
    stage.link(spread(stage, scale=(0.9, 0.8, 0.7), offset=(0.05, 0.1, 0.2)), apart.inputs[0])
    for i in range(3):
        stage.link(apart.outputs[i], together.inputs[(i + 1) % 3])
    stage.show(together.outputs[0])
    stage.check(outliers=0.05)


@pytest.mark.skipif(not hasattr(bpy.types, "ShaderNodeSeparateHSV"), reason="gone from this Blender")
@pytest.mark.parametrize("mode", ["RGB", "HSV"])
def test_old_separate_and_combine(stage, mode):
    apart, together = stage.new(f"ShaderNodeSeparate{mode}"), stage.new(f"ShaderNodeCombine{mode}")
    stage.link(spread(stage, scale=(0.9, 0.8, 0.7), offset=(0.05, 0.1, 0.2)), apart.inputs[0])
    for i in range(3):
        stage.link(apart.outputs[i], together.inputs[(i + 1) % 3])
    stage.show(together.outputs[0])
    stage.check(outliers=0.05)


@pytest.mark.parametrize("kind", items("ShaderNodeMapping", "vector_type"))
def test_mapping(stage, kind):
    node = stage.new("ShaderNodeMapping", vector_type=kind)
    stage.link(spread(stage), node.inputs["Vector"])
    socket(node, "Location").default_value = (0.1, -0.2, 0.3)
    node.inputs["Rotation"].default_value = (0.4, 1.1, -0.7)
    node.inputs["Scale"].default_value = (0.8, 1.5, -2.0)
    stage.show(node.outputs[0])
    stage.check()


@pytest.mark.parametrize("invert", [False, True])
@pytest.mark.parametrize("kind", items("ShaderNodeVectorRotate", "rotation_type"))
def test_vector_rotate(stage, kind, invert):
    node = stage.new("ShaderNodeVectorRotate", rotation_type=kind, invert=invert)
    for name, value in {
        "Center": (0.1, 0.2, -0.3),
        "Axis": (0.5, 2.0, 1.0),
        "Angle": 0.9,
        "Rotation": (0.4, 1.1, -0.7),
    }.items():
        socket(node, name).default_value = value
    stage.link(spread(stage), node.inputs["Vector"])
    stage.show(node.outputs[0])
    stage.check()


@pytest.mark.parametrize("kind", items("ShaderNodeVectorTransform", "vector_type"))
@pytest.mark.parametrize("source", ["WORLD", "OBJECT", "CAMERA"])
@pytest.mark.parametrize("target", ["WORLD", "OBJECT", "CAMERA"])
def test_vector_transform(stage, kind, source, target):
    node = stage.new("ShaderNodeVectorTransform", vector_type=kind, convert_from=source, convert_to=target)
    stage.link(spread(stage), node.inputs[0])
    stage.show(node.outputs[0])
    stage.check()


@pytest.mark.parametrize("output", ["Normal", "Dot"])
def test_normal_node(stage, output):
    node = stage.new("ShaderNodeNormal")
    node.outputs["Normal"].default_value = (0.3, -0.5, 0.8)
    stage.link(spread(stage), node.inputs[0])
    stage.show(node.outputs[output])
    stage.check()
