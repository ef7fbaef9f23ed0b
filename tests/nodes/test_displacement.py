"""True displacement, against Cycles pixel by pixel: where the surface is, how it is shaded, and what textures see on it."""

import bpy
import numpy as np
import pytest

MOVED = ["DISPLACEMENT", "BOTH"]


def displace(stage, method, idname="ShaderNodeDisplacement", material=None, scale=0.25, **settings):
    node = stage.new(idname, **settings)
    node.inputs["Scale"].default_value, node.inputs["Midlevel"].default_value = scale, 0.2
    if idname == "ShaderNodeDisplacement":
        stage.link(stage.waves(4.0), node.inputs["Height"])
    else:
        whole = stage.new("ShaderNodeCombineXYZ")
        for i, frequency in enumerate((3.0, 4.0, 5.0)):
            stage.link(stage.waves(frequency), whole.inputs[i])
        stage.link(whole.outputs[0], node.inputs["Vector"])
    output = next(n for n in stage.tree.nodes if n.type == "OUTPUT_MATERIAL")
    stage.link(node.outputs[0], output.inputs["Displacement"])
    stage.material.displacement_method = method


SHOWN = {
    "position": ("ShaderNodeNewGeometry", "Position"),
    "normal": ("ShaderNodeNewGeometry", "Normal"),
    "true normal": ("ShaderNodeNewGeometry", "True Normal"),
    "object": ("ShaderNodeTexCoord", "Object"),
    "generated": ("ShaderNodeTexCoord", "Generated"),
    "tangent": ("ShaderNodeTangent", "Tangent"),
}


def show(stage, what):
    idname, output = SHOWN[what]
    node = stage.new(idname)
    if what == "tangent":
        node.direction_type = "UV_MAP"
    stage.show(node.outputs[output])


def see_from_below(stage):
    stage.scene.camera.location = (0.3, -2.0, -2.2)
    stage.scene.camera.rotation_euler = (2.3, 0.05, 0.1)


def tolerance_of(method, what):
    # Bumps are differences over small steps.
    return 4e-3 if method != "DISPLACEMENT" and what in {"normal", "tangent"} else 1e-3


@pytest.mark.parametrize("what", SHOWN)
@pytest.mark.parametrize("method", MOVED)
def test_displaced(stage, method, what):
    displace(stage, method)
    show(stage, what)
    stage.check(tolerance=tolerance_of(method, what))
    assert not stage.warnings


@pytest.mark.parametrize("what", ["position", "normal"])
@pytest.mark.parametrize("method", MOVED)
def test_flat_faces(stage, method, what):
    stage.object.data.shade_flat()
    displace(stage, method)
    show(stage, what)
    stage.check(tolerance=tolerance_of(method, what))


@pytest.mark.parametrize("what", ["position", "normal"])
@pytest.mark.parametrize("method", ["DISPLACEMENT", "BOTH", "BUMP"])
def test_sharp_edges_and_flat_faces_among_smooth_ones(stage, method, what):
    """Up to Blender 4.5 sharp edges part a mesh, and what moves then shows gaps."""
    stage.harden()
    vertices = len(stage.object.data.vertices)
    displace(stage, method)
    show(stage, what)
    ours = stage.check(tolerance=tolerance_of(method, what))
    assert len(stage.object.data.vertices) == vertices
    assert np.array_equal(ours, stage.ours())


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("coordinates", ["Object", "UV"])
@pytest.mark.parametrize("method", ["DISPLACEMENT", "BOTH", "BUMP"])
def test_seen_from_behind(stage, method, coordinates, mirrored):
    see_from_below(stage)
    if mirrored:
        stage.object.scale.x *= -1
    displace(stage, method)
    node = next(n for n in stage.tree.nodes if n.bl_idname == "ShaderNodeTexCoord")
    for link in list(node.outputs["Object"].links):
        stage.link(node.outputs[coordinates], link.to_socket)
    show(stage, "normal")
    stage.check(tolerance=tolerance_of(method, "normal"))


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("space", ["OBJECT", "WORLD"])
def test_flat_and_in_both_spaces(stage, space, flat):
    if flat:
        stage.object.data.shade_flat()
    displace(stage, "DISPLACEMENT", space=space)
    show(stage, "position")
    stage.check(tolerance=1e-3)


@pytest.mark.parametrize("what", ["position", "normal"])
@pytest.mark.parametrize("method", MOVED)
@pytest.mark.parametrize("space", ["TANGENT", "OBJECT", "WORLD"])
def test_vectors(stage, space, method, what):
    displace(stage, method, "ShaderNodeVectorDisplacement", space=space)
    show(stage, what)
    stage.check(tolerance=tolerance_of(method, what))


