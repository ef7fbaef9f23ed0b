"""Builds jensen_box.blend: the Cornell box with a mirror and a glass sphere of the photon-map literature
[Jensen 1996, "Global illumination using photon maps"]. Run with `python build_jensen_box.py`, bpy installed."""

from blocks import area_lamp, camera, diffuse, glass, mirror, new_scene, quad, save, sphere


def walls(white, left, right):
    """A box of 2 m, open towards the camera at -y."""
    quad("floor", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], white)
    quad("ceiling", [(-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2)], white)
    quad("back", [(-1, 1, 0), (1, 1, 0), (1, 1, 2), (-1, 1, 2)], white)
    quad("left", [(-1, -1, 0), (-1, 1, 0), (-1, 1, 2), (-1, -1, 2)], left)
    quad("right", [(1, -1, 0), (1, -1, 2), (1, 1, 2), (1, 1, 0)], right)


new_scene(512, 512, samples=256)
walls(diffuse("white", (0.75, 0.75, 0.75)), diffuse("red", (0.70, 0.12, 0.10)), diffuse("blue", (0.12, 0.18, 0.60)))
sphere("mirror ball", (-0.44, 0.42, 0.4), 0.4, mirror("mirror"))
sphere("glass ball", (0.46, -0.22, 0.4), 0.4, glass("glass"))
area_lamp("lamp", (0, 0, 1.999), (0.5, 0.5), 17.0, (1.0, 0.96, 0.9))
camera((0, -5.2, 1.0), (0, 0, 1.0), 74.0)
save(__file__)
