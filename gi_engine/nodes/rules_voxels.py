"""Point Density, which Blender has up to 4.5 and works out itself: a cube of voxels. No bpy."""

from __future__ import annotations

import hashlib

import numpy as np

from ..scene_data import Image
from .program import COLOR
from .rules import rule
from .rules_textures import INTERPOLATIONS, generated


@rule("ShaderNodeTexPointDensity")
def point_density(b):
    """As in Cycles nothing of it is on surfaces."""
    n = b.node
    if not b.walker.is_volume:
        b.warn("gives 0 on surfaces, as in Cycles")
    if not b.walker.is_volume or n.object is None or b.resources.depsgraph is None:
        b.output("Color", b.constant(0.0, 0.0, 0.0, kind=COLOR))
        b.output("Density", b.constant(0.0))
        return
    voxels, low, high = point_voxels(b)
    side = n.resolution
    key = "voxels", side, hashlib.sha256(voxels.tobytes()).hexdigest()
    image = b.image(key, lambda: [Image(n.name, voxels.reshape(side * side, side, 4), alpha="PREMULTIPLIED")])
    color, density = b.op(
        "voxels", voxel_place(b, low, high), imm=(image, side, INTERPOLATIONS[n.interpolation]), kind=COLOR
    )
    b.output("Color", color)
    b.output("Density", density)


def point_voxels(b) -> tuple:
    """The floats of all voxels, and the corners of their cube in the space of the object that has the points."""
    b.resources.notes.lasting = False  # the points may move
    depsgraph = b.resources.depsgraph
    b.node.cache_point_density(depsgraph=depsgraph)
    low, high = b.node.calc_point_density_minmax(depsgraph=depsgraph)
    return np.array(b.node.calc_point_density(depsgraph=depsgraph), np.float32), np.array(low), np.array(high)


def voxel_place(b, low, high):
    """World space is that of the points; the object's own has its bounds for the cube. As in Cycles, Vector is of the world in both."""
    if b.node.space == "OBJECT":
        return b.op("generated_at", b.input("Vector")) if b.linked("Vector") else generated(b)
    size = np.where(high > low, high - low, 1.0)
    to_cube = np.diag([*(1.0 / size), 1.0]) @ np.array(
        [[1, 0, 0, -low[0]], [0, 1, 0, -low[1]], [0, 0, 1, -low[2]], [0, 0, 0, 1]]
    )
    inverse = to_cube @ np.linalg.inv(np.asarray(b.resources.matrix_of(b.node.object), float))
    place = b.input("Vector") if b.linked("Vector") else b.op("position")
    return b.op("affine", place, *map(tuple, inverse[:3, :3].tolist()), tuple(inverse[:3, 3].tolist()))
