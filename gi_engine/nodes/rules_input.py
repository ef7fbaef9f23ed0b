"""Rules of the nodes that ask about the point, its object, its path and the camera. No bpy."""

from __future__ import annotations

import numpy as np

from .attributes import ACTIVE_COLOR, UNDEFORMED, attribute_name
from .rules import rule
from .rules_vector import object_rows

RAY_KINDS = {
    "Is Camera Ray": 1,
    "Is Shadow Ray": 2,
    "Is Diffuse Ray": 4,
    "Is Glossy Ray": 8,
    "Is Transmission Ray": 16,
    "Is Singular Ray": 32,
    "Is Reflection Ray": 64,
    "Is Volume Scatter Ray": 128,
}
RAY_DEPTHS = ("Ray Depth", "Diffuse Depth", "Glossy Depth", "Transparent Depth", "Transmission Depth", "Portal Depth")
AXES = {"X": 0, "Y": 1, "Z": 2}


def generated(b):
    return b.op("generated", imm=(b.attribute(UNDEFORMED),))


def radial_tangent(b, axis: str = "Z"):
    """The tangent around an axis of the object: the default where a Tangent socket is not linked."""
    return b.op("tangent_radial", generated(b), imm=(AXES[axis],))


# -------------------------------------------------------------------- coordinates and geometry


@rule("ShaderNodeTexCoord")
def texture_coordinate(b):
    if b.wants("Generated"):
        b.output("Generated", generated(b))
    if b.wants("UV"):
        b.output("UV", b.op("uv", imm=(b.attribute(""),)))
    if b.node.from_instancer and (b.wants("Generated") or b.wants("UV")):
        b.warn("coordinates of the instancer are not supported; it gives the object's own")
    b.output("Normal", b.op("object_normal"))
    b.output("Object", object_coordinates(b, b.node.object))
    b.output("Camera", b.op("camera_coordinates"))
    b.output("Window", b.op("window"))
    b.output("Reflection", b.op("reflection"))


def object_coordinates(b, owner):
    if owner is None:
        return b.op("object_position")
    try:
        return b.op("to_space", *object_rows(b.matrix_of(owner)))
    except np.linalg.LinAlgError:
        b.warn(f"object '{owner.name}' has a singular transform; it gives the object's own coordinates")
        return b.op("object_position")


@rule("ShaderNodeNewGeometry")
def geometry(b):
    for name, op in {
        "Position": "position",
        "Normal": "normal",
        "True Normal": "true_normal",
        "Incoming": "incoming",
        "Parametric": "parametric",
        "Backfacing": "backfacing",
    }.items():
        b.output(name, b.op(op))
    if b.wants("Tangent"):
        b.output("Tangent", radial_tangent(b))
    for name, neutral in {"Pointiness": 0.5, "Random Per Island": 0.0}.items():
        b.output(name, b.constant(neutral))
        if b.wants(name):
            b.warn(f"{name} is not supported; it gives {neutral}")


@rule("ShaderNodeTangent")
def tangent(b):
    if b.node.direction_type == "RADIAL":
        b.output("Tangent", radial_tangent(b, b.node.axis))
    else:
        b.output("Tangent", b.op("tangent_uv", imm=(b.attribute(b.node.uv_map),)))


@rule("ShaderNodeWireframe")
def wireframe(b):
    b.output("Fac", b.op("wireframe", b.input("Size"), imm=(b.node.use_pixel_size,)))


# -------------------------------------------------------------------- attributes


@rule("ShaderNodeUVMap")
def uv_map(b):
    if b.node.from_instancer:
        b.warn("coordinates of the instancer are not supported; it gives the object's own")
    b.output("UV", b.op("uv", imm=(b.attribute(b.node.uv_map),)))


