"""Exported arrays against Blender's slow, element-wise accessors."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from gi_engine.export.mesh import export_mesh

from .conftest import add, grid, mesh


def evaluated(item):
    return item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data


def check_geometry(data, exported) -> None:
    assert exported.positions.shape == (len(data.vertices), 3)
    np.testing.assert_array_equal(exported.positions, [v.co[:] for v in data.vertices])
    triangles = [[data.loops[c].vertex_index for c in t.loops] for t in data.loop_triangles]
    corners = slice(None) if exported.tri_corner is None else exported.tri_corner
    np.testing.assert_array_equal(exported.corner_vert[corners].reshape(-1, 3), triangles)
    assert exported.triangle_count == len(triangles)
    slots = [p.material_index for p in data.polygons]
    if not any(slots):
        assert exported.face_material is None and exported.tri_face is None
        return
    faces = np.arange(len(triangles)) if exported.tri_corner is None else exported.tri_face
    np.testing.assert_array_equal(faces, [t.polygon_index for t in data.loop_triangles])
    np.testing.assert_array_equal(exported.face_material, slots)


def test_geometry_of_a_mixed_mesh(scene):
    # A triangle, a quad, a concave pentagon and a loose edge: triangulation is not trivial.
    vertices = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 0.5, 0), (0, 2, 0), (3, 0, 1), (3, 2, 1), (4, 1, 0), (5, 5, 5)]
    data = mesh(vertices=vertices, faces=[(0, 1, 2, 3, 4), (1, 5, 6, 2), (5, 7, 6)])
    data.polygons[1].material_index = 3
    item = add(scene, "Mixed", data)
    found = evaluated(item)
    check_geometry(found, export_mesh(found, "Mixed", set()))


@pytest.mark.parametrize("slots", [1, 3])
def test_geometry_of_triangles_alone(scene, slots):
    """Goes over as it is."""
    data = mesh(
        vertices=np.random.default_rng(1).random((9, 3)).tolist(), faces=[(0, 1, 2), (4, 3, 1), (8, 5, 2), (2, 6, 7)]
    )
    if slots > 1:
        data.polygons[2].material_index = slots - 1
    found = evaluated(add(scene, "Triangles", data))
    exported = export_mesh(found, "Triangles", set())
    assert exported.tri_corner is None and exported.tri_face is None
    found.calc_loop_triangles()
    corners = [tuple(t.loops) for t in found.loop_triangles]
    assert corners == [(k, k + 1, k + 2) for k in range(0, 12, 3)]
    assert [t.polygon_index for t in found.loop_triangles] == [0, 1, 2, 3]
    assert exported.corner_vert.tolist() == [0, 1, 2, 4, 3, 1, 8, 5, 2, 2, 6, 7]
    assert (exported.face_material is None) == (slots == 1)


def test_a_face_of_two_corners_is_not_a_triangle(scene):
    data = mesh(vertices=[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], faces=[(0, 1), (0, 1, 2, 3)])
    exported = export_mesh(data, "Odd", set())
    assert exported.triangle_count == 2


def test_geometry_without_materials(scene):
    found = evaluated(add(scene, "Grid", grid(4)))
    check_geometry(found, export_mesh(found, "Grid", set()))


@pytest.mark.parametrize("smoothing", ["flat", "smooth", "sharp edge", "custom"])
def test_normals_are_those_that_blender_shades_with(scene, smoothing):
    data = grid(5)
    if smoothing == "flat":
        data.shade_flat()
    if smoothing == "sharp edge":
        data.edges[20].use_edge_sharp = True
    if smoothing == "custom":
        data.normals_split_custom_set_from_vertices([(0.6, 0, 0.8)] * len(data.vertices))
    found = evaluated(add(scene, "Bent", data))
    exported = export_mesh(found, "Bent", set())
    expected = np.array([n.vector[:] for n in found.corner_normals], np.float32)
    if smoothing == "flat":
        assert exported.normals_domain == "FACE" and exported.normals is None
        return
    by_corner = exported.normals if exported.normals_domain == "CORNER" else exported.normals[exported.corner_vert]
    np.testing.assert_allclose(by_corner, expected, atol=1e-6)
    assert exported.normals_domain == ("POINT" if smoothing == "smooth" else "CORNER")


def test_attributes_of_every_type_and_domain(scene):
    data = grid(3)
    kinds = [
        ("FLOAT", "value", 1), ("INT", "value", 1), ("BOOLEAN", "value", 1), ("FLOAT2", "vector", 2),
        ("FLOAT_VECTOR", "vector", 3), ("FLOAT_COLOR", "color", 4), ("BYTE_COLOR", "color", 4),
    ]  # fmt: skip
    rng = np.random.default_rng(1)
    for kind, prop, n in kinds:
        for domain in ("POINT", "CORNER", "FACE"):
            attribute = data.attributes.new(f"{kind} {domain}", kind, domain)
            values = rng.integers(0, 2, len(attribute.data) * n)
            attribute.data.foreach_set(prop, values.astype({"INT": np.int32, "BOOLEAN": bool}.get(kind, np.float32)))
    data.attributes.new("unwanted", "FLOAT", "POINT")
    found = evaluated(add(scene, "Grid", data))
    wanted = {a.name for a in found.attributes} - {"unwanted"}
    exported = {a.name: a for a in export_mesh(found, "Grid", wanted).attributes}
    assert "unwanted" not in exported
    for kind, prop, n in kinds:
        for domain in ("POINT", "CORNER", "FACE"):
            attribute = exported[f"{kind} {domain}"]
            assert attribute.domain == domain
            assert attribute.data.shape == (len(found.attributes[attribute.name].data), n)
            expected = [np.ravel(getattr(e, prop)) for e in found.attributes[attribute.name].data]
            np.testing.assert_allclose(attribute.data, np.array(expected, np.float32), atol=1e-6)


def test_the_uv_map_that_renders_is_the_active_one(scene):
    data = grid(2)
    second = data.uv_layers.new(name="Second")
    second.active_render = True
    found = evaluated(add(scene, "Grid", data))
    exported = export_mesh(found, "Grid", {""})
    assert exported.active_uv == "Second"
    assert [a.name for a in exported.attributes] == ["Second"]


def test_a_mesh_without_faces_is_none(scene):
    assert export_mesh(evaluated(add(scene, "Empty", mesh(faces=[]))), "Empty", set()) is None
    assert export_mesh(evaluated(add(scene, "Nothing", mesh(vertices=[], faces=[]))), "Nothing", set()) is None
