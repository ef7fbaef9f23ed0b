"""What a 3D viewport looks at: Camera and Film from its matrices, so that zoom, offset, shift and lens come out as Blender draws them.
No bpy: the caller hands in numbers. Panoramas are left out: the viewport shows them in perspective, as Blender's own do."""

from __future__ import annotations

import dataclasses

import numpy as np

from .scene_data import Camera, Film


def camera_of(view: np.ndarray, window: np.ndarray) -> Camera:
    """`view`: world to camera; `window`: Blender's projection matrix (both 4x4, row-major)."""
    matrix = np.linalg.inv(np.asarray(view, np.float64))
    matrix[:3, :3] /= np.linalg.norm(matrix[:3, :3], axis=0)
    w = np.asarray(window, np.float64)
    if w[3, 3] == 0:  # perspective: clip = (x w00 + z w02, …, -z)
        plane = ((w[0, 2] - 1) / w[0, 0], (w[0, 2] + 1) / w[0, 0], (w[1, 2] - 1) / w[1, 1], (w[1, 2] + 1) / w[1, 1])
        near, far = w[2, 3] / (w[2, 2] - 1), w[2, 3] / (w[2, 2] + 1)
        kind = "PERSP"
    else:
        plane = (-(1 + w[0, 3]) / w[0, 0], (1 - w[0, 3]) / w[0, 0], -(1 + w[1, 3]) / w[1, 1], (1 - w[1, 3]) / w[1, 1])
        near, far = (w[2, 3] + 1) / w[2, 2], (w[2, 3] - 1) / w[2, 2]
        # Blender sees what is behind an orthographic view, too: the camera steps back.
        matrix[:3, 3] -= near * matrix[:3, 2]
        near, far, kind = 0.0, far - near, "ORTHO"
    return Camera(
        "viewport", kind, np.ascontiguousarray(matrix, np.float32), tuple(map(float, plane)), float(near), float(far)
    )


def same_camera(a: Camera | None, b: Camera | None) -> bool:
    if a is None or b is None:
        return a is b
    fields = [field.name for field in dataclasses.fields(Camera) if field.name != "matrix"]
    return np.array_equal(a.matrix, b.matrix) and all(getattr(a, name) == getattr(b, name) for name in fields)


def reduced(film: Film, scale: int) -> Film:
    """The same picture with 1/scale of the pixels each way."""
    x0, y0, x1, y1 = film.region
    region = (x0 // scale, y0 // scale, max(x0 // scale + 1, x1 // scale), max(y0 // scale + 1, y1 // scale))
    width, height = max(region[2], film.width // scale), max(region[3], film.height // scale)
    return dataclasses.replace(film, width=width, height=height, region=region)


def border_region(corners, width: int, height: int) -> tuple[int, int, int, int]:
    """x0, y0, x1, y1 of a border given by two corners as shares of the view, clipped to it and at least a pixel."""
    (left, bottom), (right, top) = corners
    x0, y0 = int(np.clip(left * width, 0, width - 1)), int(np.clip(bottom * height, 0, height - 1))
    x1, y1 = int(np.clip(right * width, x0 + 1, width)), int(np.clip(top * height, y0 + 1, height))
    return x0, y0, x1, y1
