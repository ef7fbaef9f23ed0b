"""Rules of the nodes on colours. No bpy."""

from __future__ import annotations

from .curves import curve_immediates, ramp_immediates
from .rules import rule


@rule("ShaderNodeValToRGB")
def color_ramp(b):
    color, alpha = b.op("color_ramp", b.input("Fac"), imm=ramp_immediates(b, b.node.color_ramp))
    b.output("Color", color)
    b.output("Alpha", alpha)


@rule("ShaderNodeRGBCurve")
def rgb_curves(b):
    b.output(
        "Color", b.op("curves", b.input("Fac"), b.input("Color"), imm=curve_immediates(b, b.node.mapping, channels=3))
    )


@rule("ShaderNodeRGBToBW")
def rgb_to_bw(b):
    b.output("Val", b.op("rgb_to_bw", b.input("Color")))


@rule("ShaderNodeGamma")
def gamma(b):
    b.output("Color", b.op("gamma", b.input("Color"), b.input("Gamma")))


@rule("ShaderNodeBrightContrast")
def bright_contrast(b):
    b.output("Color", b.op("bright_contrast", b.input("Color"), b.input("Bright"), b.input("Contrast")))


@rule("ShaderNodeInvert")
def invert(b):
    b.output("Color", b.op("invert", b.input("Fac"), b.input("Color")))


@rule("ShaderNodeHueSaturation")
def hue_saturation(b):
    b.output("Color", b.op("hue_saturation", *map(b.input, ("Hue", "Saturation", "Value", "Fac", "Color"))))


@rule("ShaderNodeBlackbody")
def blackbody(b):
    b.output("Color", b.op("blackbody", b.input("Temperature")))


@rule("ShaderNodeWavelength")
def wavelength(b):
    b.output("Color", b.op("wavelength", b.input("Wavelength")))


# -------------------------------------------------------------------- channels


def separate(b, color, outputs: tuple) -> None:
    for i, name in enumerate(outputs):
        b.output(name, b.component(color, i))


@rule("ShaderNodeSeparateColor")
def separate_color(b):
    color = b.input("Color")
    if b.node.mode != "RGB":
        color = b.op(f"rgb_to_{b.node.mode.lower()}", color)
    separate(b, color, ("Red", "Green", "Blue"))


@rule("ShaderNodeCombineColor")
def combine_color(b):
    color = b.op("combine", *map(b.input, ("Red", "Green", "Blue")))
    b.output("Color", color if b.node.mode == "RGB" else b.op(f"{b.node.mode.lower()}_to_rgb", color))


@rule("ShaderNodeSeparateRGB")
def separate_rgb(b):
    separate(b, b.input("Image"), ("R", "G", "B"))


@rule("ShaderNodeCombineRGB")
def combine_rgb(b):
    b.output("Image", b.op("combine", *map(b.input, "RGB")))


@rule("ShaderNodeSeparateHSV")
def separate_hsv(b):
    separate(b, b.op("rgb_to_hsv", b.input("Color")), ("H", "S", "V"))


@rule("ShaderNodeCombineHSV")
def combine_hsv(b):
    b.output("Color", b.op("hsv_to_rgb", b.op("combine", *map(b.input, "HSV"))))
