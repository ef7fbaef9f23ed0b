"""Builds interior.blend: a living room lit through its windows by sky and sun, and by one floor lamp.
Procedural wood and rug, bevelled furniture, instanced books; the everyday case of an interior."""

import math
import random

import bpy
from blocks import (
    box,
    camera,
    diffuse,
    glass,
    lathe,
    link_object,
    material,
    mirror,
    new_scene,
    principled,
    quad,
    save,
    set_world,
    shader_of,
    sphere,
)
from mathutils import Euler

WIDTH, DEPTH, HEIGHT = 5.0, 4.2, 2.6  # the room spans x 0..5, y 0..4.2; windows in the left wall, x = 0
SILL, LINTEL = 0.55, 2.25
WINDOWS = ((0.75, 1.85), (2.25, 3.35))  # along y


def wood_floor():
    """Planks: a brick texture gives each its tone, a stretched noise the grain."""
    made = principled("planks", (0.4, 0.25, 0.13), 0.35)
    tree, shader = made.node_tree, shader_of(made)
    place = tree.nodes.new("ShaderNodeTexCoord")
    planks = tree.nodes.new("ShaderNodeTexBrick")
    planks.offset = 0.37
    for key, value in {"Color1": (0.36, 0.20, 0.10, 1), "Color2": (0.48, 0.30, 0.16, 1), "Mortar": (0.1, 0.06, 0.03, 1),
                       "Scale": 1.0, "Mortar Size": 0.002, "Brick Width": 1.2, "Row Height": 0.14}.items():  # fmt: skip
        planks.inputs[key].default_value = value
    stretch = tree.nodes.new("ShaderNodeMapping")
    stretch.inputs["Scale"].default_value = (1.5, 28.0, 1.0)
    grain = tree.nodes.new("ShaderNodeTexNoise")
    grain.inputs["Scale"].default_value, grain.inputs["Detail"].default_value = 3.0, 4.0
    tint = tree.nodes.new("ShaderNodeMix")
    tint.data_type, tint.blend_type = "RGBA", "MULTIPLY"
    tint.inputs[0].default_value = 0.45
    tree.links.new(place.outputs["Object"], planks.inputs["Vector"])
    tree.links.new(place.outputs["Object"], stretch.inputs["Vector"])
    tree.links.new(stretch.outputs["Vector"], grain.inputs["Vector"])
    tree.links.new(planks.outputs["Color"], tint.inputs[6])
    tree.links.new(grain.outputs[0], tint.inputs[7])
    tree.links.new(tint.outputs[2], shader.inputs["Base Color"])
    return made


def striped(name, first, second, scale):
    made = diffuse(name, first)
    tree = made.node_tree
    place = tree.nodes.new("ShaderNodeTexCoord")
    wave = tree.nodes.new("ShaderNodeTexWave")
    wave.bands_direction = "X"
    wave.inputs["Scale"].default_value = scale
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.interpolation = "CONSTANT"
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (*first, 1), (*second, 1)
    ramp.color_ramp.elements[1].position = 0.6
    tree.links.new(place.outputs["Object"], wave.inputs["Vector"])
    tree.links.new(wave.outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs["Color"], shader_of(made).inputs["Color"])
    return made


def room(plaster, planks):
    quad("floor", [(0, 0, 0), (WIDTH, 0, 0), (WIDTH, DEPTH, 0), (0, DEPTH, 0)], planks)
    quad("ceiling", [(0, 0, HEIGHT), (0, DEPTH, HEIGHT), (WIDTH, DEPTH, HEIGHT), (WIDTH, 0, HEIGHT)], plaster)
    box("wall back", (-0.2, DEPTH, 0), (WIDTH, DEPTH + 0.2, HEIGHT), plaster)
    box("wall front", (-0.2, -0.2, 0), (WIDTH, 0, HEIGHT), plaster)
    box("wall right", (WIDTH, -0.2, 0), (WIDTH + 0.2, DEPTH + 0.2, HEIGHT), plaster)
    box("wall below windows", (-0.2, 0, 0), (0, DEPTH, SILL), plaster)
    box("wall above windows", (-0.2, 0, LINTEL), (0, DEPTH, HEIGHT), plaster)
    edges = [0.0, *[y for window in WINDOWS for y in window], DEPTH]
    for low, high in zip(edges[::2], edges[1::2], strict=True):
        box("wall between windows", (-0.2, low, SILL), (0, high, LINTEL), plaster)


