"""Which objects are exported, how often, where, with which materials and visibility."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from gi_engine.nodes.attributes import UNDEFORMED, attribute_name
from gi_engine.scene_data import CAMERA, DIFFUSE, SHADOW, VISIBLE_TO_ALL

from .conftest import add, grid, mesh, named, places


def material(name: str):
    found = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        found.use_nodes = True
    return found


def program_names(exported, instance) -> list[str]:
    return [exported.scene.programs[i].name for i in instance.materials]


def test_linked_duplicates_share_a_mesh(scene, render_export):
    data = grid(3)
    for i in range(3):
        add(scene, f"Copy {i}", data, location=(i, 0, 0))
    exported = render_export()
    assert len(exported.scene.meshes) == 1 and len(exported.scene.instances) == 3
    matrix = named(exported.scene.instances, "Copy 2").matrix
    np.testing.assert_array_equal(matrix, Matrix.Translation((2, 0, 0)))


def test_modifiers_and_their_render_levels_count(scene, render_export):
    subdivided = add(scene, "Smooth", mesh()).modifiers.new("Subdivision", "SUBSURF")
    subdivided.levels, subdivided.render_levels = 0, 3
    off = add(scene, "Plain", mesh()).modifiers.new("Array", "ARRAY")
    off.show_render = False
    exported = render_export()
    assert named(exported.scene.meshes, "Smooth").triangle_count == 2 * 4**3
    assert named(exported.scene.meshes, "Plain").triangle_count == 2


def test_hidden_objects_are_left_out(scene, render_export):
    add(scene, "Shown", mesh())
    add(scene, "Viewport only", mesh(), hide_render=True)
    add(scene, "Render only", mesh(), hide_viewport=True)
    unseen = add(scene, "No ray", mesh())
    for name in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(unseen, f"visible_{name}", False)
    hidden = bpy.data.collections.new("Hidden")
    hidden.hide_render = True
    scene.collection.children.link(hidden)
    hidden.objects.link(bpy.data.objects.new("In hidden collection", mesh()))
    exported = render_export()
    assert sorted(i.name for i in exported.scene.instances) == ["Render only", "Shown"]


def test_ray_visibility_and_holdout(scene, render_export):
    add(scene, "No camera", mesh(), visible_camera=False)
    add(scene, "No shadow", mesh(), visible_shadow=False, visible_diffuse=False)
    add(scene, "Held out", mesh(), is_holdout=True)
    exported = render_export().scene.instances
    assert named(exported, "No camera").visibility == VISIBLE_TO_ALL & ~CAMERA
    assert named(exported, "No shadow").visibility == VISIBLE_TO_ALL & ~SHADOW & ~DIFFUSE
    assert named(exported, "Held out").holdout and not named(exported, "No camera").holdout


def test_view_layers_override_per_collection(scene, render_export):
    inner = bpy.data.collections.new("Inner")
    scene.collection.children.link(inner)
    inner.objects.link(bpy.data.objects.new("Square", mesh()))
    add(scene, "Other", mesh())
    layers = [scene.view_layers[0], *(scene.view_layers.new(n) for n in ("held", "indirect", "excluded"))]
    layers[1].layer_collection.children["Inner"].holdout = True
    layers[2].layer_collection.children["Inner"].indirect_only = True
    layers[3].layer_collection.children["Inner"].exclude = True
    plain, held, indirect, excluded = (e.scene.instances for e in render_export(everything=True))
    assert not named(plain, "Square").holdout and named(plain, "Square").visibility == VISIBLE_TO_ALL
    assert named(held, "Square").holdout and not named(held, "Other").holdout
    assert named(indirect, "Square").visibility == VISIBLE_TO_ALL & ~CAMERA
    assert [i.name for i in excluded] == ["Other"]


def test_materials_by_object_by_data_and_missing(scene, render_export):
    data = mesh()
    for name in ("by data", "also by data"):
        data.materials.append(material(name))
    data.materials.append(None)
    add(scene, "Data", data)
    item = add(scene, "Object", data)
    item.material_slots[1].link = "OBJECT"
    item.material_slots[1].material = material("by object")
    add(scene, "Bare", mesh())
    exported = render_export()
    by_data = program_names(exported, named(exported.scene.instances, "Data"))
    by_object = program_names(exported, named(exported.scene.instances, "Object"))
    bare = program_names(exported, named(exported.scene.instances, "Bare"))
    assert by_data[:2] == ["by data", "also by data"]
    assert by_object[:2] == ["by data", "by object"]
    assert by_data[2] == by_object[2] == bare[0] and len(bare) == 1
    assert len(exported.scene.meshes) == 2  # slots do not make another mesh of one


def test_material_override_replaces_every_slot(scene, render_export):
    data = mesh()
    data.materials.append(material("own"))
    data.materials.append(None)
    add(scene, "Square", data)
    add(scene, "Bare", mesh())
    scene.view_layers[0].material_override = material("override")
    exported = render_export()
    for instance in exported.scene.instances:
        assert set(program_names(exported, instance)) == {"override"}


def curve_object(scene):
    data = bpy.data.curves.new("Tube", "CURVE")
    data.dimensions, data.bevel_depth = "3D", 0.1
    spline = data.splines.new("POLY")
    spline.points.add(2)
    for i, point in enumerate(spline.points):
        point.co = (i, i * i, 0, 1)
    return add(scene, "Tube", data)


def text_object(scene):
    data = bpy.data.curves.new("Text", "FONT")
    data.body, data.extrude = "gi", 0.1
    return add(scene, "Text", data)


def metaball_object(scene):
    data = bpy.data.metaballs.new("Blob")
    data.elements.new()
    return add(scene, "Blob", data)


def surface_object(scene):
    bpy.ops.surface.primitive_nurbs_surface_sphere_add()
    return bpy.context.object


@pytest.mark.parametrize("make", [curve_object, text_object, metaball_object, surface_object])
def test_what_is_not_a_mesh_comes_once_as_one(scene, render_export, make):
    item = make(scene)
    item.location = (1, 2, 3)
    item.data.materials.append(material("paint"))
    exported = render_export()
    instance = named(exported.scene.instances, item.name)
    assert program_names(exported, instance) == ["paint"]
    np.testing.assert_allclose(instance.matrix[:3, 3], (1, 2, 3))
    assert exported.scene.meshes[instance.mesh].triangle_count > 10


def test_collection_instances_nest(scene, render_export):
    inner, outer = bpy.data.collections.new("inner"), bpy.data.collections.new("outer")
    inner.objects.link(bpy.data.objects.new("Square", mesh()))
    inner.objects.link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))
    nested = bpy.data.objects.new("Nested", None)
    nested.location = (0, 0, 7)
    outer.objects.link(nested)
    for owner, collection in ((nested, inner), (add(scene, "Placed", None, location=(5, 0, 0)), outer)):
        owner.instance_type, owner.instance_collection = "COLLECTION", collection
    exported = render_export()
    np.testing.assert_allclose(named(exported.scene.instances, "Square").matrix[:3, 3], (5, 0, 7))
    np.testing.assert_allclose(named(exported.scene.lights, "Lamp").matrix[:3, 3], (5, 0, 7))


def test_duplicates_of_all_kinds_under_two_instancers(scene, render_export):
    """Each kind in its place, though Blender hands them out mixed and by the same temporary object."""
    duplicated = bpy.data.collections.new("Duplicated")
    for item in (
        bpy.data.objects.new("Quad", mesh()),
        bpy.data.objects.new("Unseen", mesh()),
        bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")),
        bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye")),
        bpy.data.objects.new("Nothing", None),
        curve_object(scene),
    ):
        item.location = (1, 0, 0)
        for collection in item.users_collection:
            collection.objects.unlink(item)
        duplicated.objects.link(item)
    unseen = duplicated.objects["Unseen"]
    for name in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(unseen, f"visible_{name}", False)
    for x in range(6):
        empty = add(scene, f"Empty {x}", None, location=(10 * x, 0, 0))
        empty.instance_type, empty.instance_collection = "COLLECTION", duplicated
        empty.visible_shadow = x != 0
    exported = render_export().scene
    curve = next(item.name for item in duplicated.objects if item.type == "CURVE")
    for name in ("Quad", curve):
        found = [i for i in exported.instances if i.name == name]
        assert sorted(place[0] for i in found for place in places(i)) == [1, 11, 21, 31, 41, 51]
        assert sum(i.count for i in found if not i.visibility & SHADOW) == 1
    assert {i.name for i in exported.instances} == {"Quad", curve}
    assert sorted(lamp.matrix[0, 3] for lamp in exported.lights if lamp.name == "Lamp") == [1, 11, 21, 31, 41, 51]


def test_vertex_instances(scene, render_export):
    carrier = add(scene, "Carrier", grid(4), instance_type="VERTS", show_instancer_for_render=False)
    leaf = add(scene, "Leaf", mesh())
    leaf.parent = carrier
    exported = render_export()
    (leaves,) = exported.scene.instances
    assert leaves.name == "Leaf" and leaves.count == len(carrier.data.vertices)
    np.testing.assert_allclose(places(leaves), sorted(list(v.co) for v in carrier.data.vertices), atol=1e-6)
    assert len(set(leaves.random.tolist())) > 20


def test_particle_instances(scene, render_export):
    emitter = add(scene, "Emitter", grid(4), show_instancer_for_render=False)
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    particles = emitter.particle_systems[0].settings
    particles.count, particles.frame_start, particles.frame_end, particles.lifetime = 50, 0, 0.5, 100
    particles.render_type, particles.instance_object = "OBJECT", add(scene, "Seed", mesh(), hide_render=True)
    bpy.context.view_layer.update()
    scene.frame_set(1)
    scene.frame_set(2)
    exported = render_export()
    (seeds,) = exported.scene.instances
    assert (seeds.name, seeds.count, len(exported.scene.meshes)) == ("Seed", 50, 1)


def geometry_nodes(build):
    group = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    build(group, group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput"))
    return group


def test_geometry_nodes_instances(scene, render_export):
    def scatter(group, start, end):
        cube = group.nodes.new("GeometryNodeMeshCube")
        points = group.nodes.new("GeometryNodeInstanceOnPoints")
        group.links.new(start.outputs[0], points.inputs["Points"])
        group.links.new(cube.outputs["Mesh"], points.inputs["Instance"])
        group.links.new(points.outputs[0], end.inputs[0])

    carrier = add(scene, "Carrier", grid(3), location=(0, 0, 1))
    carrier.modifiers.new("Nodes", "NODES").node_group = geometry_nodes(scatter)
    exported = render_export()
    (cubes,) = exported.scene.instances
    assert cubes.count == 16 and len(exported.scene.meshes) == 1
    assert exported.scene.meshes[0].triangle_count == 12
    expected = sorted((np.array(v.co) + (0, 0, 1)).tolist() for v in carrier.data.vertices)
    np.testing.assert_allclose(places(cubes), expected, atol=1e-6)
    assert not exported.warnings


def test_objects_of_unsupported_kinds_are_named(scene, render_export):
    add(scene, "Cloud", bpy.data.volumes.new("Cloud"))
    messages = render_export().warnings
    assert any('"Cloud"' in m and "volume" in m for m in messages)


def test_what_objects_ask_for_in_vain_is_named(scene, render_export):
    add(scene, "Catcher", mesh(), is_shadow_catcher=True)
    lamp = add(scene, "Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.light_linking.receiver_collection = bpy.data.collections.new("Receivers")
    scene.render.use_motion_blur = True
    messages = render_export().warnings
    for words in (('"Catcher"', "shadow catcher"), ('"Lamp"', "light linking"), ("motion blur",)):
        assert any(all(word in message for word in words) for message in messages), words


def test_view_layers_can_leave_out_surfaces_and_sky(scene, render_export):
    add(scene, "Square", mesh())
    add(scene, "Lamp", bpy.data.lights.new("Lamp", "POINT"))
    scene.world = bpy.data.worlds.new("World")
    scene.view_layers[0].use_sky = False
    exported = render_export().scene
    assert exported.world.program == -1 and len(exported.instances) == 1
    scene.view_layers[0].use_sky, scene.view_layers[0].use_solid = True, False
    exported = render_export().scene
    assert exported.world.program >= 0 and not exported.instances and len(exported.lights) == 1


def test_singular_and_not_finite_matrices(scene, render_export):
    add(scene, "Flattened", mesh(), scale=(1, 1, 0))
    add(scene, "Mirrored", mesh(), scale=(-1, 1, 1))
    add(scene, "Point", mesh(), scale=(0, 0, 1))
    add(scene, "Gone", mesh(), location=(float("nan"), 0, 0))
    exported = render_export()
    assert sorted(i.name for i in exported.scene.instances) == ["Flattened", "Mirrored"]
    (message,) = exported.warnings
    assert '"Point"' in message and '"Gone"' in message and "matrix" in message


def test_empty_meshes_are_named_but_instancers_are_not(scene, render_export):
    add(scene, "Hollow", mesh(faces=[]))
    add(scene, "Solid", mesh())
    (message,) = render_export().warnings
    assert '"Hollow"' in message and "no faces" in message and "Solid" not in message


def test_a_long_list_of_names_is_cut(scene, render_export):
    for i in range(12):
        add(scene, f"Hollow {i:02}", mesh(faces=[]))
    (message,) = render_export().warnings
    assert '"Hollow 04" and 7 more' in message


def reading(*names: str):
    """A material whose colour is read from attributes: "OBJECT color", "GEOMETRY uv", …"""
    found = material("reader")
    tree = found.node_tree
    for i, entry in enumerate(names):
        kind, _, name = entry.partition(" ")
        node = tree.nodes.new("ShaderNodeAttribute")
        node.attribute_type, node.attribute_name = kind, name
        tree.links.new(node.outputs["Fac"], tree.nodes["Principled BSDF"].inputs[("Roughness", "Metallic", "IOR")[i]])
    return found


def test_object_and_instancer_attributes(scene, render_export):
    data = mesh()
    data.materials.append(reading("OBJECT weight", "INSTANCER weight", "OBJECT color"))
    data["weight"] = 1.5
    leaf = add(scene, "Leaf", data, color=(0.1, 0.2, 0.3, 0.4))
    carrier = add(scene, "Carrier", grid(1), instance_type="VERTS", show_instancer_for_render=False)
    carrier["weight"] = (7, 8)
    leaf.parent = carrier
    (leaves,) = render_export().scene.instances
    found = leaves.attributes
    assert found[attribute_name("OBJECT", "weight")] == pytest.approx((1.5, 1.5, 1.5, 1))
    assert found[attribute_name("INSTANCER", "weight")] == pytest.approx((7, 8, 0, 1))
    assert found[attribute_name("OBJECT", "color")] == pytest.approx((0.1, 0.2, 0.3, 0.4))


def test_only_attributes_that_materials_read_are_taken_along(scene, render_export):
    data = grid(2)
    data.attributes.new("read", "FLOAT", "POINT")
    data.attributes.new("ignored", "FLOAT", "POINT")
    data.materials.append(reading("GEOMETRY read", "GEOMETRY missing"))
    add(scene, "Grid", data)
    assert [a.name for a in render_export().scene.meshes[0].attributes] == ["read"]


@pytest.mark.parametrize("by", ["modifier", "shape key"])
def test_generated_coordinates_are_those_before_deformation(scene, render_export, by):
    data = grid(2)
    paint = material("paint")
    noise = paint.node_tree.nodes.new("ShaderNodeTexNoise")
    paint.node_tree.links.new(noise.outputs[0], paint.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    data.materials.append(paint)
    item = add(scene, "Grid", data)
    before = np.array([v.co[:] for v in data.vertices])
    if by == "modifier":
        lift = item.modifiers.new("Lift", "DISPLACE")
        lift.direction, lift.strength, lift.mid_level = "Z", 5, 0
    else:
        item.shape_key_add(name="Basis")
        lifted = item.shape_key_add(name="Lifted")
        lifted.value = 1
        for point in lifted.data:
            point.co.z += 5
    exported = render_export().scene.meshes[0]
    (undeformed,) = [a for a in exported.attributes if a.name == UNDEFORMED]
    np.testing.assert_allclose(undeformed.data, before, atol=1e-5)
    np.testing.assert_allclose(exported.positions, before + (0, 0, 5), atol=1e-5)


def test_random_is_what_cycles_makes_of_the_name(scene, render_export):
    """Cycles renders the object's Random as emission; the export must give the same number."""
    glow = material("glow")
    nodes = glow.node_tree.nodes
    nodes.clear()
    emission, info, output = (nodes.new(f"ShaderNode{n}") for n in ("Emission", "ObjectInfo", "OutputMaterial"))
    glow.node_tree.links.new(info.outputs["Random"], emission.inputs["Color"])
    glow.node_tree.links.new(emission.outputs[0], output.inputs["Surface"])
    data = mesh(vertices=[(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)])
    data.materials.append(glow)
    add(scene, "Äpfel.001", data)
    random = named(render_export().scene.instances, "Äpfel.001").random
    assert render_cycles(scene)[..., 0] == pytest.approx(random, abs=1e-6)


def render_cycles(scene) -> np.ndarray:
    """(height, width, 4) of the scene in Cycles, scene-linear."""
    import tempfile
    from pathlib import Path

    scene.render.engine, scene.cycles.use_denoising = "CYCLES", False
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "cycles.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(image.size[1], image.size[0], 4)


@pytest.mark.parametrize("diced", [False, True])
def test_adaptive_subdivision_is_named_and_its_fixed_levels_rendered(scene, render_export, diced):
    item = add(scene, "Board", mesh())
    modifier = item.modifiers.new("Subdivision", "SUBSURF")
    modifier.render_levels = 2
    owner = modifier
    if not hasattr(modifier, "use_adaptive_subdivision"):
        scene.cycles.feature_set, owner = "EXPERIMENTAL", item.cycles
    owner.use_adaptive_subdivision = diced
    exported = render_export()
    assert any("adaptive subdivision" in text and "Board" in text for text in exported.warnings) == diced
    assert exported.scene.meshes[0].triangle_count == 16 * 2
