"""Blender's camera (sensor fit, shift, pixel aspect, depth of field) to scene_data.Camera.

Of the panoramic projections only the equirectangular one exists; the others are rendered with it, under a warning.
"""

from __future__ import annotations

import math

import numpy as np

from ..scene_data import Camera
from .warnings import Warnings

LOOK_THROUGH_SENSOR = 0.036  # metres: the sensor of a lamp that is looked through


def export_camera(engine, camera_object, render, width: int, height: int, warnings: Warnings) -> Camera:
    """`width` and `height` are the full frame's, in pixels; `engine` (or None) tells the stereo eye's offset."""
    data = camera_object.data
    matrix = camera_matrix(engine, camera_object)
    if camera_object.type != "CAMERA":
        return export_spot_as_camera(camera_object, matrix, render, width, height)
    kind = {"PERSP": "PERSP", "ORTHO": "ORTHO", "PANO": "PANO"}.get(data.type)
    if kind is None:
        warnings.add("custom cameras are not supported; rendered as perspective", camera_object.name)
        kind = "PERSP"
    shift = (engine.camera_shift_x(camera_object) if engine else data.shift_x, data.shift_y)
    camera = Camera(
        name=camera_object.name, kind=kind, matrix=matrix, clip_start=data.clip_start, clip_end=data.clip_end
    )
    if kind == "PANO":
        set_panorama(camera, data, shift, warnings)
    else:
        fit = data.sensor_fit
        sensor = data.sensor_height if fit == "VERTICAL" else data.sensor_width
        extent = data.ortho_scale if kind == "ORTHO" else sensor / data.lens
        camera.view_plane = view_plane(
            fit, extent, shift, width * render.pixel_aspect_x, height * render.pixel_aspect_y
        )
    if data.dof.use_dof:
        set_depth_of_field(camera, data, matrix)
    return camera


def camera_matrix(engine, camera_object) -> np.ndarray:
    """Object to world with scale taken out of each axis, as a camera has none."""
    if engine:
        # The API hands a flat column-major list in older versions and a Matrix in newer ones.
        world = np.array(engine.camera_model_matrix(camera_object, use_spherical_stereo=False), np.float32)
        world = world if world.shape == (4, 4) else world.reshape(4, 4).T
    else:
        world = np.array(camera_object.matrix_world, np.float32)
    matrix = np.array(world, order="C")  # Blender's memory is column-major
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    if not np.all(np.isfinite(matrix)) or np.any(lengths == 0):
        raise ValueError(f'camera "{camera_object.name}" has a singular matrix (scale 0 or not finite)')
    matrix[:3, :3] /= lengths
    return matrix


def view_plane(fit: str, extent: float, shift, x_size: float, y_size: float) -> tuple[float, float, float, float]:
    """left, right, bottom, top. `extent` spans the fitted side; the shift is in units of it."""
    horizontal = x_size > y_size if fit == "AUTO" else fit == "HORIZONTAL"
    if horizontal:
        half_x, half_y = extent / 2, extent / 2 * y_size / x_size
    else:
        half_x, half_y = extent / 2 * x_size / y_size, extent / 2
    x, y = shift[0] * extent, shift[1] * extent
    return (x - half_x, x + half_x, y - half_y, y + half_y)


def set_panorama(camera: Camera, data, shift, warnings: Warnings) -> None:
    if data.panorama_type != "EQUIRECTANGULAR":
        kind = data.panorama_type.replace("_", " ").lower()
        warnings.add(f"{kind} panoramas are not supported; rendered as equirectangular", camera.name)
    # The shift moves the frame by a fraction of itself.
    longitude, latitude = data.longitude_max - data.longitude_min, data.latitude_max - data.latitude_min
    camera.longitude = tuple(x + shift[0] * longitude for x in (data.longitude_min, data.longitude_max))
    camera.latitude = tuple(x + shift[1] * latitude for x in (data.latitude_min, data.latitude_max))


def set_depth_of_field(camera: Camera, data, matrix: np.ndarray) -> None:
    dof = data.dof
    f_stop = max(dof.aperture_fstop, 1e-5)
    # An orthographic camera has no focal length: Blender takes 1 m.
    focal_length = 1.0 if camera.kind == "ORTHO" else data.lens * 1e-3
    camera.aperture_radius = focal_length / (2 * f_stop)
    camera.aperture_blades = dof.aperture_blades
    camera.aperture_rotation = dof.aperture_rotation
    camera.aperture_ratio = dof.aperture_ratio
    camera.focus_distance = focus_distance(dof, matrix)


def focus_distance(dof, matrix: np.ndarray) -> float:
    """To the focus object (or the bone named of it), along the viewing direction."""
    target = dof.focus_object
    if target is None:
        return dof.focus_distance
    world = target.matrix_world
    bone = target.pose.bones.get(dof.focus_subtarget) if target.pose and dof.focus_subtarget else None
    if bone:
        world = world @ bone.matrix
    return float(abs(np.dot(matrix[:3, 2], matrix[:3, 3] - np.array(world.translation, np.float32))))


def export_spot_as_camera(lamp_object, matrix, render, width: int, height: int) -> Camera:
    """Any object can be the scene's camera; a spot lamp sets the field of view, the rest look as a 50 mm lens does."""
    spot = lamp_object.type == "LIGHT" and lamp_object.data.type == "SPOT"
    lens = 0.016 / math.tan(lamp_object.data.spot_size / 2) if spot else 0.05
    plane = view_plane(
        "AUTO", LOOK_THROUGH_SENSOR / lens, (0, 0), width * render.pixel_aspect_x, height * render.pixel_aspect_y
    )
    return Camera(lamp_object.name, "PERSP", matrix, plane, clip_start=1e-5, clip_end=1e5)