def window_frames(paint):
    for low, high in WINDOWS:
        middle, height = (low + high) / 2, (SILL + LINTEL) / 2 + 0.25
        for y in (low + 0.025, middle, high - 0.025):
            box("mullion", (-0.14, y - 0.025, SILL), (-0.09, y + 0.025, LINTEL), paint, bevel=0.006)
        for z in (SILL + 0.025, height, LINTEL - 0.025):
            box("rail", (-0.14, low, z - 0.025), (-0.09, high, z + 0.025), paint, bevel=0.006)
        box("window sill", (-0.09, low - 0.05, SILL - 0.03), (0.12, high + 0.05, SILL + 0.005), paint, bevel=0.006)


def sofa(cloth, cushion, wood):
    low, high = 2.15, 4.15  # along x, its back to the far wall
    box("sofa seat", (low + 0.18, 3.15, 0.14), (high - 0.18, 3.95, 0.42), cloth, bevel=0.06)
    box("sofa back", (low + 0.1, 3.82, 0.14), (high - 0.1, 4.1, 0.85), cloth, bevel=0.08)
    for x in (low, high - 0.2):
        box("sofa arm", (x, 3.1, 0.12), (x + 0.2, 4.05, 0.60), cloth, bevel=0.07)
    for x in (low + 0.08, high - 0.08):
        for y in (3.2, 3.95):
            box("sofa foot", (x - 0.03, y - 0.03, 0), (x + 0.03, y + 0.03, 0.14), wood)
    for x, turn in ((low + 0.5, 0.15), (high - 0.52, -0.2)):
        pillow = box("cushion", (x - 0.21, 3.6, 0.44), (x + 0.21, 3.78, 0.86), cushion, turn, bevel=0.075)
        pillow.rotation_euler.x = -0.25


def coffee_table(wood, china, clear, brass):
    box("table top", (2.45, 1.95, 0.38), (3.65, 2.6, 0.42), wood, bevel=0.01)
    for x in (2.52, 3.53):
        for y in (2.02, 2.48):
            box("table leg", (x, y, 0), (x + 0.05, y + 0.05, 0.38), wood)
    bowl = [
        (0.0, 0.0),
        (0.06, 0.0),
        (0.07, 0.01),
        (0.15, 0.07),
        (0.17, 0.11),
        (0.163, 0.11),
        (0.14, 0.075),
        (0.0, 0.02),
    ]
    lathe("bowl", bowl, china, (2.8, 2.3, 0.4205))
    for x, y, r in ((2.75, 2.29, 0.042), (2.84, 2.26, 0.04), (2.81, 2.36, 0.041)):
        sphere("orange", (x, y, 0.50), r, principled("orange", (0.85, 0.32, 0.04), 0.45), 48)
    vase = [(0.0, 0.0), (0.05, 0.0), (0.06, 0.03), (0.055, 0.12), (0.035, 0.2), (0.05, 0.25),
            (0.045, 0.25), (0.03, 0.2), (0.05, 0.12), (0.055, 0.03), (0.045, 0.012), (0.0, 0.012)]  # fmt: skip
    lathe("glass vase", vase, clear, (3.35, 2.3, 0.4205))
    sphere("brass ball", (3.15, 2.12, 0.4605), 0.04, brass, 64)


def shelf_of_books(wood):
    """Two boards; the books are instances of five collections, so that instancing is part of the picture."""
    kinds = []
    shades = [(0.45, 0.08, 0.06), (0.07, 0.16, 0.30), (0.10, 0.25, 0.14), (0.60, 0.48, 0.28), (0.15, 0.12, 0.12)]
    for i, shade in enumerate(shades):
        kind = bpy.data.collections.new(f"book {i}")
        size = (0.02 + 0.006 * i, 0.15 + 0.01 * (i % 3), 0.19 + 0.018 * ((i * 2) % 5))
        box(f"book {i}", (0, -size[1], 0), (size[0], 0, size[2]), principled(f"cover {i}", shade, 0.5), 0, 0.003, kind)
        kinds.append((kind, size[0]))
    chance = random.Random(7)
    for z in (1.25, 1.65):
        box("shelf", (2.3, DEPTH - 0.24, z), (4.0, DEPTH, z + 0.03), wood, bevel=0.004)
        x = 2.36
        while x < 3.88 - (0.5 if z < 1.5 else 0.0):
            kind, width = chance.choice(kinds)
            book = link_object("book", None)
            book.instance_type, book.instance_collection = "COLLECTION", kind
            book.location = (x, DEPTH - 0.03, z + 0.0305)
            x += width + 0.002 + (chance.random() < 0.08) * 0.05
    return kinds


