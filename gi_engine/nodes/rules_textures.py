"""Rules of the texture nodes. Where no Vector is linked, images look at the active UV map and the others at Generated,
as in Cycles. Enums become immediates; their numbers are those of native/src/shading/textures.
"""

from __future__ import annotations

import numpy as np

from .attributes import UNDEFORMED
from .ies import ies_table
from .program import COLOR, VECTOR
from .rules import rule
from .sky import sky_texture

DIMENSIONS = {"1D": 1, "2D": 2, "3D": 3, "4D": 4}
FRACTALS = {"MULTIFRACTAL": 0, "FBM": 1, "HYBRID_MULTIFRACTAL": 2, "RIDGED_MULTIFRACTAL": 3, "HETERO_TERRAIN": 4}
GRADIENTS = {
    "LINEAR": 0,
    "QUADRATIC": 1,
    "EASING": 2,
    "DIAGONAL": 3,
    "RADIAL": 4,
    "QUADRATIC_SPHERE": 5,
    "SPHERICAL": 6,
}
WAVES = {"BANDS": 0, "RINGS": 1}
DIRECTIONS = {"X": 0, "Y": 1, "Z": 2, "DIAGONAL": 3, "SPHERICAL": 3}
PROFILES = {"SIN": 0, "SAW": 1, "TRI": 2}
FEATURES = {"F1": 0, "F2": 1, "SMOOTH_F1": 2, "DISTANCE_TO_EDGE": 3, "N_SPHERE_RADIUS": 4}
METRICS = {"EUCLIDEAN": 0, "MANHATTAN": 1, "CHEBYCHEV": 2, "MINKOWSKI": 3}
INTERPOLATIONS = {"Closest": 0, "Linear": 1, "Cubic": 2, "Smart": 2}
EXTENSIONS = {"REPEAT": 0, "EXTEND": 1, "CLIP": 2, "MIRROR": 3}
PROJECTIONS = {"FLAT": 0, "SPHERE": 1, "TUBE": 2}
UNREADABLE_IES = 100.0  # Cycles' own answer
ENVIRONMENTS = {"EQUIRECTANGULAR": 0, "MIRROR_BALL": 1}


def vector(b, default):
    """The Vector input after the node's own mapping (the sidebar's Texture Mapping of old files)."""
    source = b.input("Vector", VECTOR) if b.linked("Vector") else default(b)
    mapping = getattr(b.node, "texture_mapping", None)
    rows = mapping_rows(mapping)
    mapped = source if rows is None else b.op("affine", source, *rows)
    return b.op("vector_normalize", mapped) if mapping and mapping.vector_type == "NORMAL" else mapped


def generated(b):
    return b.op("generated", imm=(b.attribute(UNDEFORMED),))


def active_uv(b):
    return b.op("uv", imm=(b.attribute(""),))


def mapping_rows(mapping):
    """What a TexMapping does, as three rows and a translation; None where it does nothing."""
    if mapping is None:
        return None
    pick = np.array([[getattr(mapping, f"mapping_{row}") == column for column in "XYZ"] for row in "xyz"], float)
    scale, rotation, move = np.array(mapping.scale), euler_matrix(*mapping.rotation), np.array(mapping.translation)
    kind = mapping.vector_type
    if kind in ("TEXTURE", "NORMAL"):  # these divide
        scale = np.where(np.abs(scale) < 1e-5, np.copysign(1e-5, scale), scale)
    if kind == "TEXTURE":
        matrix = np.diag(1.0 / scale) @ rotation.T
        move = -matrix @ move
    else:
        matrix = rotation @ np.diag(1.0 / scale if kind == "NORMAL" else scale)
        move = move if kind == "POINT" else np.zeros(3)
    matrix = matrix @ pick
    if np.array_equal(matrix, np.eye(3)) and not move.any():
        return None
    return [*(tuple(row) for row in matrix), tuple(move)]


def euler_matrix(x: float, y: float, z: float) -> np.ndarray:
    """Turns about X first, then Y, then Z."""
    (cx, cy, cz), (sx, sy, sz) = np.cos((x, y, z)), np.sin((x, y, z))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


# -------------------------------------------------------------------- procedural


@rule("ShaderNodeTexNoise")
def noise(b):
    n = b.node
    imm = (DIMENSIONS[n.noise_dimensions], FRACTALS[n.noise_type], n.normalize, b.wants("Color"))
    inputs = [
        b.input(name) for name in ("W", "Scale", "Detail", "Roughness", "Lacunarity", "Offset", "Gain", "Distortion")
    ]
    value, color = b.op("noise", vector(b, generated), *inputs, imm=imm, kind=COLOR)
    b.output("Fac", value)
    b.output("Color", color)


@rule("ShaderNodeTexWhiteNoise")
def white_noise(b):
    value, color = b.op(
        "white_noise", b.input("Vector"), b.input("W"), imm=(DIMENSIONS[b.node.noise_dimensions],), kind=COLOR
    )
    b.output("Value", value)
    b.output("Color", color)


