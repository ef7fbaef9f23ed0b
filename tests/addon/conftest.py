"""Fixtures for tests inside Blender: a clean file, small objects, and an engine that only exports."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

import gi_engine
from gi_engine import native
from gi_engine.export import export

from . import exr


@pytest.fixture(scope="session", autouse=True)
def registered():
    if not hasattr(bpy.types.Scene, "gi_engine"):
        gi_engine.register()
    bpy.utils.register_class(ExportOnly)
    yield
    bpy.utils.unregister_class(ExportOnly)


@pytest.fixture
def scene(registered):
    """An empty file with a camera that looks down from 5 m."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0, 0, 5)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "GI_ENGINE"
    scene.render.resolution_x, scene.render.resolution_y = 16, 12
    scene.render.resolution_percentage = 100
    scene.cycles.samples = 1
    return scene


class ExportOnly(bpy.types.RenderEngine):
    """Exports as a final render does, with Blender's own render depsgraph, and renders nothing."""

    bl_idname = "GI_TEST_EXPORT"
    bl_label = "Export only"
    exported: list = []
    error: Exception | None = None

    def update(self, data=None, depsgraph=None):
        cls = type(self)
        try:
            size = (self.resolution_x, self.resolution_y)
            cls.exported.append(export(depsgraph, native.integrators(), self, size))
        except Exception as error:
            cls.error = error

    def render(self, depsgraph):
        self.end_result(self.begin_result(0, 0, 1, 1, layer=depsgraph.view_layer.name))


@pytest.fixture
def render_export(scene):
    """Exports the scene as F12 would: render visibility, modifiers for rendering. One result a view layer."""

    def run(everything=False):
        ExportOnly.exported, ExportOnly.error = [], None
        engine, scene.render.engine = scene.render.engine, ExportOnly.bl_idname
        bpy.ops.render.render()
        scene.render.engine = engine
        if ExportOnly.error:
            raise ExportOnly.error
        return ExportOnly.exported if everything else ExportOnly.exported[0]

    return run


@pytest.fixture
def rendered(tmp_path):
    """Renders into a multilayer EXR of full floats and reads it."""

    def run(scene):
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
        if scene.render.use_multiview:
            settings.views_format = "MULTIVIEW"
        scene.render.filepath = str(tmp_path / "out.exr")
        bpy.ops.render.render(write_still=True)
        return exr.read(tmp_path / "out.exr")

    return run


def add(scene, name: str, data, **properties):
    """Links a new object with the given data and properties."""
    item = bpy.data.objects.new(name, data)
    for key, value in properties.items():
        setattr(item, key, value)
    scene.collection.objects.link(item)
    return item


def mesh(name: str = "Mesh", vertices=((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), faces=((0, 1, 2, 3),)):
    """A unit square unless told otherwise."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    return data


def grid(n: int):
    """n x n quads over the unit square, bent and smooth, with a UV map."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    vertices = np.stack([x, y, 0.1 * np.sin(7 * x) * np.cos(5 * y)], -1).reshape(-1, 3)
    corner = np.arange((n + 1) * (n + 1)).reshape(n + 1, n + 1)
    faces = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], -1).reshape(-1, 4)
    data = bpy.data.meshes.new("Grid")
    data.vertices.add(len(vertices))
    data.vertices.foreach_set("co", vertices.ravel().astype(np.float32))
    data.loops.add(faces.size)
    data.loops.foreach_set("vertex_index", faces.ravel().astype(np.int32))
    data.polygons.add(len(faces))
    data.polygons.foreach_set("loop_start", np.arange(0, faces.size, 4, dtype=np.int32))
    layer = data.uv_layers.new(name="UVMap")
    layer.uv.foreach_set("vector", vertices[faces.ravel(), :2].astype(np.float32).ravel())
    data.update(calc_edges=True)
    data.shade_smooth()
    return data


def named(items, name: str):
    """The exported thing of that name; there must be exactly one."""
    (found,) = [item for item in items if item.name == name]
    return found


def places(instance) -> np.ndarray:
    """(n, 3): where the copies of an instance are, sorted."""
    matrices = np.reshape(instance.matrix, (-1, 4, 4))
    return np.array(sorted(matrices[:, :3, 3].tolist()))