def floor_lamp(metal, paper):
    base = [(0.0, 0.0), (0.15, 0.0), (0.15, 0.015), (0.012, 0.03), (0.012, 1.35), (0.0, 1.35)]
    lathe("lamp stand", base, metal, (4.55, 3.6, 0.0), 48)
    lathe("lamp shade", [(0.21, 1.3), (0.14, 1.62)], paper, (4.55, 3.6, 0.0), 64)
    data = bpy.data.lights.new("bulb", "POINT")
    data.energy, data.color, data.shadow_soft_size = 22.0, (1.0, 0.72, 0.42), 0.04
    link_object("bulb", data).location = (4.55, 3.6, 1.45)


def pictures(frame, reflecting):
    box("picture frame", (4.94, 1.2, 1.1), (4.995, 2.4, 1.9), frame, bevel=0.01)
    paint = striped("painting", (0.75, 0.55, 0.30), (0.12, 0.20, 0.28), 1.6)
    box("painting", (4.935, 1.26, 1.16), (4.945, 2.34, 1.84), paint)
    lathe(
        "mirror rim",
        [(0.29, 0.0), (0.33, 0.0), (0.33, 0.03), (0.29, 0.03), (0.29, 0.0)],
        frame,
        (1.35, DEPTH - 0.005, 1.6),
    )
    bpy.data.objects["mirror rim"].rotation_euler.x = math.pi / 2
    lathe("mirror", [(0.29, 0.012), (0.0, 0.012)], reflecting, (1.35, DEPTH - 0.005, 1.6))
    bpy.data.objects["mirror"].rotation_euler.x = math.pi / 2


def daylight():
    """Sky by the Sky Texture without its sun disc, which a sun lamp stands for; no portals."""
    background = set_world((1, 1, 1), 0.14)
    tree = background.id_data
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type = "NISHITA" if bpy.app.version < (5, 0) else "MULTIPLE_SCATTERING"
    sky.sun_disc, sky.sun_elevation, sky.sun_rotation = False, math.radians(34), math.radians(-70)
    tree.links.new(sky.outputs["Color"], background.inputs["Color"])
    data = bpy.data.lights.new("sun", "SUN")
    data.energy, data.angle, data.color = 9.0, math.radians(0.8), (1.0, 0.87, 0.70)
    sun = link_object("sun", data)
    sun.rotation_euler = Euler((math.radians(12), math.radians(-56), 0))


new_scene(640, 480, samples=256, view="AgX")
plaster = diffuse("plaster", (0.80, 0.77, 0.72))
oak = principled("oak", (0.38, 0.22, 0.11), 0.4)
white_paint = principled("white paint", (0.82, 0.82, 0.80), 0.3)
brass = principled("brass", (0.88, 0.62, 0.28), 0.22, Metallic=1.0)
room(plaster, wood_floor())
window_frames(white_paint)
box("skirting", (0, DEPTH - 0.015, 0), (WIDTH, DEPTH, 0.09), white_paint, bevel=0.003)
sofa(principled("sofa cloth", (0.16, 0.24, 0.26), 0.9, Sheen_Weight=0.4), diffuse("cushion", (0.62, 0.36, 0.12)), oak)
box(
    "rug", (1.9, 1.3, 0.0), (4.2, 3.05, 0.012), striped("rug", (0.62, 0.55, 0.46), (0.38, 0.16, 0.12), 2.2), bevel=0.004
)
coffee_table(oak, principled("china", (0.75, 0.78, 0.80), 0.1, Coat_Weight=0.5), glass("clear glass"), brass)
shelf_of_books(oak)
floor_lamp(brass, material("paper", "ShaderNodeBsdfTranslucent", Color=(0.85, 0.75, 0.6)))
pictures(oak, mirror("mirror"))
lathe(
    "pot",
    [(0.0, 0.0), (0.14, 0.0), (0.19, 0.3), (0.17, 0.3), (0.0, 0.26)],
    principled("clay", (0.55, 0.25, 0.15), 0.7),
    (0.45, 3.8, 0),
)
for i in range(14):
    leaf = quad(
        "leaf",
        [(0, 0, 0), (0.05, 0.22, 0.03), (0, 0.5, -0.03), (-0.05, 0.22, 0.03)],
        principled("leaf", (0.06, 0.22, 0.05), 0.4),
    )
    leaf.location, leaf.rotation_euler = (0.45, 3.8, 0.25), (0.55 + 0.065 * (i % 9), 0.0, i * 2.4)
daylight()
camera((2.35, 0.15, 1.45), (2.65, 4.2, 0.95), lens=21.0)
save(__file__)