@rule("ShaderNodeTexVoronoi")
def voronoi(b):
    from ..export.version import voronoi_hashes_floats  # needs bpy

    n = b.node
    imm = (
        DIMENSIONS[n.voronoi_dimensions],
        FEATURES[n.feature],
        METRICS[n.distance],
        n.normalize,
        voronoi_hashes_floats(),
    )
    names = ("W", "Scale", "Detail", "Roughness", "Lacunarity", "Smoothness", "Exponent", "Randomness")
    distance, color, position, w = b.op("voronoi", vector(b, generated), *(b.input(name) for name in names), imm=imm)
    b.output("Distance", distance)
    b.output("Radius", distance)
    b.output("Color", b.as_kind(color, COLOR))
    b.output("Position", position)
    b.output("W", w)


@rule("ShaderNodeTexGabor")
def gabor(b):
    inputs = [b.input(name) for name in ("Scale", "Frequency", "Anisotropy", "Orientation 2D", "Orientation 3D")]
    value, phase, intensity = b.op("gabor", vector(b, generated), *inputs, imm=(DIMENSIONS[b.node.gabor_type],))
    b.output("Value", value)
    b.output("Phase", phase)
    b.output("Intensity", intensity)


@rule("ShaderNodeTexChecker")
def checker(b):
    color, value = b.op(
        "checker", vector(b, generated), b.input("Color1"), b.input("Color2"), b.input("Scale"), kind=COLOR
    )
    b.output("Color", color)
    b.output("Fac", value)


@rule("ShaderNodeTexGradient")
def gradient(b):
    grey(b, b.op("gradient", vector(b, generated), imm=(GRADIENTS[b.node.gradient_type],)))


@rule("ShaderNodeTexWave")
def wave(b):
    n = b.node
    direction = n.bands_direction if n.wave_type == "BANDS" else n.rings_direction
    names = ("Scale", "Distortion", "Detail", "Detail Scale", "Detail Roughness", "Phase Offset")
    imm = (WAVES[n.wave_type], DIRECTIONS[direction], PROFILES[n.wave_profile])
    grey(b, b.op("wave", vector(b, generated), *(b.input(name) for name in names), imm=imm))


def grey(b, value):
    b.output("Fac", value)
    b.output("Color", b.as_kind(value, COLOR))


@rule("ShaderNodeTexMagic")
def magic(b):
    color, value = b.op(
        "magic",
        vector(b, generated),
        b.input("Scale"),
        b.input("Distortion"),
        imm=(b.node.turbulence_depth,),
        kind=COLOR,
    )
    b.output("Color", color)
    b.output("Fac", value)


@rule("ShaderNodeTexBrick")
def brick(b):
    n = b.node
    names = ("Color1", "Color2", "Mortar", "Scale", "Mortar Size", "Mortar Smooth", "Bias", "Brick Width", "Row Height")
    inputs = [b.input(name) for name in names]
    imm = (n.offset_frequency, n.squash_frequency)
    color, mortar = b.op("brick", vector(b, generated), *inputs, n.offset, n.squash, imm=imm, kind=COLOR)
    b.output("Color", color)
    b.output("Fac", mortar)


# -------------------------------------------------------------------- images


def load_image(b) -> int:
    from ..export.images import image_key, read_image  # needs bpy

    image, user = b.node.image, b.node.image_user
    return b.image(image_key(image, user), lambda: read_image(image, b.warn, user))


@rule("ShaderNodeTexImage")
def image(b):
    n = b.node
    if n.image is None:
        return no_image(b)
    lookup = (INTERPOLATIONS[n.interpolation], EXTENSIONS[n.extension], b.wants("Alpha"))
    number = load_image(b)
    if n.projection == "BOX":
        inputs = (vector(b, active_uv), n.projection_blend, b.op("object_normal"))
        color, alpha = b.op("image_box", *inputs, imm=(number, *lookup), kind=COLOR)
    else:
        color, alpha = b.op("image", vector(b, active_uv), imm=(number, PROJECTIONS[n.projection], *lookup), kind=COLOR)
    b.output("Color", color)
    b.output("Alpha", alpha)


@rule("ShaderNodeTexEnvironment")
def environment(b):
    n = b.node
    if n.image is None:
        return no_image(b)
    imm = (load_image(b), ENVIRONMENTS[n.projection], INTERPOLATIONS[n.interpolation])
    color, _alpha = b.op("environment", vector(b, direction), imm=imm, kind=COLOR)
    b.output("Color", color)


def direction(b):
    return b.op("position")


def no_image(b) -> None:
    b.warn("has no image and shows magenta")
    b.output("Color", b.constant(1.0, 0.0, 1.0, kind=COLOR))
    b.output("Alpha", b.constant(1.0))


@rule("ShaderNodeTexSky")
def sky(b):
    b.output("Color", sky_texture(b, vector(b, generated)))


@rule("ShaderNodeTexIES")
def ies(b):
    from ..export.texts import ies_text  # needs bpy
    from ..export.version import ies_ends_in_darkness

    b.resources.notes.lasting = False  # nobody says when a text or a file changes

    direction = b.input("Vector") if b.linked("Vector") else b.op("object_incoming")
    table = ies_table(ies_text(b.node))
    if table is None:
        b.warn("has no IES data that can be read and gives 100, as in Cycles")
        b.output("Fac", b.op("math_multiply", b.input("Strength"), UNREADABLE_IES))
        return
    b.output(
        "Fac", b.op("ies", direction, b.input("Strength"), imm=(b.table(table), len(table), ies_ends_in_darkness()))
    )
