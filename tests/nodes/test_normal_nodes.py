"""Nodes that change normals, tangents and attributes, against Cycles."""

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix


@pytest.mark.parametrize("invert", [False, True])
@pytest.mark.parametrize("strength", [1.0, 0.4])
def test_bump(stage, invert, strength):
    node = stage.new("ShaderNodeBump", invert=invert)
    node.inputs["Strength"].default_value, node.inputs["Distance"].default_value = strength, 0.05
    stage.link(stage.waves(), node.inputs["Height"])
    stage.show(node.outputs[0])
    # One-sided differences over steps of the surface that the engines take in different directions.
    stage.check(tolerance=3e-3)


def test_bump_of_attribute_and_bump(stage):
    """Heights from UV maps move with the barycentrics; a bump on a bump."""
    first, second = stage.new("ShaderNodeBump"), stage.new("ShaderNodeBump")
    for node in (first, second):
        node.inputs["Distance"].default_value = 0.2
    apart = stage.new("ShaderNodeSeparateXYZ")
    stage.link(stage.new("ShaderNodeUVMap", uv_map="Second").outputs[0], apart.inputs[0])
    stage.link(apart.outputs["Y"], first.inputs["Height"])
    stage.link(stage.waves(4.0), second.inputs["Height"])
    stage.link(first.outputs[0], second.inputs["Normal"])
    stage.show(second.outputs[0])
    stage.check(tolerance=3e-3)


def test_bump_without_height(stage):
    stage.show(stage.new("ShaderNodeBump").outputs[0])
    stage.check()


@pytest.mark.parametrize("space", ["OBJECT", "WORLD"])
def test_displacement_as_bump(stage, space):
    node = stage.new("ShaderNodeDisplacement", space=space)
    node.inputs["Scale"].default_value = 0.05
    stage.link(stage.waves(4.0), node.inputs["Height"])
    output = next(n for n in stage.tree.nodes if n.type == "OUTPUT_MATERIAL")
    stage.link(node.outputs[0], output.inputs["Displacement"])
    stage.material.displacement_method = "BUMP"
    stage.show(stage.new("ShaderNodeNewGeometry").outputs["Normal"])
    stage.check(tolerance=3e-3)
    assert not stage.warnings


def color(stage):
    node = stage.new("ShaderNodeVectorMath", operation="MULTIPLY_ADD")
    stage.link(stage.new("ShaderNodeTexCoord").outputs["UV"], node.inputs[0])
    node.inputs[1].default_value, node.inputs[2].default_value = (0.3, 0.2, 0.0), (0.4, 0.4, 0.9)
    return node.outputs[0]


