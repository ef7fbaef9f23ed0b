"""Things that people do to a scene, each drawn at random: what a viewport has to keep up with. edit(rng) changes bpy.data; those that
cannot be done just now do nothing."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from .conftest import add, mesh


def objects(*kinds):
    return sorted((o for o in bpy.context.scene.objects if o.type in kinds), key=lambda o: o.name)


def place(rng):
    return [rng.uniform(-2, 2) for _ in range(3)]


def use_nodes(owner):
    if owner.node_tree is None:
        owner.use_nodes = True
    return owner.node_tree


def a_material(rng):
    item = rng.choice(objects("MESH"))
    if not item.data.materials:
        item.data.materials.append(bpy.data.materials.new("Paint"))
    material = rng.choice([m for m in item.data.materials if m] or [bpy.data.materials.new("Paint")])
    return material, use_nodes(material)


def node_of(tree, kind):
    return next((node for node in tree.nodes if node.bl_idname == kind), None) or tree.nodes.new(kind)


# ---------------------------------------------------------------- objects


def move(rng):
    rng.choice(objects("MESH", "LIGHT")).location = place(rng)


def turn(rng):
    rng.choice(objects("MESH")).matrix_world = Matrix.Rotation(rng.uniform(0, 6), 4, "Z")


def flatten(rng):
    rng.choice(objects("MESH")).scale = (1, rng.choice((0, 1)), rng.choice((0, 1, 2)))


def bend(rng):
    data = rng.choice(objects("MESH")).data
    data.vertices[0].co.z = rng.uniform(-1, 1)
    data.update()


def add_object(rng):
    data = mesh() if rng.random() < 0.5 or not objects("MESH") else rng.choice(objects("MESH")).data
    add(bpy.context.scene, "Added", data, location=place(rng))


def remove_object(rng):
    remove(rng, "MESH")


def remove(rng, kind):
    """Each scene keeps one."""
    item = rng.choice(objects(kind))
    if all(sum(other.type == kind for other in scene.objects) > 1 for scene in item.users_scene):
        bpy.data.objects.remove(item)


def hide(rng):
    item = rng.choice(objects("MESH", "LIGHT"))
    item.hide_viewport = not item.hide_viewport


def rename(rng):
    owner = rng.choice([*objects("MESH", "LIGHT"), *bpy.data.materials, *bpy.data.meshes])
    owner.name = f"Name {rng.randrange(1000)}"


def set_visibility(rng):
    item = rng.choice(objects("MESH", "LIGHT"))
    item.visible_diffuse = not item.visible_diffuse


def color(rng):
    item = rng.choice(objects("MESH"))
    item.color, item.pass_index = (*[rng.random() for _ in range(3)], 1), rng.randrange(4)


def parent(rng):
    child, above = rng.choice(objects("MESH", "LIGHT")), rng.choice(objects("MESH"))
    if child != above and not above.parent and not child.children:
        child.parent = None if child.parent else above


def modify(rng):
    item = rng.choice(objects("MESH"))
    if item.modifiers:
        item.modifiers.clear()
    else:
        item.modifiers.new("Array", "ARRAY").count = rng.randrange(2, 4)


def shape_key(rng):
    item = rng.choice(objects("MESH"))
    if item.data.shape_keys is None and item.data.users == 1:
        item.shape_key_add(name="Basis")
        item.shape_key_add(name="Key").data[0].co.x += 0.5
    elif item.data.shape_keys:
        item.data.shape_keys.key_blocks[-1].value = rng.random()


def switch_mode(rng):
    bpy.context.view_layer.objects.active = item = rng.choice(objects("MESH"))
    if not item.hide_viewport and item.visible_get():
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.translate(value=(0.1, 0, 0))
        bpy.ops.object.mode_set(mode="OBJECT")


# ---------------------------------------------------------------- duplicates and collections


def duplicate(rng):
    """Instances of one object on the vertices of another."""
    items = objects("MESH")
    if len(items) > 1 and not items[0].parent and not items[1].children:
        items[1].parent = items[0]
        items[0].instance_type = rng.choice(["NONE", "VERTS"])


def collect(rng):
    scene = bpy.context.scene
    made = bpy.data.collections.new("Made")
    scene.collection.children.link(made)
    made.objects.link(rng.choice(objects("MESH", "LIGHT")))


def hide_collection(rng):
    for child in bpy.context.view_layer.layer_collection.children:
        if rng.random() < 0.5:
            child.exclude = not child.exclude
        else:
            child.collection.hide_viewport = not child.collection.hide_viewport


def instance_collection(rng):
    if bpy.data.collections:
        empty = add(bpy.context.scene, "Instancer", None, location=place(rng))
        empty.instance_type, empty.instance_collection = "COLLECTION", rng.choice(list(bpy.data.collections))


def remove_collection(rng):
    if bpy.data.collections:
        bpy.data.collections.remove(rng.choice(list(bpy.data.collections)))
        for item in bpy.data.objects:
            if not item.users_collection:
                bpy.context.scene.collection.objects.link(item)


# ---------------------------------------------------------------- materials, lamps, the world


def paint(rng):
    _, tree = a_material(rng)
    node_of(tree, "ShaderNodeBsdfPrincipled").inputs["Base Color"].default_value = [rng.random() for _ in range(3)] + [
        1
    ]


def assign(rng):
    item = rng.choice(objects("MESH"))
    materials = [None, *bpy.data.materials]
    if not item.material_slots:
        item.data.materials.append(rng.choice(materials))
        return
    slot = rng.choice(list(item.material_slots))
    slot.link = rng.choice(("DATA", "OBJECT"))
    slot.material = rng.choice(materials)


def link_texture(rng):
    """A texture that asks meshes for an attribute, or an image."""
    _, tree = a_material(rng)
    shader = node_of(tree, "ShaderNodeBsdfPrincipled")
    kind = rng.choice(("ShaderNodeAttribute", "ShaderNodeTexImage", "ShaderNodeTexNoise", "ShaderNodeTexCoord"))
    node = node_of(tree, kind)
    if kind == "ShaderNodeAttribute":
        node.attribute_name = rng.choice(("first", "second"))
    if kind == "ShaderNodeTexImage":
        node.image = rng.choice([None, an_image(rng)])
    if kind == "ShaderNodeTexCoord":
        node.object = rng.choice([None, *objects("MESH", "LIGHT", "CAMERA")])
    output = next(o for o in node.outputs if o.enabled and (o.name == "Object" or kind != "ShaderNodeTexCoord"))
    tree.links.new(output, shader.inputs[rng.choice(("Base Color", "Roughness"))])


def unlink(rng):
    _, tree = a_material(rng)
    if tree.links:
        tree.links.remove(rng.choice(list(tree.links)))


def displace(rng):
    """Vertices moved by a material, farther, otherwise or no more."""
    material, tree = a_material(rng)
    node = node_of(tree, "ShaderNodeDisplacement")
    node.inputs["Scale"].default_value = rng.uniform(-0.5, 0.5)
    material.displacement_method = rng.choice(("BUMP", "DISPLACEMENT", "BOTH"))
    output = node_of(tree, "ShaderNodeOutputMaterial")
    if not output.inputs["Displacement"].is_linked:
        tree.links.new(node.outputs[0], output.inputs["Displacement"])


def group(rng):
    """A node group, or another value in it."""
    if not bpy.data.node_groups:
        made = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        made.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
        value, out = made.nodes.new("ShaderNodeRGB"), made.nodes.new("NodeGroupOutput")
        made.links.new(value.outputs[0], out.inputs[0])
    made = bpy.data.node_groups[0]
    next(n for n in made.nodes if n.type == "RGB").outputs[0].default_value = [rng.random() for _ in range(3)] + [1]
    if rng.random() < 0.5:
        _, tree = a_material(rng)
        node = node_of(tree, "ShaderNodeGroup")
        node.node_tree = made
        tree.links.new(node.outputs[0], node_of(tree, "ShaderNodeBsdfPrincipled").inputs["Base Color"])


def an_image(rng):
    name = rng.choice(("One", "Two"))
    if name not in bpy.data.images:
        bpy.data.images.new(name, 2, 2)
    return bpy.data.images[name]


def paint_image(rng):
    image = an_image(rng)
    image.pixels.foreach_set(np.array([rng.random() for _ in range(16)], np.float32))
    image.update()
    image.update_tag()


def set_image(rng):
    an_image(rng).colorspace_settings.name = rng.choice(("sRGB", "Non-Color"))


def color_attribute(rng):
    data = rng.choice(objects("MESH")).data
    attribute = data.attributes.get("first") or data.attributes.new("first", "FLOAT_COLOR", "POINT")
    attribute.data[0].color = [rng.random() for _ in range(4)]
    data.update()


def lamp(rng):
    light = rng.choice(objects("LIGHT")).data
    light.energy, light.color = rng.uniform(1, 100), (rng.random(), rng.random(), rng.random())


def add_lamp(rng):
    kind = rng.choice(("POINT", "SUN", "SPOT", "AREA"))
    add(bpy.context.scene, "Lamp", bpy.data.lights.new("Lamp", kind), location=place(rng)).data.energy = 10


def remove_lamp(rng):
    remove(rng, "LIGHT")


def set_lamp(rng):
    light = rng.choice(objects("LIGHT")).data
    light.type = rng.choice(("POINT", "SUN", "SPOT", "AREA"))


def lamp_nodes(rng):
    light = rng.choice(objects("LIGHT")).data
    if bpy.app.version < (5, 0, 0):
        light.use_nodes = True
    node_of(light.node_tree, "ShaderNodeEmission").inputs["Strength"].default_value = rng.random()


def world(rng):
    scene = bpy.context.scene
    scene.world = scene.world or bpy.data.worlds.new("World")
    node_of(use_nodes(scene.world), "ShaderNodeBackground").inputs["Strength"].default_value = rng.random()


def sky(rng):
    scene = bpy.context.scene
    scene.world = scene.world or bpy.data.worlds.new("World")
    tree = use_nodes(scene.world)
    node = node_of(tree, "ShaderNodeTexEnvironment")
    node.image = an_image(rng)
    if node.outputs[0].is_linked:
        tree.links.remove(node.outputs[0].links[0])
    else:
        tree.links.new(node.outputs[0], node_of(tree, "ShaderNodeBackground").inputs["Color"])


def no_world(rng):
    bpy.context.scene.world = rng.choice([None, *bpy.data.worlds])


# ---------------------------------------------------------------- the scene as a whole


def frame(rng):
    item = rng.choice(objects("MESH", "LIGHT"))
    if rng.random() < 0.3:
        item.keyframe_insert("location", frame=rng.randrange(1, 5))
    bpy.context.scene.frame_set(rng.randrange(1, 5))


def animate_material(rng):
    _, tree = a_material(rng)
    shader = node_of(tree, "ShaderNodeBsdfPrincipled")
    shader.inputs["Roughness"].default_value = rng.random()
    shader.inputs["Roughness"].keyframe_insert("default_value", frame=rng.randrange(1, 5))
    bpy.context.scene.frame_set(rng.randrange(1, 5))


def settings(rng):
    scene = bpy.context.scene
    scene.gi_engine.is_own = True
    scene.gi_engine.clamp_direct = rng.choice((0, 1, 2))
    scene.render.film_transparent = rng.random() < 0.5


def view_layer(rng):
    layer = bpy.context.view_layer
    if rng.random() < 0.5:
        layer.material_override = rng.choice([None, *bpy.data.materials])
    else:
        layer.use_sky, layer.use_solid = rng.random() < 0.7, rng.random() < 0.9


def undo(rng):
    """Some steps backwards or forwards."""
    operator = rng.choice((bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo))
    for _ in range(rng.choice((1, 1, 2, 5, 12))):
        if operator.poll():
            operator()
    if not objects("MESH") or not objects("LIGHT"):  # before the test began
        bpy.ops.ed.redo()


def do(edit, rng) -> None:
    """An edit as a step of its own that undo can take back, as every operator's is. Without it Blender itself crashes: undo keeps what is
    the same in both steps as it stands in memory, with its pointers to what has come since the last step, and frees that. (A material that
    was animated since the last step points to no Action any more after undo and redo; found in bpy 5.2.3 without this engine.)"""
    edit(rng)
    if edit is not undo:
        bpy.ops.ed.undo_push(message=edit.__name__)


def other_scene(rng):
    """From one scene to the other, which shares an object with it."""
    if len(bpy.data.scenes) < 2:
        made = bpy.data.scenes.new("Other")
        for kind in ("MESH", "LIGHT", "CAMERA"):
            made.collection.objects.link(objects(kind)[0])
        add(made, "Of the other scene", mesh())
        made.camera = objects("CAMERA")[0]
        add(made, "Lamp of the other scene", bpy.data.lights.new("Lamp", "POINT"))
    bpy.context.window.scene = next(scene for scene in bpy.data.scenes if scene != bpy.context.scene)


def look(rng):
    bpy.context.scene.camera.location.x = rng.uniform(-1, 1)


EDITS = [
    *(move, turn, flatten, bend, add_object, remove_object, hide, rename, set_visibility, color, parent, modify),
    *(shape_key, switch_mode, duplicate, collect, hide_collection, instance_collection, remove_collection),
    *(paint, assign, link_texture, unlink, displace, group, paint_image, set_image, color_attribute),
    *(lamp, add_lamp, remove_lamp, set_lamp, lamp_nodes, world, sky, no_world),
    *(frame, animate_material, settings, view_layer, look, undo, undo, other_scene),
]
