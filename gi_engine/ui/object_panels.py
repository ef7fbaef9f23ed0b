"""Object, light, world and material tabs: what Blender's shared panels leave out.

Options that Cycles owns (multiple importance, sampling of emission, …) are shown where they are: we read the same.
"""

from __future__ import annotations

import bpy

from .. import approximations
from ..export.shaders import has_nodes
from .panel import Panel, columns


class GI_LIGHT_PT_light(Panel, bpy.types.Panel):
    bl_label = "Light"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light is not None

    def draw(self, context):
        light = context.light
        self.layout.row().prop(light, "type", expand=True)
        column = columns(self.layout)
        draw_color(column, light)
        column.prop(light, "energy", text="Strength" if light.type == "SUN" else "Power")
        column.prop(light, "exposure")
        column.prop(light, "normalize")
        column = columns(self.layout)
        SHAPES[light.type](column, light)
        column = columns(self.layout)
        column.prop(light, "use_shadow", text="Cast Shadow")
        draw_cycles(column, getattr(light, "cycles", None), ("use_multiple_importance_sampling", "max_bounces"))


def draw_color(column, light) -> None:
    column.prop(light, "use_temperature")
    if light.use_temperature:
        column.prop(light, "temperature")
        column.prop(light, "color", text="Tint")
    else:
        column.prop(light, "color")


def draw_point(column, light) -> None:
    column.prop(light, "use_soft_falloff")
    column.prop(light, "shadow_soft_size", text="Radius")


def draw_spot(column, light) -> None:
    draw_point(column, light)
    column.prop(light, "spot_size", text="Beam Angle")
    column.prop(light, "spot_blend", text="Blend", slider=True)
    column.prop(light, "show_cone")


def draw_area(column, light) -> None:
    column.prop(light, "shape")
    if light.shape in {"RECTANGLE", "ELLIPSE"}:
        column.prop(light, "size", text="Size X")
        column.prop(light, "size_y", text="Y")
    else:
        column.prop(light, "size")
    column.prop(light, "spread")


def draw_sun(column, light) -> None:
    column.prop(light, "angle")


SHAPES = {"POINT": draw_point, "SPOT": draw_spot, "AREA": draw_area, "SUN": draw_sun}


def draw_cycles(column, owner, names) -> None:
    for name in names:
        if hasattr(owner, name):
            column.prop(owner, name)


def draw_nodes(layout, owner, socket: str, plain: str = "") -> None:
    """The tree that ends in a socket of the output that Cycles and we render, which need not be EEVEE's.
    `plain` is the property that counts where there is no tree, and no other panel shows."""
    layout.use_property_split = True
    if not has_nodes(owner):
        layout.prop(owner, "use_nodes", icon="NODETREE")
        if plain:
            layout.prop(owner, plain)
        return
    output = owner.node_tree.get_output_node("CYCLES")
    if output:
        layout.template_node_view(owner.node_tree, output, output.inputs[socket])
    else:
        layout.label(text="No output node")


class GI_LIGHT_PT_nodes(Panel, bpy.types.Panel):
    bl_label = "Nodes"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light is not None

    def draw(self, context):
        draw_nodes(self.layout, context.light, "Surface")


class MaterialPanel(Panel):
    bl_context = "material"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.material is not None and not context.material.grease_pencil


class GI_MATERIAL_PT_surface(MaterialPanel, bpy.types.Panel):
    bl_label = "Surface"

    def draw(self, context):
        draw_nodes(self.layout, context.material, "Surface", "diffuse_color")


class GI_MATERIAL_PT_displacement(MaterialPanel, bpy.types.Panel):
    bl_label = "Displacement"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and has_nodes(context.material)

    def draw(self, context):
        draw_nodes(self.layout, context.material, "Displacement")


class GI_MATERIAL_PT_volume(MaterialPanel, bpy.types.Panel):
    bl_label = "Volume"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and has_nodes(context.material)

    def draw(self, context):
        draw_nodes(self.layout, context.material, "Volume")


