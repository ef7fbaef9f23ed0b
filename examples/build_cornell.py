"""Builds cornell.blend: the Cornell box as measured [Cornell University Program of Computer Graphics, 1998],
its spectra given as linear Rec. 709 colours. Ten times its true size, so that one unit is 10 cm of the model."""

from blocks import camera, diffuse, material, mesh, new_scene, quad, save

MILLIMETRE = 0.01  # of the model, in metres of the scene


def place(corner):
    """The published data has y up and looks along +z; here z is up and +y is away from the camera."""
    x, y, z = corner
    return (-x * MILLIMETRE, z * MILLIMETRE, y * MILLIMETRE)


def block(name, top, height, made):
    """A block from the corners (x, z) of its top."""
    above = [place((x, height, z)) for x, z in top]
    below = [place((x, 0.0, z)) for x, z in top]
    sides = [(i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4)]
    mesh(name, above + below, [(0, 3, 2, 1), *[tuple(reversed(s)) for s in sides]], made)


def wall(name, corners, made):
    quad(name, [place(c) for c in corners], made)


new_scene(512, 512, samples=256)
white = diffuse("white", (0.885809, 0.698859, 0.666422))
wall("floor", [(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)], white)
wall("ceiling", [(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)], white)
wall("back", [(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)], white)
green = diffuse("green", (0.105421, 0.37798, 0.076425))
wall("right", [(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)], green)
red = diffuse("red", (0.570068, 0.0430135, 0.0443706))
wall("left", [(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)], red)
block("short block", [(130, 65), (82, 225), (240, 272), (290, 114)], 165, white)
block("tall block", [(423, 247), (265, 296), (314, 456), (472, 406)], 330, white)
lamp = material("lamp", "ShaderNodeEmission", Color=(1.0, 13.9873 / 18.387, 6.75357 / 18.387), Strength=18.387)
wall("lamp", [(343, 548.3, 227), (343, 548.3, 332), (213, 548.3, 332), (213, 548.3, 227)], lamp)
camera(place((278, 273, -800)), place((278, 273, 0)), lens=35.0, sensor=25.0)
save(__file__)
