"""Evaluated meshes to scene_data.Mesh.

Arrays go over as Blender holds them (corners, faces, vertices); expanding them to triangles is the native side's work.
"""

from __future__ import annotations

import numpy as np

from ..nodes.attributes import ACTIVE_COLOR, UNDEFORMED
from ..scene_data import Attribute, Mesh
from .arrays import read, read_attribute, triangle_corners



def export_mesh(mesh, name: str, wanted: set[str]) -> Mesh | None:
    """Reads an evaluated bpy Mesh; None if it has no triangles.

    `wanted` names the attributes to take along ("" is the UV map that renders by default).
    """
    if not mesh.polygons:
        return None
    tri_corner = triangle_corners(mesh)
    if not len(tri_corner):
        return None
    domain, normals = read_normals(mesh)
    material = mesh.attributes.get("material_index")  # absent where all are 0
    active_uv = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    return Mesh(
        name=name,
        positions=read_positions(mesh),
        corner_vert=read(mesh.attributes[".corner_vert"].data, "value", 1, np.int32),
        tri_corner=tri_corner,
        tri_face=read(mesh.loop_triangle_polygons, "value", 1, np.int32),
        face_material=read(material.data, "value", 1, np.int32) if material else None,
        normals_domain=domain,
        normals=normals,
        attributes=list(read_attributes(mesh, wanted, active_uv)),
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
        needed = attribute.name in wanted or ("" in wanted and attribute.name == active_uv)
        if not needed or attribute.domain not in {"POINT", "CORNER", "FACE"}:
            continue
        data = read_attribute(attribute)
        if data is not None:
            yield Attribute(attribute.name, attribute.domain, data)
    colors = mesh.color_attributes
    if ACTIVE_COLOR in wanted and 0 <= colors.render_color_index < len(colors):
        color = colors[colors.render_color_index]
        yield Attribute(ACTIVE_COLOR, color.domain, read_attribute(color))
    if UNDEFORMED in wanted:
        yield Attribute(UNDEFORMED, "POINT", read(mesh.vertices, "undeformed_co", 3, np.float32))
