"""Rules of the nodes on numbers: Math, Map Range, Clamp, Float Curve, Mix and their kin on vectors and colours. No bpy."""

from __future__ import annotations

from .curves import curve_immediates
from .program import op_table
from .rules import rule

RANGES = {"LINEAR": 0, "STEPPED": 1, "SMOOTHSTEP": 2, "SMOOTHERSTEP": 3}


@rule("ShaderNodeMath")
def math(b):
    name = f"math_{b.node.operation.lower()}"
    inputs = ("Value", "Value_001", "Value_002")[: len(op_table()[name][2])]
    value = b.op(name, *map(b.input, inputs))
    b.output("Value", b.op("saturate", value) if b.node.use_clamp else value)


@rule("ShaderNodeMapRange")
def map_range(b):
    kind = RANGES[b.node.interpolation_type]
    if b.node.data_type == "FLOAT_VECTOR":
        inputs = [b.input(f"{name}_FLOAT3") for name in ("From_Min", "From_Max", "To_Min", "To_Max", "Steps")]
        clamp = b.node.clamp and kind < RANGES["SMOOTHSTEP"]
        b.output("Vector", b.op("map_range_vector", b.input("Vector"), *inputs, imm=(kind, clamp)))
        return
    inputs = [b.input(name) for name in ("Value", "From Min", "From Max", "To Min", "To Max", "Steps")]
    b.output("Result", b.op("map_range", *inputs, imm=(kind, b.node.clamp)))


@rule("ShaderNodeClamp")
def clamp(b):
    b.output("Result", b.op(f"clamp_{b.node.clamp_type.lower()}", b.input("Value"), b.input("Min"), b.input("Max")))


@rule("ShaderNodeFloatCurve")
def float_curve(b):
    b.output(
        "Value",
        b.op("float_curve", b.input("Factor"), b.input("Value"), imm=curve_immediates(b, b.node.mapping, channels=1)),
    )


@rule("ShaderNodeMix")
def mix(b):
    node = b.node
    each = node.data_type == "VECTOR" and node.factor_mode == "NON_UNIFORM"
    factor = b.input("Factor_Vector" if each else "Factor_Float")
    if node.clamp_factor:
        factor = b.op("saturate_vector" if each else "saturate", factor)
    if node.data_type == "FLOAT":
        b.output("Result_Float", b.op("mix_float", factor, b.input("A_Float"), b.input("B_Float")))
    elif node.data_type == "RGBA":
        color = b.op(f"blend_{node.blend_type.lower()}", factor, b.input("A_Color"), b.input("B_Color"))
        b.output("Result_Color", b.op("saturate_vector", color) if node.clamp_result else color)
    elif node.data_type == "VECTOR":
        b.output(
            "Result_Vector",
            b.op("mix_vector_each" if each else "mix_vector", factor, b.input("A_Vector"), b.input("B_Vector")),
        )
    else:
        b.warn("mixing rotations is not supported; it gives A")
        b.output("Result_Rotation", b.input("A_Rotation"))


@rule("ShaderNodeMixRGB")
def mix_rgb(b):
    factor = b.op("saturate", b.input("Fac"))
    color = b.op(f"blend_{b.node.blend_type.lower()}", factor, b.input("Color1"), b.input("Color2"))
    b.output("Color", b.op("saturate_vector", color) if b.node.use_clamp else color)