@pytest.mark.parametrize("base", ["ORIGINAL", "DISPLACED"] if bpy.app.version >= (5, 0, 0) else [None])
@pytest.mark.parametrize("method", ["DISPLACEMENT", "BOTH"])
def test_normal_maps(stage, method, base):
    displace(stage, method)
    node = stage.new("ShaderNodeNormalMap", **({"base": base} if base else {}))  # the choice came with Blender 5
    node.inputs["Color"].default_value, node.inputs["Strength"].default_value = (0.7, 0.4, 0.8, 1.0), 0.7
    stage.show(node.outputs[0])
    stage.check(tolerance=tolerance_of(method, "normal"))


@pytest.mark.parametrize("second_method", [*MOVED, "BUMP"])
def test_faces_of_two_materials(stage, second_method):
    """What both have is moved once, as the first face says; normals are made of those faces alone that displacement shapes."""
    plain = stage.material.copy()
    displace(stage, "DISPLACEMENT")
    show(stage, "normal")
    second = stage.material.copy()
    second.displacement_method = second_method
    node = next(n for n in second.node_tree.nodes if n.bl_idname == "ShaderNodeDisplacement")
    node.inputs["Scale"].default_value = -0.3
    mesh = stage.object.data
    mesh.materials.append(second)
    mesh.materials.append(plain)
    columns = round(len(mesh.polygons) ** 0.5)
    mesh.polygons.foreach_set("material_index", [(k // columns) // 4 for k in range(len(mesh.polygons))])
    stage.check(tolerance=4e-3 if second_method != "DISPLACEMENT" else 1e-3)


def add_second(stage):
    second = bpy.data.objects.new("Second", stage.object.data)
    second.location, second.scale = (0.4, 1.2, 0.6), (1.0, 1.3, 0.8)
    stage.scene.collection.objects.link(second)
    return second


def test_what_objects_share_is_moved_once(stage):
    """Two objects of one mesh; what the first one's material says holds for both, and the mesh itself stays as it was."""
    add_second(stage)
    before = np.array([v.co for v in stage.object.data.vertices])
    displace(stage, "DISPLACEMENT")
    show(stage, "position")
    stage.check(tolerance=1e-3)
    assert np.array_equal(before, np.array([v.co for v in stage.object.data.vertices]))
    again = stage.ours()
    assert np.array_equal(again, stage.ours())


def test_objects_with_materials_of_their_own_are_moved_apart(stage):
    second = add_second(stage)
    displace(stage, "DISPLACEMENT")
    show(stage, "position")
    second.material_slots[0].link = "OBJECT"
    second.material_slots[0].material = other = stage.material.copy()
    node = next(n for n in other.node_tree.nodes if n.bl_idname == "ShaderNodeDisplacement")
    node.inputs["Scale"].default_value = -0.2
    stage.check(tolerance=1e-3)


def test_images_move_what_they_cover(stage):
    image = bpy.data.images.new("Heights", 8, 8, float_buffer=True)
    image.pixels.foreach_set(np.random.default_rng(3).random(256).astype(np.float32))
    image.update()
    texture = stage.new("ShaderNodeTexImage", interpolation="Linear")
    texture.image = image
    node = stage.new("ShaderNodeDisplacement")
    node.inputs["Scale"].default_value = 0.2
    stage.link(texture.outputs["Color"], node.inputs["Height"])
    output = next(n for n in stage.tree.nodes if n.type == "OUTPUT_MATERIAL")
    stage.link(node.outputs[0], output.inputs["Displacement"])
    stage.material.displacement_method = "DISPLACEMENT"
    show(stage, "normal")
    stage.check(tolerance=1e-3)


def test_nothing_to_trace_yet(stage):
    """Nodes that trace rays meet nothing while the surface is displaced: all is open."""
    node = stage.new("ShaderNodeDisplacement")
    node.inputs["Height"].default_value = 1.0
    stage.link(stage.new("ShaderNodeAmbientOcclusion").outputs["AO"], node.inputs["Height"])
    output = next(n for n in stage.tree.nodes if n.type == "OUTPUT_MATERIAL")
    stage.link(node.outputs[0], output.inputs["Displacement"])
    stage.material.displacement_method = "DISPLACEMENT"
    show(stage, "position")
    traced = stage.ours()
    for link in list(node.inputs["Height"].links):
        stage.tree.links.remove(link)
    np.testing.assert_array_equal(traced, stage.ours())
