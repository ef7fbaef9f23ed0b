"""Evaluated meshes to scene_data.Mesh.

Arrays go over as Blender holds them (corners, faces, vertices); expanding them to triangles is the native side's work.
"""

from __future__ import annotations

import numpy as np

from ..nodes.attributes import ACTIVE_COLOR, UNDEFORMED
from ..scene_data import Attribute, Mesh
from .arrays import is_triangulated, read, read_attribute, triangle_corners


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
    domain, normals = read_normals(mesh)
    material = mesh.attributes.get("material_index")  # absent where all are 0
    if not deformed:
        wanted = wanted - {UNDEFORMED}  # slow to read, and no different from the positions
    active_uv = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    attributes = list(read_attributes(mesh, wanted, active_uv))
    by_face = material is not None or any(attribute.domain == "FACE" for attribute in attributes)
    return Mesh(
        name=name,
        positions=read_positions(mesh),
        corner_vert=read(mesh.attributes[".corner_vert"].data, "value", 1, np.int32),
        tri_corner=tri_corner,
        tri_face=read(mesh.loop_triangle_polygons, "value", 1, np.int32) if by_face and not triangulated else None,
        face_material=read(material.data, "value", 1, np.int32) if material else None,
        normals_domain=domain,
        normals=normals,
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


def read_normals(mesh) -> tuple[str, np.ndarray | None]:
    # Corner normals hold sharp edges and custom normals; asking for them where they are not needed costs
    # memory that Blender keeps.
    domain = mesh.normals_domain
    if domain == "CORNER":
        return domain, read(mesh.corner_normals, "vector", 3, np.float32)
    if domain == "POINT":
        return domain, read(mesh.vertex_normals, "vector", 3, np.float32)
    return "FACE", None


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


def read_one(attribute, name: str):
    """Nothing for what shaders cannot use: other types, and values on edges."""
    data = read_attribute(attribute) if attribute.domain in {"POINT", "CORNER", "FACE"} else None
    if data is not None:
        yield Attribute(name, attribute.domain, data)
