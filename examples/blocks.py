"""Small building blocks that the example scripts share: a clean scene, materials, meshes, lamps, camera, saving.
Works in Blender 4.5 and 5.2 alike; leaves out everything that only one scene needs."""

from __future__ import annotations

import math
import os
import sys
from itertools import pairwise
from pathlib import Path

import bpy
from mathutils import Matrix, Vector


def new_scene(width=512, height=512, samples=256, view="Standard"):
    """An empty scene with a black world. Cycles' settings are set too, since GI Engine starts from them."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.view_settings.view_transform = view
    scene.render.image_settings.file_format = "PNG"
    for name, value in {
        "samples": samples,
        "use_denoising": False,
        "use_adaptive_sampling": False,
        "max_bounces": 24,
        "diffuse_bounces": 24,
        "glossy_bounces": 24,
        "transmission_bounces": 24,
        "sample_clamp_indirect": 0.0,
        "blur_glossy": 0.0,
        "light_sampling_threshold": 0.0,
    }.items():
        setattr(scene.cycles, name, value)
    scene.world = bpy.data.worlds.new("World")
    set_world((0.0, 0.0, 0.0))
    return scene


def tree_of(block):
    """The emptied node tree of a material or world."""
    if block.node_tree is None:  # Blender before 5.0
        block.use_nodes = True
    block.node_tree.nodes.clear()
    return block.node_tree


def set_world(color, strength=1.0):
    tree = tree_of(bpy.context.scene.world)
    background = tree.nodes.new("ShaderNodeBackground")
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = strength
    output = tree.nodes.new("ShaderNodeOutputWorld")
    output.location.x = 250
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    return background


def material(name, shader, **inputs):
    """A material of one shader node; inputs are named as the sockets, with _ for a space."""
    made = bpy.data.materials.new(name)
    tree = tree_of(made)
    node = tree.nodes.new(shader)
    for key, value in inputs.items():
        if key == "distribution":
            node.distribution = value
            continue
        node.inputs[key.replace("_", " ")].default_value = (*value, 1.0) if isinstance(value, tuple) else value
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    output.location.x = 300
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    made.diffuse_color = (*inputs.get("Color", inputs.get("Base_Color", (0.8, 0.8, 0.8))), 1.0)  # the solid viewport
    return made


def diffuse(name, color):
    return material(name, "ShaderNodeBsdfDiffuse", Color=color, Roughness=0.0)


def mirror(name, color=(0.95, 0.95, 0.95)):
    return material(name, "ShaderNodeBsdfAnisotropic", Color=color, Roughness=0.0, distribution="GGX")


def glass(name, color=(1.0, 1.0, 1.0), ior=1.5):
    return material(name, "ShaderNodeBsdfGlass", Color=color, Roughness=0.0, IOR=ior)


def principled(name, color, roughness=0.5, **inputs):
    return material(name, "ShaderNodeBsdfPrincipled", Base_Color=color, Roughness=roughness, **inputs)


def shader_of(made):
    """The one shader node of a material made above, to link textures to."""
    return next(n for n in made.node_tree.nodes if n.type.startswith(("BSDF", "EMISSION")))


def link_object(name, data, collection=None):
    made = bpy.data.objects.new(name, data)
    (collection or bpy.context.scene.collection).objects.link(made)
    return made


def mesh(name, vertices, faces, made, collection=None):
    data = bpy.data.meshes.new(name)
    data.from_pydata([tuple(v) for v in vertices], [], [tuple(f) for f in faces])
    data.materials.append(made)
    return link_object(name, data, collection)


def quad(name, corners, made):
    return mesh(name, corners, [range(4)], made)


def box(name, low, high, made, turn=0.0, bevel=0.0, collection=None):
    """An axis-aligned box, turned about the vertical through its centre; its edges may be rounded."""
    low, high = Vector(low), Vector(high)
    half, centre = (high - low) / 2, (high + low) / 2
    corners = [(x * half.x, y * half.y, z * half.z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    made_box = mesh(name, corners, faces, made, collection)
    made_box.location = centre
    made_box.rotation_euler.z = turn
    if bevel:
        modifier = made_box.modifiers.new("Bevel", "BEVEL")
        modifier.width, modifier.segments = bevel, 3
        made_box.data.polygons.foreach_set("use_smooth", [True] * 6)
        modifier.harden_normals = True
    return made_box


def sphere(name, centre, radius, made, segments=128, collection=None):
    rings = segments // 2
    angles = [math.pi * i / rings for i in range(1, rings)]
    profile = [(0.0, -radius), *[(radius * math.sin(a), -radius * math.cos(a)) for a in angles], (0.0, radius)]
    return lathe(name, profile, made, centre, segments, collection)


def lathe(name, profile, made, location=(0, 0, 0), steps=96, collection=None):
    """A surface of revolution about z through (radius, height) pairs; a radius of 0 closes it."""
    vertices, rings = [], []
    for radius, height in profile:
        count = 1 if radius == 0 else steps
        rings.append(range(len(vertices), len(vertices) + count))
        angles = [2 * math.pi * i / steps for i in range(count)]
        vertices += [(radius * math.cos(a), radius * math.sin(a), height) for a in angles]
    faces = []
    for below, above in pairwise(rings):
        for i in range(steps):
            j = (i + 1) % steps
            corners = [below[i % len(below)], below[j % len(below)], above[j % len(above)], above[i % len(above)]]
            faces.append(tuple(dict.fromkeys(corners)))
    turned = mesh(name, vertices, faces, made, collection)
    turned.data.polygons.foreach_set("use_smooth", [True] * len(faces))
    turned.location = location
    return turned


def area_lamp(name, location, size, power, color=(1.0, 1.0, 1.0), visible=True):
    """A rectangle that shines downwards, power in watts. Seen by the camera, as a real lamp is."""
    data = bpy.data.lights.new(name, "AREA")
    data.shape, (data.size, data.size_y) = "RECTANGLE", size
    data.energy, data.color = power, color
    lamp = link_object(name, data)
    lamp.location = location
    lamp.visible_camera = visible
    return lamp


def camera(location, target, lens, sensor=36.0):
    data = bpy.data.cameras.new("Camera")
    data.lens, data.sensor_width, data.sensor_height = lens, sensor, sensor
    data.clip_start = 0.01
    made = link_object("Camera", data)
    made.matrix_world = Matrix.Translation(location) @ (
        (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    )
    bpy.context.scene.camera = made
    return made


def save(script):
    """Writes the scene beside the script: build_NAME.py makes NAME.blend (compressed)."""
    here = Path(script).resolve()
    out = here.with_name(here.stem.removeprefix("build_") + ".blend")
    bpy.context.preferences.filepaths.save_version = 0  # no .blend1
    bpy.ops.wm.save_as_mainfile(filepath=str(out), compress=True)
    print(f"{out.name}: {out.stat().st_size / 1024:.0f} KiB, Blender {bpy.app.version_string}")
    if bpy.app.version < (5, 0) and bpy.app.background:  # the bpy module of 4.5 can hang at exit
        sys.stdout.flush()
        os._exit(0)
