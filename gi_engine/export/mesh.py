"""Evaluated meshes to scene_data.Mesh.

Arrays go over as Blender holds them (corners, faces, vertices); expanding them to triangles is the native side's work.
"""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np

from .. import native
from ..nodes.attributes import ACTIVE_COLOR, ISLAND, POINTINESS, UNDEFORMED, VERTEX_NORMAL
from ..scene_data import Attribute, Mesh
from .arrays import is_triangulated, read, read_attribute, triangle_corners
from .version import sharp_edges_part_meshes


@contextmanager
def readable(item, mesh, wanted: set[str]):
    """The mesh of an evaluated object with its attributes: while it is edited, Blender gives but a wrapper of the edit mesh, which has no
    faces, either, until a window has drawn it. Cut apart where that shows."""
    parted = is_parted(mesh, wanted)
    if not parted and ("position" in mesh.attributes or not (mesh.is_editmode or mesh.polygons)):
        yield mesh
        return
    try:
        copy = item.to_mesh()
        if parted:
            copy.split_faces()
        yield copy
    finally:
        item.to_mesh_clear()


def is_parted(mesh, wanted: set[str]) -> bool:
    """Whether it is read without what its sharp edges hold together: that shows where it is displaced, and in random numbers of islands."""
    shows = VERTEX_NORMAL in wanted or ISLAND in wanted
    return shows and sharp_edges_part_meshes() and mesh.normals_domain == "CORNER"


def export_mesh(mesh, name: str, wanted: set[str], deformed: bool = False) -> Mesh | None:
    """Reads an evaluated bpy Mesh; None if it has no triangles.

    `wanted` names the attributes to take along, as nodes/attributes.py has them. `deformed`: vertices may have moved.
    """
    if not mesh.polygons:
        return None
    triangulated = is_triangulated(mesh)
    tri_corner = None if triangulated else triangle_corners(mesh)
    if not triangulated and not len(tri_corner):
        return None
    domain, normals = read_normals(mesh, wanted)
    sharp = read_sharp_faces(mesh) if domain == "CORNER" and VERTEX_NORMAL in wanted else None
    material = mesh.attributes.get("material_index")  # absent where all are 0
    if not deformed:
        wanted = wanted - {UNDEFORMED}  # slow to read, and no different from the positions
    active_uv = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    attributes = list(read_attributes(mesh, wanted, active_uv))
    by_face = material is not None or sharp is not None or any(attribute.domain == "FACE" for attribute in attributes)
    return Mesh(
        name=name,
        positions=read_positions(mesh),
        corner_vert=corner_vertices(mesh),
        tri_corner=tri_corner,
        tri_face=read(mesh.loop_triangle_polygons, "value", 1, np.int32) if by_face and not triangulated else None,
        face_material=read(material.data, "value", 1, np.int32) if material else None,
        normals_domain=domain,
        normals=normals,
        sharp_face=sharp,
        attributes=attributes,
        active_uv=active_uv,
        texture_space=(tuple(mesh.texspace_location), tuple(mesh.texspace_size)),
    )


def read_positions(mesh) -> np.ndarray:
    """(V, 3) float32 with one number of slack behind the last: Embree reads vertices 16 bytes at a time."""
    count = 3 * len(mesh.vertices)
    buffer = np.zeros(count + 1, np.float32)
    mesh.attributes["position"].data.foreach_get("vector", buffer[:count])
    return buffer[:count].reshape(-1, 3)


def corner_vertices(mesh) -> np.ndarray:
    """(C,) int32"""
    return read(mesh.attributes[".corner_vert"].data, "value", 1, np.int32)


