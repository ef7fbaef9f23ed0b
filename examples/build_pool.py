"""Builds pool.blend: a basin under waves with a small lamp above. All that is seen of it is a caustic seen through water: light, glass,
diffuse, glass, eye, which paths that meet the lamp by chance or are joined to it do not find. Run with `python build_pool.py`."""

import math

from blocks import area_lamp, camera, diffuse, glass, mesh, new_scene, quad, save, sphere

SIDE, DEPTH, STEPS = 2.0, 0.9, 96
# (wavelength in metres, direction in degrees, height in metres) of the waves
WAVES = [(0.9, 20, 0.012), (0.62, 75, 0.008), (0.45, -40, 0.006), (0.31, 130, 0.003)]


def height(x, y):
    total = 0.0
    for k, (length, angle, amplitude) in enumerate(WAVES):
        along = x * math.cos(math.radians(angle)) + y * math.sin(math.radians(angle))
        total += amplitude * math.sin(2 * math.pi * along / length + k)
    return total


def water(made):
    at = [-SIDE / 2 + SIDE * k / STEPS for k in range(STEPS + 1)]
    vertices = [(x, y, height(x, y)) for y in at for x in at]
    faces = [
        (row * (STEPS + 1) + k, row * (STEPS + 1) + k + 1, (row + 1) * (STEPS + 1) + k + 1, (row + 1) * (STEPS + 1) + k)
        for row in range(STEPS)
        for k in range(STEPS)
    ]
    surface = mesh("water", vertices, faces, made)
    for polygon in surface.data.polygons:
        polygon.use_smooth = True


def basin(made, rim):
    s, low, high = SIDE / 2, -DEPTH, 0.12
    quad("ground", [(-s, -s, low), (s, -s, low), (s, s, low), (-s, s, low)], made)
    corners = [(-s, -s), (s, -s), (s, s), (-s, s)]
    for k, (a, b) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True)):
        quad(f"wall {k}", [(*b, low), (*a, low), (*a, high), (*b, high)], rim if k == 2 else made)


new_scene(512, 384, samples=256)
basin(diffuse("tiles", (0.55, 0.72, 0.75)), diffuse("far tiles", (0.35, 0.6, 0.7)))
water(glass("water", ior=1.33))
sphere("ball", (0.3, 0.25, -DEPTH + 0.18), 0.18, diffuse("red", (0.75, 0.15, 0.1)))
area_lamp("lamp", (-0.5, 0.3, 2.4), (0.12, 0.12), 60.0, (1.0, 0.96, 0.9))
camera((0.0, -2.2, 1.9), (0.0, 0.05, -0.5), 45.0)
save(__file__)