@rule("ShaderNodeAttribute")
def attribute(b):
    kind, name = b.node.attribute_type, b.node.attribute_name
    if kind == "VIEW_LAYER" or not name:
        value = b.compiler.view_layer_attribute(name) if name else (0.0, 0.0, 0.0, float(kind == "GEOMETRY"))
        vector, mean, alpha = b.constant(*value[:3]), b.constant(sum(value[:3]) / 3.0), b.constant(value[3])
    else:
        slot = b.attribute(attribute_name(kind, name))
        vector, mean, alpha = b.op("attribute", imm=(slot,))
        if kind != "GEOMETRY":  # of properties that are not there even alpha is 0
            alpha = b.op("math_multiply", alpha, b.op("has_attribute", imm=(slot,)))
    b.output("Color", vector)
    b.output("Vector", vector)
    b.output("Fac", mean)
    b.output("Alpha", alpha)


@rule("ShaderNodeVertexColor")
def color_attribute(b):
    slot = b.attribute(b.node.layer_name or ACTIVE_COLOR)
    color, _, alpha = b.op("attribute", imm=(slot,))
    b.output("Color", color)
    b.output("Alpha", b.op("math_multiply", alpha, b.op("has_attribute", imm=(slot,))))


# -------------------------------------------------------------------- objects, paths, the camera


@rule("ShaderNodeObjectInfo")
def object_info(b):
    b.output("Location", b.op("object_location"))
    color, alpha = b.op("object_color")
    b.output("Color", color)
    b.output("Alpha", alpha)
    b.output("Object Index", b.op("object_index"))
    b.output("Material Index", b.constant(float(getattr(b.owner, "pass_index", 0))))
    b.output("Random", b.op("object_random"))


@rule("ShaderNodeLightPath")
def light_path(b):
    for name, bit in RAY_KINDS.items():
        b.output(name, b.op("ray_kind", imm=(bit,)))
    b.output("Ray Length", b.op("ray_length"))
    for i, name in enumerate(RAY_DEPTHS):
        b.output(name, b.op("ray_depth", imm=(i,)))


@rule("GeometryNodeInputSceneTime")
def scene_time(b):
    seconds, frame = b.compiler.scene_time()
    b.output("Seconds", b.constant(seconds))
    b.output("Frame", b.constant(frame))


@rule("ShaderNodeLightFalloff")
def light_falloff(b):
    values = b.op("light_falloff", b.input("Strength"), b.input("Smooth"))
    for name, value in zip(("Quadratic", "Linear", "Constant"), values, strict=True):
        b.output(name, value)


@rule("ShaderNodeFresnel")
def fresnel(b):
    b.output("Fac", b.op("fresnel", b.input("IOR"), b.linked_or("Normal", b.op("normal"))))


@rule("ShaderNodeLayerWeight")
def layer_weight(b):
    fresnel_value, facing = b.op("layer_weight", b.input("Blend"), b.linked_or("Normal", b.op("normal")))
    b.output("Fresnel", fresnel_value)
    b.output("Facing", facing)


@rule("ShaderNodeCameraData")
def camera_data(b):
    for name, value in zip(("View Vector", "View Z Depth", "View Distance"), b.op("camera_data"), strict=True):
        b.output(name, value)


# -------------------------------------------------------------------- what has a fallback


@rule("ShaderNodeBevel")
def bevel(b):
    b.warn("bevels are not rendered; it gives its normal")
    b.output("Normal", b.linked_or("Normal", b.op("normal")))


@rule("ShaderNodeAmbientOcclusion")
def ambient_occlusion(b):
    b.warn("ambient occlusion is not supported; nothing is occluded")
    b.output("Color", b.input("Color"))
    b.output("AO", b.constant(1.0))


@rule("ShaderNodeHairInfo", "ShaderNodeParticleInfo", "ShaderNodePointInfo", "ShaderNodeVolumeInfo")
def no_such_information(b):
    b.warn("objects do not carry this information here; it gives zeros")
    for socket in b.node.outputs:
        b.output(socket.identifier, b.constant(0.0))
