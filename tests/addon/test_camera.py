"""The exported camera against Blender's own projection."""

from __future__ import annotations

import itertools
import math

import bpy
import numpy as np
import pytest

from .conftest import add

FITS = ("AUTO", "HORIZONTAL", "VERTICAL")
SIZES = ((64, 36), (30, 50), (40, 40))


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("fit,size", list(itertools.product(FITS, SIZES)))
@pytest.mark.parametrize("aspect", [(1, 1), (2, 1), (1, 1.5)])
def test_the_view_plane_is_the_projection_matrix(scene, render_export, kind, fit, size, aspect):
    camera, render = scene.camera.data, scene.render
    camera.type, camera.sensor_fit, camera.lens, camera.ortho_scale = kind, fit, 35, 3
    camera.sensor_width, camera.sensor_height = 32, 20
    camera.shift_x, camera.shift_y = 0.3, -0.2
    render.resolution_x, render.resolution_y = size
    render.pixel_aspect_x, render.pixel_aspect_y = aspect
    left, right, bottom, top = render_export().scene.camera.view_plane
    projection = scene.camera.calc_matrix_camera(
        bpy.context.evaluated_depsgraph_get(), x=size[0], y=size[1], scale_x=aspect[0], scale_y=aspect[1]
    )
    # The corners of the plane (at distance 1) must fall on the corners of the screen.
    for x, y, screen in ((left, bottom, (-1, -1)), (right, top, (1, 1))):
        point = np.array(projection) @ (x, y, -1, 1)
        np.testing.assert_allclose(point[:2] / point[3], screen, atol=2e-6)


def test_scale_is_taken_out_of_the_matrix(scene, render_export):
    scene.camera.scale = (2, 3, -4)
    scene.camera.rotation_euler = (0.3, 0.2, 0.1)
    matrix = render_export().scene.camera.matrix
    np.testing.assert_allclose(np.linalg.norm(matrix[:3, :3], axis=0), 1, atol=1e-6)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(-1, abs=1e-5)
    np.testing.assert_allclose(matrix[:3, 3], (0, 0, 5))


def test_depth_of_field(scene, render_export):
    camera = scene.camera.data
    dof = camera.dof
    camera.lens, dof.use_dof, dof.aperture_fstop, dof.focus_distance = 50, True, 2.0, 3.0
    dof.aperture_blades, dof.aperture_ratio, dof.aperture_rotation = 5, 1.5, 0.4
    found = render_export().scene.camera
    assert found.aperture_radius == pytest.approx(0.05 / 4) and found.focus_distance == 3
    assert (found.aperture_blades, found.aperture_ratio) == (5, 1.5)
    assert found.aperture_rotation == pytest.approx(0.4)
    # Along the viewing direction, not as the crow flies; through the parent's transform.
    target = add(scene, "Target", None, location=(7, 0, 1))
    target.parent = add(scene, "Parent", None, location=(0, 0, -2))
    dof.focus_object = target
    assert render_export().scene.camera.focus_distance == pytest.approx(5 - -1)
    camera.type = "ORTHO"
    assert render_export().scene.camera.aperture_radius == pytest.approx(1 / 4)
    dof.use_dof = False
    assert render_export().scene.camera.aperture_radius == 0


def test_the_focus_can_be_a_bone(scene, render_export):
    armature = bpy.data.armatures.new("Armature")
    rig = add(scene, "Rig", armature, location=(0, 0, 1))
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.edit_bones.new("Bone")
    bone.head, bone.tail = (0, 0, 2), (0, 1, 2)
    bpy.ops.object.mode_set(mode="OBJECT")
    dof = scene.camera.data.dof
    dof.use_dof, dof.focus_object, dof.focus_subtarget = True, rig, "Bone"
    assert render_export().scene.camera.focus_distance == pytest.approx(5 - 3)


def test_panorama(scene, render_export):
    camera = scene.camera.data
    camera.type, camera.panorama_type = "PANO", "EQUIRECTANGULAR"
    camera.latitude_min, camera.latitude_max = -1, 0.5
    camera.shift_x = 0.25
    found = render_export().scene.camera
    assert found.kind == "PANO"
    assert found.latitude == pytest.approx((-1, 0.5))
    assert found.longitude == pytest.approx((-math.pi / 2, 3 * math.pi / 2))
    camera.panorama_type = "MIRRORBALL"
    (message,) = render_export().warnings
    assert "mirrorball" in message and '"Camera"' in message


def test_a_camera_without_scale_is_named(scene, render_export):
    scene.camera.scale = (0, 1, 1)
    with pytest.raises(ValueError, match='camera "Camera" has a singular matrix'):
        render_export()


def test_clip_planes(scene, render_export):
    scene.camera.data.clip_start, scene.camera.data.clip_end = 0.5, 70
    found = render_export().scene.camera
    assert (found.clip_start, found.clip_end) == (0.5, 70)


def test_looking_through_a_spot_lamp(scene, render_export):
    lamp = bpy.data.lights.new("Spot", "SPOT")
    lamp.spot_size = math.radians(90)
    scene.camera = add(scene, "Spot", lamp)
    scene.render.resolution_x = scene.render.resolution_y = 10
    left, right, _, _ = render_export().scene.camera.view_plane
    assert right == -left == pytest.approx(18 / 16)
