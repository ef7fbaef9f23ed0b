"""Rules of the nodes that ask about the point, its object, its path and the camera. No bpy."""

from __future__ import annotations

import numpy as np

from .attributes import (
    ACTIVE_COLOR,
    INSTANCER_GENERATED,
    INSTANCER_UV,
    ISLAND,
    PARTICLE_PLACE,
    PARTICLE_SPIN,
    PARTICLE_STATE,
    PARTICLE_VELOCITY,
    POINTINESS,
    STRAND_INTERCEPT,
    STRAND_LENGTH,
    STRAND_RANDOM,
    UNDEFORMED,
    attribute_name,
)
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
ANY_DISTANCE = 1e30  # what Ambient Occlusion takes a distance of 0 for
AXES = {"X": 0, "Y": 1, "Z": 2}


def generated(b):
    return b.op("generated", imm=(b.attribute(UNDEFORMED),))


def surface_tangent(b):
    """The default where a Tangent socket is not linked: around the object's Z, or along the strand."""
    return b.op("along_strand", radial_tangent(b))


def radial_tangent(b, axis: str = "Z"):
    """The tangent around an axis of the object."""
    return b.op("tangent_radial", generated(b), imm=(AXES[axis],))


# -------------------------------------------------------------------- coordinates and geometry


@rule("ShaderNodeTexCoord")
def texture_coordinate(b):
    instancer = b.node.from_instancer
    if b.wants("Generated"):
        b.output("Generated", named(b, INSTANCER_GENERATED)[0] if instancer else generated(b))
    if b.wants("UV"):
        b.output("UV", named(b, INSTANCER_UV)[0] if instancer else b.op("uv", imm=(b.attribute(""),)))
    b.output("Normal", b.op("object_normal"))
    b.output("Object", object_coordinates(b, b.node.object))
    b.output("Camera", b.op("camera_coordinates"))
    b.output("Window", b.op("window"))
    b.output("Reflection", b.op("reflection"))


def named(b, name: str) -> tuple:
    """Vector, mean and fourth number of an attribute."""
    return b.op("attribute", imm=(b.attribute(name),))


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
        b.output("Tangent", surface_tangent(b))
    for name, attribute in {"Pointiness": POINTINESS, "Random Per Island": ISLAND}.items():
        if b.wants(name):
            b.output(name, named(b, attribute)[1])


@rule("ShaderNodeTangent")
def tangent(b):
    if b.node.direction_type == "RADIAL":
        b.output("Tangent", radial_tangent(b, b.node.axis))
    else:
        from ..export.version import tangents_are_undisplaced  # needs bpy

        b.output("Tangent", b.op("tangent_uv", imm=(b.attribute(b.node.uv_map), tangents_are_undisplaced())))


@rule("ShaderNodeWireframe")
def wireframe(b):
    b.output("Fac", b.op("wireframe", b.input("Size"), imm=(b.node.use_pixel_size,)))


# -------------------------------------------------------------------- attributes


@rule("ShaderNodeUVMap")
def uv_map(b):
    b.output(
        "UV", named(b, INSTANCER_UV)[0] if b.node.from_instancer else b.op("uv", imm=(b.attribute(b.node.uv_map),))
    )


@rule("ShaderNodeAttribute")
def attribute(b):
    kind, name = b.node.attribute_type, b.node.attribute_name
    if kind == "VIEW_LAYER" or not name:
        value = b.resources.view_layer_attribute(name) if name else (0.0, 0.0, 0.0, float(kind == "GEOMETRY"))
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
    seconds, frame = b.resources.scene_time()
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


# -------------------------------------------------------------------- what looks around by rays


@rule("ShaderNodeBevel")
def bevel(b):
    normal = b.linked_or("Normal", b.op("normal"))
    b.output("Normal", b.op("bevel", b.input("Radius"), normal, imm=(b.node.samples,)))


@rule("ShaderNodeAmbientOcclusion")
def ambient_occlusion(b):
    n = b.node
    distance = b.input("Distance")
    if not b.linked("Distance") and b.socket("Distance").default_value == 0.0:
        distance = b.constant(ANY_DISTANCE)
    normal = b.linked_or("Normal", b.op("normal"))
    free = b.op("ambient_occlusion", distance, normal, imm=(n.samples, n.inside, n.only_local))
    b.output("AO", free)
    b.output("Color", b.op("vector_scale", b.input("Color"), free))


@rule("ShaderNodeRaycast")
def raycast(b):
    ray = (b.linked_or("Position", b.op("position")), b.linked_or("Direction", b.op("normal")), b.input("Length"))
    local = (b.node.only_local,)
    names = ("Is Hit", "Self Hit", "Hit Distance", "Hit Position", "Hit Normal")
    for name, value in zip(names, b.op("raycast", *ray, imm=local), strict=True):
        b.output(name, value)
    for socket in b.node.outputs:
        if socket.name in names or not socket.identifier or not b.wants(socket.identifier):
            continue
        vector, mean, _alpha = b.op("raycast_attribute", *ray, imm=(*local, b.attribute(socket.name)))
        b.output(socket.identifier, mean if socket.type in ("VALUE", "INT", "BOOLEAN") else vector)


# -------------------------------------------------------------------- particles, curves, points


@rule("ShaderNodeParticleInfo")
def particle_info(b):
    state, _, lifetime = named(b, PARTICLE_STATE)
    for i, name in enumerate(("Index", "Random", "Age")):
        b.output(name, b.component(state, i))
    b.output("Lifetime", lifetime)
    location, _, size = named(b, PARTICLE_PLACE)
    b.output("Location", location)
    b.output("Size", size)
    b.output("Velocity", named(b, PARTICLE_VELOCITY)[0])
    b.output("Angular Velocity", named(b, PARTICLE_SPIN)[0])


@rule("ShaderNodeHairInfo")
def curves_info(b):
    """Zeros on meshes, as in Cycles."""
    from ..export.version import thickness_is_unscaled  # needs bpy

    b.output("Is Strand", b.op("strand")[2])
    for name, attribute in {
        "Intercept": STRAND_INTERCEPT,
        "Length": STRAND_LENGTH,
        "Random": STRAND_RANDOM,
    }.items():
        if b.wants(name):
            b.output(name, named(b, attribute)[1])
    _, thickness, normal = b.op("strand_place", imm=(thickness_is_unscaled(),))
    b.output("Thickness", thickness)
    b.output("Tangent Normal", normal)


@rule("ShaderNodePointInfo")
def point_info(b):
    center, thickness, _ = b.op("strand_place", imm=(0,))
    is_point = b.op("math_subtract", b.constant(1.0), b.op("strand")[2])
    b.output("Position", b.op("vector_scale", center, is_point))
    b.output("Radius", b.op("math_multiply", thickness, b.op("math_multiply", is_point, b.constant(0.5))))
    if b.wants("Random"):
        b.output("Random", b.op("math_multiply", named(b, STRAND_RANDOM)[1], is_point))


@rule("ShaderNodeVolumeInfo")
def not_of_meshes(b):
    """Zeros on meshes, as in Cycles; volume grids themselves are left out elsewhere, under a warning."""
    for socket in b.node.outputs:
        b.output(socket.identifier, b.constant(0.0))
