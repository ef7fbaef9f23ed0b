"""Builds veach_door.blend: a room lit only through a door that stands ajar, after the scene of [Veach 1997, ch. 10].
Nearly all light is indirect: hard for path tracing, what bidirectional methods were made for."""

import math

from blocks import (
    area_lamp,
    box,
    camera,
    diffuse,
    glass,
    lathe,
    material,
    mirror,
    new_scene,
    quad,
    save,
    shader_of,
    sphere,
)
from mathutils import Matrix

HEIGHT, DOOR_LEFT, DOOR_RIGHT, DOOR_TOP, NEAR_FACE, FAR_FACE = 2.6, 0.55, 1.45, 2.05, 2.0, 2.12


def checker_floor():
    made = diffuse("floor", (0.5, 0.5, 0.5))
    tree = made.node_tree
    checker = tree.nodes.new("ShaderNodeTexChecker")
    checker.inputs["Color1"].default_value = (0.62, 0.55, 0.45, 1.0)
    checker.inputs["Color2"].default_value = (0.16, 0.10, 0.07, 1.0)
    checker.inputs["Scale"].default_value = 2.0
    place = tree.nodes.new("ShaderNodeTexCoord")
    # Object coordinates of a plane at z = 0 would lie on the checker's own border: lift them.
    lift = tree.nodes.new("ShaderNodeMapping")
    lift.inputs["Location"].default_value = (0.0, 0.0, 0.1)
    tree.links.new(place.outputs["Object"], lift.inputs["Vector"])
    tree.links.new(lift.outputs["Vector"], checker.inputs["Vector"])
    tree.links.new(checker.outputs["Color"], shader_of(made).inputs["Color"])
    return made


def rectangle(name, x, y, z, made):
    """A wall across one axis: two of x, y, z are (low, high), the third is a number."""
    low_high = [v if isinstance(v, tuple) else (v, v) for v in (x, y, z)]
    flat = next(i for i, v in enumerate((x, y, z)) if not isinstance(v, tuple))
    u, v = [i for i in range(3) if i != flat]
    corners = []
    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
        corner = [0.0, 0.0, 0.0]
        corner[flat], corner[u], corner[v] = low_high[flat][0], low_high[u][a], low_high[v][b]
        corners.append(tuple(corner))
    quad(name, corners, made)


def room(name, x, y, floor, wall, side):
    """Floor, ceiling and the three walls that have no door."""
    rectangle(name + " floor", x, y, 0.0, floor)
    rectangle(name + " ceiling", x, y, HEIGHT, wall)
    rectangle(name + " left", x[0], y, (0, HEIGHT), side)
    rectangle(name + " right", x[1], y, (0, HEIGHT), wall)


def dividing_wall(wall):
    box("wall left", (-2.5, NEAR_FACE, 0), (DOOR_LEFT, FAR_FACE, HEIGHT), wall)
    box("wall right", (DOOR_RIGHT, NEAR_FACE, 0), (3.6, FAR_FACE, HEIGHT), wall)
    box("wall above", (DOOR_LEFT, NEAR_FACE, DOOR_TOP), (DOOR_RIGHT, FAR_FACE, HEIGHT), wall)


def door(wood, brass):
    """The leaf, hinged at the right of the opening and turned into the near room; its origin is the hinge."""
    leaf = box("door", (-0.89, -0.045, 0.01), (-0.01, -0.005, DOOR_TOP - 0.01), wood, bevel=0.004)
    leaf.data.transform(Matrix.Translation(leaf.location))
    leaf.location = (DOOR_RIGHT, NEAR_FACE, 0)
    leaf.rotation_euler.z = math.radians(32)
    knob = sphere("knob", (-0.82, -0.09, 1.0), 0.035, brass, 32)
    knob.parent = leaf


def table(wood):
    box("table top", (-1.75, -0.2, 0.70), (-0.05, 0.7, 0.74), wood, bevel=0.008)
    for x in (-1.68, -0.18):
        for y in (-0.13, 0.57):
            box("leg", (x, y, 0.0), (x + 0.06, y + 0.06, 0.70), wood)


def vase(name, x, made):
    profile = [(0.0, 0.0), (0.09, 0.0), (0.15, 0.08), (0.165, 0.16), (0.13, 0.25), (0.075, 0.31), (0.07, 0.35),
               (0.10, 0.39), (0.095, 0.395), (0.06, 0.35), (0.065, 0.31), (0.12, 0.245), (0.155, 0.16), (0.14, 0.085),
               (0.08, 0.012), (0.0, 0.012)]  # fmt: skip
    lathe(name, profile, made, (x, 0.25, 0.7405))


new_scene(640, 480, samples=512, view="AgX")
wall = diffuse("wall", (0.75, 0.72, 0.68))
wood = material("wood", "ShaderNodeBsdfPrincipled", Base_Color=(0.42, 0.23, 0.10), Roughness=0.35)
brass = material("brass", "ShaderNodeBsdfPrincipled", Base_Color=(0.9, 0.65, 0.3), Metallic=1.0, Roughness=0.2)
room("near", (-2.5, 2.5), (-3.0, NEAR_FACE), checker_floor(), wall, diffuse("blue wall", (0.30, 0.42, 0.62)))
rectangle("near back", (-2.5, 2.5), -3.0, (0, HEIGHT), wall)
room("far", (-0.6, 3.6), (FAR_FACE, 5.2), diffuse("far floor", (0.45, 0.30, 0.18)), wall, wall)
rectangle("far back", (-0.6, 3.6), 5.2, (0, HEIGHT), diffuse("ochre wall", (0.70, 0.55, 0.30)))
dividing_wall(wall)
door(wood, brass)
table(wood)
vase("clay vase", -1.4, diffuse("clay", (0.70, 0.25, 0.20)))
vase("mirror vase", -0.9, mirror("mirror"))
vase("glass vase", -0.4, glass("glass"))
area_lamp("lamp", (1.95, 3.85, HEIGHT - 0.001), (0.8, 0.8), 1600.0, (1.0, 0.9, 0.75))
camera((-1.15, -2.85, 1.45), (0.1, 2.0, 1.0), lens=34.0)
save(__file__)