class GI_MATERIAL_PT_approximated(MaterialPanel, bpy.types.Panel):
    """What the last render or preview said of the material's nodes."""

    bl_label = ""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and bool(approximations.of(context.material.name))

    def draw_header(self, context):
        self.layout.label(text=approximations.heading(approximations.of(context.material.name)), icon="INFO")

    def draw(self, context):
        column = self.layout.column(align=True)
        for text in approximations.of(context.material.name):
            column.label(text=text)


class WorldPanel(Panel):
    bl_context = "world"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.world is not None


class GI_WORLD_PT_preview(WorldPanel, bpy.types.Panel):
    bl_label = "Preview"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.layout.template_preview(context.world)


class GI_WORLD_PT_surface(WorldPanel, bpy.types.Panel):
    bl_label = "Surface"

    def draw(self, context):
        draw_nodes(self.layout, context.world, "Surface", "color")


GEOMETRY = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME"}


class GI_OBJECT_PT_visibility(Panel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_parent_id = "OBJECT_PT_visibility"
    bl_context = "object"

    @classmethod
    def poll(cls, context):
        item = context.object
        return super().poll(context) and item is not None and (item.type in GEOMETRY | {"LIGHT"} or item.is_instancer)

    def draw(self, context):
        item = context.object
        names = ["camera", "diffuse", "glossy", "transmission", "shadow"]
        if item.type == "LIGHT":
            names.remove("shadow")
        column = columns(self.layout)
        for name in names:
            column.prop(item, f"visible_{name}", text=name.title())


class CyclesWorldPanel(WorldPanel):
    """What Cycles keeps of a world, where its add-on is switched on."""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.world, "cycles")


class GI_WORLD_PT_settings(CyclesWorldPanel, bpy.types.Panel):
    bl_label = "Settings"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        cycles = context.world.cycles
        column = columns(self.layout)
        draw_cycles(column, cycles, ("sampling_method",))
        if getattr(cycles, "sampling_method", "") == "MANUAL":
            draw_cycles(column, cycles, ("sample_map_resolution",))
        draw_cycles(column, cycles, ("max_bounces",))


class GI_WORLD_PT_visibility(CyclesWorldPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        visibility = getattr(context.world, "cycles_visibility", None)
        draw_cycles(columns(self.layout), visibility, ("camera", "diffuse", "glossy", "transmission"))


class GI_MATERIAL_PT_settings(MaterialPanel, bpy.types.Panel):
    bl_label = "Settings"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        material = context.material
        column = columns(self.layout)
        column.prop(material, "pass_index")
        column.prop(material, "use_transparent_shadow")
        draw_cycles(column, getattr(material, "cycles", None), ("emission_sampling", "use_bump_map_correction"))


PROJECTION = ("longitude_min", "longitude_max", "latitude_min", "latitude_max")


class GI_CAMERA_PT_panorama(Panel, bpy.types.Panel):
    """Blender's lens panel shows the panoramas of Cycles only while that is the engine."""

    bl_label = "Panorama"
    bl_parent_id = "DATA_PT_lens"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.camera is not None and context.camera.type == "PANO"

    def draw(self, context):
        camera = context.camera
        column = columns(self.layout)
        column.prop(camera, "panorama_type")
        if camera.panorama_type != "EQUIRECTANGULAR":
            column.label(text="Rendered as equirectangular", icon="INFO")
        for name in PROJECTION:
            column.prop(camera, name)


CLASSES = (
    GI_CAMERA_PT_panorama,
    GI_LIGHT_PT_light,
    GI_LIGHT_PT_nodes,
    GI_MATERIAL_PT_surface,
    GI_MATERIAL_PT_displacement,
    GI_MATERIAL_PT_volume,
    GI_MATERIAL_PT_approximated,
    GI_MATERIAL_PT_settings,
    GI_OBJECT_PT_visibility,
    GI_WORLD_PT_preview,
    GI_WORLD_PT_surface,
    GI_WORLD_PT_settings,
    GI_WORLD_PT_visibility,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