def read_normals(mesh, wanted: set[str]) -> tuple[str, np.ndarray | None]:
    # Corner normals hold sharp edges and custom normals; asking for them where they are not needed costs
    # memory that Blender keeps.
    domain = mesh.normals_domain
    if is_parted(mesh, wanted):
        normals = read(mesh.vertex_normals, "vector", 3, np.float32)
        corners = triangle_corners(mesh).ravel()
        normals[corner_vertices(mesh)[corners]] = read(mesh.corner_normals, "vector", 3, np.float32)[corners]
        return "POINT", normals
    if domain == "CORNER":
        return domain, read(mesh.corner_normals, "vector", 3, np.float32)
    if domain == "POINT" or VERTEX_NORMAL in wanted:
        return domain, read(mesh.vertex_normals, "vector", 3, np.float32)
    return "FACE", None


def read_sharp_faces(mesh) -> np.ndarray | None:
    """(F,) uint8: not 0 where a face is flat; None where none is said to be."""
    sharp = mesh.attributes.get("sharp_face")
    return read(sharp.data, "value", 1, bool).view(np.uint8) if sharp and sharp.domain == "FACE" else None


def read_attributes(mesh, wanted: set[str], active_uv: str):
    for attribute in mesh.attributes:
        if attribute.name in wanted or ("" in wanted and attribute.name == active_uv):
            yield from read_one(attribute, attribute.name)
    colors = mesh.color_attributes
    if ACTIVE_COLOR in wanted and 0 <= colors.render_color_index < len(colors):
        yield from read_one(colors[colors.render_color_index], ACTIVE_COLOR)
    if UNDEFORMED in wanted:
        positions = read(mesh.vertices, "undeformed_co", 3, np.float32)
        yield Attribute(UNDEFORMED, "POINT", positions)
    if POINTINESS in wanted:
        yield Attribute(POINTINESS, "POINT", pointiness(mesh)[:, None])
    if ISLAND in wanted:
        numbers = native.module().random_by_island(read_edges(mesh), len(mesh.vertices))
        yield Attribute(ISLAND, "POINT", np.asarray(numbers)[:, None])


def read_edges(mesh) -> np.ndarray:
    return read(mesh.edges, "vertices", 2, np.int32)


def pointiness(mesh) -> np.ndarray:
    """(V,) float32: the angle between the normal and the mean of the edges, over pi, smoothed once over neighbours.

    Vertices in the same place count as one."""
    positions, normals = read_positions(mesh), read(mesh.vertex_normals, "vector", 3, np.float32)
    _, welded = np.unique(positions, axis=0, return_inverse=True)
    welded = welded.reshape(-1)
    count = int(welded.max()) + 1 if len(welded) else 0
    place = np.zeros((count, 3), np.float32)
    place[welded] = positions
    normal = summed(welded, normals, count)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-20)
    edges = np.unique(np.sort(welded[read_edges(mesh)], axis=1), axis=0)
    edges = edges[edges[:, 0] != edges[:, 1]]
    along = place[edges[:, 1]] - place[edges[:, 0]]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-20)
    ends = np.concatenate([edges[:, 0], edges[:, 1]])
    neighbours = np.bincount(ends, minlength=count)
    mean = summed(ends, np.concatenate([along, -along]), count) / np.maximum(neighbours, 1)[:, None]
    raw = np.arccos(np.clip((normal * mean).sum(1), -1.0, 1.0)) / np.pi
    raw[neighbours == 0] = 0.0
    others = np.bincount(ends, raw[np.concatenate([edges[:, 1], edges[:, 0]])], minlength=count)
    return ((raw + others) / (neighbours + 1))[welded].astype(np.float32)


def summed(index: np.ndarray, vectors: np.ndarray, count: int) -> np.ndarray:
    """Sums of vectors by index."""
    return np.stack([np.bincount(index, vectors[:, k], minlength=count) for k in range(3)], 1)


def read_one(attribute, name: str):
    """Nothing for what shaders cannot use: other types, and values on edges."""
    data = read_attribute(attribute) if attribute.domain in {"POINT", "CORNER", "FACE"} else None
    if data is not None:
        yield Attribute(name, attribute.domain, data)