@pytest.mark.parametrize("strength", [1.0, 0.5, 1.7])
@pytest.mark.parametrize("space", ["TANGENT", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD"])
def test_normal_map(stage, space, strength):
    node = stage.new("ShaderNodeNormalMap", space=space)
    node.inputs["Strength"].default_value = strength
    stage.link(color(stage), node.inputs["Color"])
    stage.show(node.outputs[0])
    stage.check(tolerance=5e-4)


def test_normal_map_names_its_uv_map(stage):
    node = stage.new("ShaderNodeNormalMap", uv_map="Second")
    stage.link(color(stage), node.inputs["Color"])
    stage.show(node.outputs[0])
    stage.check(tolerance=5e-4)


def mirrored_and_torn_uvs(mesh, _):
    """The UVs of every third face are mirrored, of every fifth of no area: tangents then differ by corner."""
    uv = np.empty(2 * len(mesh.loops), np.float32)
    layer = mesh.uv_layers["First"].uv
    layer.foreach_get("vector", uv)
    uv = uv.reshape(-1, 4, 2)
    uv[::3, :, 0] *= -1.0
    uv[::5] = uv[::5, :1]
    layer.foreach_set("vector", uv.ravel())


def flat_faces(mesh, _):
    mesh.shade_flat()


def no_uvs(mesh, item):
    """A sphere's about the origin stand in. Away from that sphere's seam, where Cycles and this engine go different ways."""
    mesh.transform(Matrix.Translation((0.0, 3.0, 0.0)))
    item.matrix_basis = item.matrix_basis @ Matrix.Translation((0.0, -3.0, 0.0))
    while mesh.uv_layers:
        mesh.uv_layers.remove(mesh.uv_layers[0])


def many_corners(mesh, _):
    """One face of many corners and some triangles, with sharp edges."""
    grid = bmesh.new()
    grid.from_mesh(mesh)
    grid.faces.ensure_lookup_table()
    bmesh.ops.dissolve_faces(grid, faces=grid.faces[30:33])
    grid.faces.ensure_lookup_table()
    bmesh.ops.triangulate(grid, faces=grid.faces[:20])
    for edge in list(grid.edges)[::4]:
        edge.smooth = False
    grid.to_mesh(mesh)
    grid.free()


@pytest.mark.parametrize("node", ["NormalMap", "Tangent"])
@pytest.mark.parametrize("change", [mirrored_and_torn_uvs, flat_faces, no_uvs, many_corners])
def test_tangents_of_meshes(stage, change, node):
    change(stage.object.data, stage.object)
    if node == "Tangent":
        made = stage.new("ShaderNodeTangent", direction_type="UV_MAP")
    else:
        made = stage.new("ShaderNodeNormalMap")
        made.inputs["Color"].default_value = (0.8, 0.3, 0.9, 1.0)
    stage.show(made.outputs[0])
    stage.check(tolerance=5e-4)


@pytest.mark.parametrize(("direction", "axis"), [("RADIAL", "X"), ("RADIAL", "Y"), ("RADIAL", "Z"), ("UV_MAP", "Z")])
def test_tangent(stage, direction, axis):
    node = stage.new("ShaderNodeTangent", direction_type=direction, axis=axis)
    stage.show(node.outputs[0])
    stage.check(tolerance=5e-4)


@pytest.mark.parametrize("output", ["Color", "Vector", "Fac", "Alpha"])
@pytest.mark.parametrize("name", ["number", "vector", "paint", "First", "missing"])
def test_attribute(stage, name, output):
    stage.show(stage.new("ShaderNodeAttribute", attribute_name=name).outputs[output])
    stage.check()


@pytest.mark.parametrize("name", ["custom", "color", "location"])
@pytest.mark.parametrize("kind", ["OBJECT", "INSTANCER"])
def test_property_of_object(stage, name, kind):
    stage.show(stage.new("ShaderNodeAttribute", attribute_type=kind, attribute_name=name).outputs["Color"])
    stage.check()


def test_property_of_view_layer(stage):
    stage.scene["wind"] = 0.25
    stage.show(stage.new("ShaderNodeAttribute", attribute_type="VIEW_LAYER", attribute_name="wind").outputs["Fac"])
    assert stage.check().any()


@pytest.mark.parametrize("output", ["Color", "Alpha"])
@pytest.mark.parametrize("name", ["paint", "", "missing"])
def test_color_attribute(stage, name, output):
    stage.show(stage.new("ShaderNodeVertexColor", layer_name=name).outputs[output])
    stage.check()


@pytest.mark.parametrize("name", ["First", "Second", ""])
def test_uv_map(stage, name):
    stage.show(stage.new("ShaderNodeUVMap", uv_map=name).outputs[0])
    stage.check()


@pytest.mark.parametrize("pixels", [False, True])
def test_wireframe(stage, pixels):
    node = stage.new("ShaderNodeWireframe", use_pixel_size=pixels)
    node.inputs[0].default_value = 0.8 if pixels else 0.05
    stage.show(node.outputs[0])
    stage.check(outliers=0.08 if pixels else 0.02)


def test_coordinates_of_another_object(stage):
    empty = bpy.data.objects.new("Empty", None)
    empty.location, empty.rotation_euler, empty.scale = (1, 2, 3), (0.3, 0.2, 0.9), (2, 1, 0.5)
    stage.scene.collection.objects.link(empty)
    stage.show(stage.new("ShaderNodeTexCoord", object=empty).outputs["Object"])
    stage.check()


def test_generated_of_deformed_mesh(stage):
    """Generated stays with the mesh as it was before modifiers moved it."""
    modifier = stage.object.modifiers.new("Bend", "SIMPLE_DEFORM")
    modifier.deform_method, modifier.angle = "BEND", 1.0
    stage.show(stage.new("ShaderNodeTexCoord").outputs["Generated"])
    stage.check()


@pytest.mark.parametrize("output", ["Generated", "Normal", "Object", "Camera", "Window", "Reflection"])
def test_world(stage, output):
    world = stage.scene.world = bpy.data.worlds.new("World")
    world.use_nodes = True
    nodes = world.node_tree.nodes
    world.node_tree.links.new(nodes.new("ShaderNodeTexCoord").outputs[output], nodes["Background"].inputs["Color"])
    stage.scene.collection.objects.unlink(stage.object)
    stage.check()
