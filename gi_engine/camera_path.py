"""Where the camera will be in the frames of an animation: so that what is kept of the first frame serves them all. Leaves out moving
objects: of frames to come only the camera is looked at.
"""

from __future__ import annotations

from .content import digest
from .export import export_active_camera
from .export.film import frame_size
from .export.warnings import Warnings
from .scene_data import Camera

MOST_FRAMES = 16


def collect(context, frames: list[int]) -> list[Camera]:
    """The camera at some of `frames`, each place once; none where it stands still. The scene's frame is as before in the end.
    Raises ExportError."""
    scene = context.scene
    before = scene.frame_current, scene.frame_subframe
    step = max(1, -(-len(frames) // MOST_FRAMES))
    found = {}
    try:
        for frame in sorted({*frames[::step], *frames[-1:]}):
            scene.frame_set(frame)
            camera = export_active_camera(
                None, context.evaluated_depsgraph_get(), *frame_size(scene.render), Warnings()
            )
            found[digest(camera)] = camera
    finally:
        scene.frame_set(before[0], subframe=before[1])
    return list(found.values()) if len(found) > 1 else []
