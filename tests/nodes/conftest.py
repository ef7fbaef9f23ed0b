"""One node at a time: its value as the emission of a curved surface, seen by Cycles and by the native programs."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

import gi_engine
from gi_engine import native
from gi_engine.export import export

SIZE = 24


class ExportNodes(bpy.types.RenderEngine):
    """Exports as a final render does and renders nothing."""

    bl_idname = "GI_TEST_NODES"
    bl_label = "Export nodes"
    bl_use_shading_nodes_custom = False
    result = None

    def update(self, data=None, depsgraph=None):
        type(self).result = export(depsgraph, native.integrators(), self, (self.resolution_x, self.resolution_y))

    def render(self, depsgraph):
        self.end_result(self.begin_result(0, 0, 1, 1, layer=depsgraph.view_layer.name))


@pytest.fixture(scope="session", autouse=True)
def registered():
    if not hasattr(bpy.types.Scene, "gi_engine"):
        gi_engine.register()
    bpy.utils.register_class(ExportNodes)
    yield
    bpy.utils.unregister_class(ExportNodes)


class Stage:
    """A scene with one object whose material is a node tree under test."""

    def __init__(self, tmp_path):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.path = tmp_path / "cycles.exr"
        self.scene = scene = bpy.context.scene
        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        camera.location, camera.rotation_euler = (0.3, -3.0, 1.4), (1.1, 0.05, 0.1)
        scene.collection.objects.link(camera)
        scene.camera = camera
        scene.render.resolution_x = scene.render.resolution_y = SIZE
        scene.render.filter_size = 0.01
        scene.cycles.samples = 1
        scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
        scene.cycles.max_bounces = 0
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_mode, scene.render.image_settings.color_depth = "RGBA", "32"
        scene.render.filepath = str(self.path)
        self.object = add_surface(scene)
        self.material = bpy.data.materials.new("Under test")
        self.object.data.materials.append(self.material)
        self.tree = node_tree(self.material)
        self.emission = self.new("ShaderNodeEmission")
        output = self.new("ShaderNodeOutputMaterial")
        self.link(self.emission.outputs[0], output.inputs["Surface"])

    def new(self, idname: str, **settings):
        node = self.tree.nodes.new(idname)
        for name, value in settings.items():
            setattr(node, name, value)
        return node

    def link(self, output, socket):
        return self.tree.links.new(output, socket)

    def harden(self) -> None:
        """Some faces flat, some edges sharp: the mesh has normals of corners."""
        mesh = self.object.data
        mesh.polygons.foreach_set("use_smooth", [k % 5 != 0 for k in range(len(mesh.polygons))])
        sharp = mesh.attributes.new("sharp_edge", "BOOLEAN", "EDGE")
        sharp.data.foreach_set("value", [k % 4 == 0 for k in range(len(mesh.edges))])
        assert mesh.normals_domain == "CORNER"

    def waves(self, scale=9.0):
        """A smooth height that varies over the surface."""
        apart, product = self.new("ShaderNodeSeparateXYZ"), self.new("ShaderNodeMath", operation="MULTIPLY")
        self.link(self.new("ShaderNodeTexCoord").outputs["Object"], apart.inputs[0])
        for i in range(2):
            times, sine = self.new("ShaderNodeMath", operation="MULTIPLY"), self.new("ShaderNodeMath", operation="SINE")
            times.inputs[1].default_value = scale
            self.link(apart.outputs[i], times.inputs[0])
            self.link(times.outputs[0], sine.inputs[0])
            self.link(sine.outputs[0], product.inputs[i])
        return product.outputs[0]

    def show(self, output) -> None:
        self.link(output, self.emission.inputs["Color"])

    def cycles(self) -> np.ndarray:
        self.scene.render.engine = "CYCLES"
        bpy.ops.render.render(write_still=True)
        return self.rendered()

    def rendered(self) -> np.ndarray:
        """What was written last."""
        image = bpy.data.images.load(str(self.path))
        image.colorspace_settings.name = "Non-Color"
        pixels = np.empty(SIZE * SIZE * 4, np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
        return pixels.reshape(SIZE, SIZE, 4)[..., :3]

    def ours(self) -> np.ndarray:
        self.scene.render.engine = ExportNodes.bl_idname
        bpy.ops.render.render()
        result = ExportNodes.result
        self.exported, self.warnings = result.scene, list(result.warnings)
        return native.build_scene(self.exported, threads=1).emission_seen(self.exported.camera, SIZE, SIZE)

    def check(self, tolerance=2e-4, outliers=0.02) -> np.ndarray:
        """Both engines see the same, up to what the value changes over 2 % of a pixel (Cycles jitters its ray by 1 %), but for
        the few pixels where a jump of the value falls between the two rays."""
        cycles, ours = self.cycles(), self.ours()
        assert np.isfinite(ours).all()
        size = np.maximum(1.0, np.abs(cycles))
        wrong = (np.abs(ours - cycles) > tolerance * size + 0.02 * change_over_pixel(cycles)).any(-1)
        assert wrong.mean() <= outliers, (
            f"{wrong.mean():.1%} of the pixels differ, by up to {np.abs(ours - cycles).max():.3g}"
        )
        return ours


def change_over_pixel(image: np.ndarray) -> np.ndarray:
    """The largest difference to a neighbour."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    near = [padded[1 + dy : 1 + dy + SIZE, 1 + dx : 1 + dx + SIZE] for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    return np.abs(np.stack(near) - image).max(0)


def node_tree(owner):
    if owner.node_tree is None or not hasattr(owner, "inline_shader_nodes"):
        owner.use_nodes = True
    owner.node_tree.nodes.clear()
    return owner.node_tree


def add_surface(scene):
    """A wavy smooth patch that fills part of the view, with two UV maps and attributes, under a turned and scaled object."""
    n = 12
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    z = 0.3 * np.sin(2 * x) * np.cos(3 * y)
    mesh = bpy.data.meshes.new("Patch")
    index = np.arange(n * n).reshape(n, n)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], -1).reshape(-1, 4)
    mesh.from_pydata(np.stack([x, y, z], -1).reshape(-1, 3).tolist(), [], quads.tolist())
    mesh.shade_smooth()
    corner = quads.reshape(-1)
    for name, scale in (("First", 1.0), ("Second", 2.0)):
        uv = np.stack([x.ravel()[corner] * 0.5 + 0.5, scale * y.ravel()[corner] + 0.1 * x.ravel()[corner]], -1).astype(
            np.float32
        )
        mesh.uv_layers.new(name=name).data.foreach_set("uv", uv.ravel())
    rng = np.random.default_rng(1)
    mesh.attributes.new("number", "FLOAT", "POINT").data.foreach_set("value", rng.random(n * n).astype(np.float32))
    mesh.attributes.new("vector", "FLOAT_VECTOR", "FACE").data.foreach_set(
        "vector", rng.random(len(quads) * 3).astype(np.float32)
    )
    mesh.color_attributes.new("paint", "FLOAT_COLOR", "CORNER").data.foreach_set(
        "color", rng.random(len(corner) * 4).astype(np.float32)
    )
    patch = bpy.data.objects.new("Patch", mesh)
    patch.location, patch.rotation_euler, patch.scale = (0.1, 0.2, -0.1), (0.2, -0.1, 0.4), (1.5, 1.2, 0.9)
    patch.color, patch.pass_index = (0.2, 0.4, 0.6, 0.7), 3
    patch["custom"] = 0.35
    scene.collection.objects.link(patch)
    return patch


@pytest.fixture
def stage(tmp_path, registered):
    return Stage(tmp_path)
