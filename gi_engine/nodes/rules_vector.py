"""Rules of the nodes on vectors: Vector Math, Mapping, rotation, curves, and what changes normals. No bpy."""

from __future__ import annotations

import numpy as np

from .curves import curve_immediates
from .program import op_table
from .rules import rule
from .rules_color import separate

MAPPINGS = {"POINT": 0, "TEXTURE": 1, "VECTOR": 2, "NORMAL": 3}
AXES = {"X_AXIS": (1.0, 0.0, 0.0), "Y_AXIS": (0.0, 1.0, 0.0), "Z_AXIS": (0.0, 0.0, 1.0)}
TRANSFORMS = {"VECTOR": 0, "POINT": 1, "NORMAL": 2}
SPACES = {"WORLD": 0, "OBJECT": 1, "CAMERA": 2}
DISPLACEMENT_SPACES = {"TANGENT": 0, "OBJECT": 1, "WORLD": 2}


@rule("ShaderNodeVectorMath")
def vector_math(b):
    name = f"vector_{b.node.operation.lower()}"
    _, outputs, inputs, _ = op_table()[name]
    vectors = iter(("Vector", "Vector_001", "Vector_002"))
    value = b.op(name, *(b.input(next(vectors) if width == "v" else "Scale") for width in inputs))
    b.output("Value" if outputs == "f" else "Vector", value)


@rule("ShaderNodeSeparateXYZ")
def separate_xyz(b):
    separate(b, b.input("Vector"), ("X", "Y", "Z"))


@rule("ShaderNodeCombineXYZ")
def combine_xyz(b):
    b.output("Vector", b.op("combine", *map(b.input, "XYZ")))


@rule("ShaderNodeMapping")
def mapping(b):
    rows = b.op("euler_rows", b.input("Rotation"))
    location = b.input("Location", default=(0.0, 0.0, 0.0))
    b.output(
        "Vector",
        b.op("mapping", b.input("Vector"), *rows, location, b.input("Scale"), imm=(MAPPINGS[b.node.vector_type],)),
    )


@rule("ShaderNodeVectorRotate")
def vector_rotate(b):
    vector, center, kind = b.input("Vector"), b.input("Center"), b.node.rotation_type
    if kind == "EULER_XYZ":
        result = b.op("rotate_rows", vector, center, *b.op("euler_rows", b.input("Rotation")), imm=(b.node.invert,))
    else:
        angle = b.op("math_multiply", b.input("Angle"), -1.0 if b.node.invert else 1.0)
        result = b.op("rotate_axis", vector, center, AXES[kind] if kind in AXES else b.input("Axis"), angle)
    b.output("Vector", result)


@rule("ShaderNodeVectorTransform")
def vector_transform(b):
    imm = (TRANSFORMS[b.node.vector_type], SPACES[b.node.convert_from], SPACES[b.node.convert_to])
    b.output("Vector", b.op("vector_transform", b.input("Vector"), imm=imm))


@rule("ShaderNodeVectorCurve")
def vector_curves(b):
    b.output(
        "Vector", b.op("curves", b.input("Fac"), b.input("Vector"), imm=curve_immediates(b, b.node.mapping, channels=3))
    )


@rule("ShaderNodeNormal")
def normal(b):
    direction = b.op("vector_normalize", tuple(b.node.outputs["Normal"].default_value))
    b.output("Normal", direction)
    b.output("Dot", b.op("vector_dot_product", direction, b.op("vector_normalize", b.input("Normal"))))


# -------------------------------------------------------------------- normals and displacement


@rule("ShaderNodeNormalMap")
def normal_map(b):
    from ..export.version import normal_maps_take_short_normals, tangents_are_undisplaced  # needs bpy

    color, strength, space = b.input("Color"), b.input("Strength"), b.node.space
    green = getattr(b.node, "convention", "OPENGL") == "DIRECTX"
    if space == "TANGENT":
        original = 1 if getattr(b.node, "base", "") == "ORIGINAL" else 2 * tangents_are_undisplaced()
        imm = (b.attribute(b.node.uv_map), green, not normal_maps_take_short_normals(), original)
        result = b.op("normal_map_tangent", color, strength, imm=imm)
    else:
        result = b.op(
            "normal_map_space", color, strength, imm=(space.endswith("OBJECT"), space.startswith("BLENDER"), green)
        )
    b.output("Normal", result)


@rule("ShaderNodeRadialTiling")
def radial_tiling(b):
    inputs = [b.input(name) for name in ("Vector", "Sides", "Roundness")]
    made = b.op("radial_tiling", *inputs, imm=(b.node.normalize,))
    for name, value in zip(("Coordinates", "ID", "Width", "Rotation"), made, strict=True):
        b.output(f"Segment {name}", value)


@rule("ShaderNodeBump")
def bump(b):
    normal = b.linked_or("Normal", b.op("normal"))
    if not b.linked("Height"):
        b.output("Normal", normal)
        return
    socket = b.socket("Filter Width")  # Cycles heeds no link here
    width = b.constant(float(socket.default_value) if socket else 0.1)
    heights = b.shifted_values(lambda: b.input("Height"), width)
    distance = b.op("math_multiply", b.input("Distance"), -1.0 if b.node.invert else 1.0)
    b.output("Normal", b.op("bump", *heights, b.input("Strength"), distance, width, normal, imm=(False,)))


@rule("ShaderNodeDisplacement")
def displacement(b):
    inputs = [b.input(name) for name in ("Height", "Midlevel", "Scale")]
    normal = b.linked_or("Normal", b.op("normal"))
    b.output("Displacement", b.op("displacement", *inputs, normal, imm=(b.node.space == "OBJECT",)))


@rule("ShaderNodeVectorDisplacement")
def vector_displacement(b):
    inputs = [b.input(name) for name in ("Vector", "Midlevel", "Scale")]
    imm = (b.attribute(""), DISPLACEMENT_SPACES[b.node.space])
    b.output("Displacement", b.op("vector_displacement", *inputs, imm=imm))


def object_rows(matrix) -> tuple:
    """What the op to_space wants of the inverse of a matrix: three rows and the translation."""
    inverse = np.linalg.inv(np.asarray(matrix, float))
    return (*map(tuple, inverse[:3, :3].tolist()), tuple(inverse[:3, 3].tolist()))
