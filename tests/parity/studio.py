"""What the small parity scenes are made of: an empty scene, a few meshes, materials from a line, cameras, lamps.
A sheet holds many subjects in square tiles of one image, so that many nodes are compared by one render."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import bpy
from mathutils import Vector

TILE = 24  # pixels; three blocks
LAMP, SKY = (0.9, 0.8, 0.7), (0.25, 0.3, 0.4)


@dataclass
class Case:
    """`build(scene)` fills an empty scene; `tiles` names the parts of the image, row by row from the top left."""

    name: str
    build: Callable
    size: tuple = (48, 48)
    tiles: list = field(default_factory=list)
    samples: int = 64
    tolerance: float = 0.003
    cycles: dict = field(default_factory=dict)  # settings of the scene that are not neutral


class Unavailable(Exception):
    """This Blender has no such node or socket."""


def empty(size):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    for name in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces", "transparent_max_bounces"):
        setattr(scene.cycles, name, 6)
    scene.world = bpy.data.worlds.new("World")
    world((0, 0, 0))
    return scene


def tree_of(block):
    if block.node_tree is None:  # Blender before 5.0
        block.use_nodes = True
    block.node_tree.nodes.clear()
    return block.node_tree


def node(tree, kind, properties=None, inputs=None):
    """`inputs`: socket name or position -> value, or an output socket to link."""
    if not hasattr(bpy.types, kind):
        raise Unavailable(kind)
    made = tree.nodes.new(kind)
    for key, value in (properties or {}).items():
        try:
            setattr(made, key, value)
        except (AttributeError, TypeError) as error:
            raise Unavailable(f"{kind}.{key} = {value!r}") from error
    for key, value in (inputs or {}).items():
        put(tree, socket_of(made.inputs, key), value)
    return made


def socket_of(sockets, key):
    if isinstance(key, int):
        return sockets[key]
    found = [s for s in sockets if key in (s.name, s.identifier) and s.enabled]
    if not found:
        raise Unavailable(key)
    return found[0]


def put(tree, socket, value):
    if isinstance(value, bpy.types.NodeSocket):
        tree.links.new(value, socket)
    elif isinstance(value, tuple) and len(value) == 3 and socket.type == "RGBA":
        socket.default_value = (*value, 1.0)
    else:
        socket.default_value = value


def output(tree, shader, kind="ShaderNodeOutputMaterial"):
    out = tree.nodes.new(kind)
    tree.links.new(shader.outputs[0] if isinstance(shader, bpy.types.Node) else shader, out.inputs["Surface"])


def material(name, kind="ShaderNodeBsdfDiffuse", properties=None, **inputs):
    made = bpy.data.materials.new(name)
    tree = tree_of(made)
    output(tree, node(tree, kind, properties, {k.replace("_", " "): v for k, v in inputs.items()}))
    return made


def world(color, strength=1.0):
    tree = tree_of(bpy.context.scene.world)
    output(
        tree, node(tree, "ShaderNodeBackground", None, {"Color": color, "Strength": strength}), "ShaderNodeOutputWorld"
    )
    return tree


def link(name, data, location=(0, 0, 0), rotation=(0, 0, 0), scale=(1, 1, 1)):
    made = bpy.data.objects.new(name, data)
    made.location, made.rotation_euler, made.scale = location, rotation, scale
    bpy.context.scene.collection.objects.link(made)
    return made


def mesh(name, vertices, faces, made=None, **place):
    data = bpy.data.meshes.new(name)
    data.from_pydata([tuple(v) for v in vertices], [], [tuple(f) for f in faces])
    if made:
        data.materials.append(made)
    return link(name, data, **place)


def square(made=None, half=0.5, uv=True, **place):
    made_object = mesh(
        "square", [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [range(4)], made, **place
    )
    if uv:
        layer = made_object.data.uv_layers.new(name="UVMap")
        for corner, value in zip(layer.uv, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
            corner.vector = value
    return made_object


def cube(made=None, half=0.5, **place):
    corners = [(x, y, z) for z in (-half, half) for y in (-half, half) for x in (-half, half)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return mesh("cube", corners, faces, made, **place)


def ball(made=None, radius=0.5, smooth=True, rings=24, **place):
    vertices, faces, n = [(0, 0, -radius)], [], 2 * rings
    for j in range(1, rings):
        t = math.pi * j / rings
        for i in range(n):
            p = 2 * math.pi * i / n
            vertices.append(
                (radius * math.sin(t) * math.cos(p), radius * math.sin(t) * math.sin(p), -radius * math.cos(t))
            )
    vertices.append((0, 0, radius))
    faces += [(0, 1 + (i + 1) % n, 1 + i) for i in range(n)]
    for j in range(rings - 2):
        a = 1 + j * n
        faces += [(a + i, a + (i + 1) % n, a + n + (i + 1) % n, a + n + i) for i in range(n)]
    a = 1 + (rings - 2) * n
    faces += [(a + i, a + (i + 1) % n, len(vertices) - 1) for i in range(n)]
    made_object = mesh("ball", vertices, faces, made, **place)
    made_object.data.polygons.foreach_set("use_smooth", [smooth] * len(faces))
    layer = made_object.data.uv_layers.new(name="UVMap")
    for loop in made_object.data.loops:  # seen from above
        x, y, _ = vertices[loop.vertex_index]
        layer.uv[loop.index].vector = (0.5 + 0.5 * x / radius, 0.5 + 0.5 * y / radius)
    return made_object


def camera(location=(0, -5, 4), target=(0, 0, 0), angle=30.0, **properties):
    data = bpy.data.cameras.new("Camera")
    data.angle, data.clip_start = math.radians(angle), 0.01
    for key, value in properties.items():
        setattr(data, key, value)
    made = link("Camera", data, location)
    made.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = made
    return made


def ortho_from_above(width, height=10.0):
    made = camera((0, 0, height), (0, 0, 0), type="ORTHO", ortho_scale=width)
    made.rotation_euler = (0, 0, 0)
    return made


def lamp(kind="AREA", location=(1.5, -1.0, 3.0), rotation=(0.3, 0.35, 0.2), energy=100.0, visible=False, **properties):
    data = bpy.data.lights.new("lamp", kind)
    data.energy = energy
    for key, value in properties.items():
        setattr(data, key, value)
    made = link("lamp", data, location, rotation)
    made.visible_camera = visible
    return made


def sheet(name, tiles: dict, place, light, **case):
    """`tiles`: name -> function that makes a material; `place(material)` makes the subject at the origin; `light()` the rest."""
    columns = math.ceil(math.sqrt(len(tiles)))
    rows = math.ceil(len(tiles) / columns)

    def build(scene):
        for i, (label, make) in enumerate(tiles.items()):
            try:
                subject = place(make(label))
            except Unavailable:
                continue
            subject.location += Vector((i % columns - (columns - 1) / 2, (rows - 1) / 2 - i // columns, 0))
        light()
        # Tiles are one metre wide: square pixels, the longer side is the orthographic scale.
        ortho_from_above(max(columns, rows))

    return Case(name, build, (columns * TILE, rows * TILE), list(tiles), **case)


def tile_region(case: Case, index: int):
    """Slices of rows (from the top) and columns."""
    columns = case.size[0] // TILE
    x, y = index % columns * TILE, index // columns * TILE
    return slice(y, y + TILE), slice(x, x + TILE)
