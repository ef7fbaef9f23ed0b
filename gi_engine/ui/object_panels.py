"""Object, light, world and material tabs: what Blender's shared panels leave out.

Options that Cycles owns (multiple importance, sampling of emission, …) are shown where they are: we read the same.
"""

from __future__ import annotations

import bpy

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


class GI_LIGHT_PT_nodes(Panel, bpy.types.Panel):
    bl_label = "Nodes"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light is not None

    def draw(self, context):
        from bl_ui.properties_material import panel_node_draw  # bl_ui is there only once Blender runs

        light = context.light
        if not light.use_nodes:
            self.layout.prop(light, "use_nodes", icon="NODETREE")
        else:
            self.layout.use_property_split = True
            panel_node_draw(self.layout, light, "OUTPUT_LIGHT", "Surface")


class GI_OBJECT_PT_visibility(Panel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object is not None

    def draw(self, context):
        item = context.object
        column = columns(self.layout)
        for name in ("camera", "diffuse", "glossy", "transmission", "shadow"):
            column.prop(item, f"visible_{name}", text=name.title())
        column = columns(self.layout)
        column.prop(item, "is_holdout")


class GI_WORLD_PT_settings(Panel, bpy.types.Panel):
    bl_label = "Settings"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and getattr(context.world, "cycles", None) is not None

    def draw(self, context):
        world = context.world
        column = columns(self.layout)
        draw_cycles(column, world.cycles, ("sampling_method",))
        if getattr(world.cycles, "sampling_method", "") == "MANUAL":
            draw_cycles(column, world.cycles, ("sample_map_resolution",))
        draw_cycles(column, world.cycles, ("max_bounces",))
        column = columns(self.layout)
        draw_cycles(column, getattr(world, "cycles_visibility", None), ("camera", "diffuse", "glossy", "transmission"))


class GI_MATERIAL_PT_settings(Panel, bpy.types.Panel):
    bl_label = "Settings"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.material is not None

    def draw(self, context):
        material = context.material
        column = columns(self.layout)
        column.prop(material, "pass_index")
        column.prop(material, "use_transparent_shadow")
        draw_cycles(column, getattr(material, "cycles", None), ("emission_sampling", "use_bump_map_correction"))


CLASSES = (
    GI_LIGHT_PT_light,
    GI_LIGHT_PT_nodes,
    GI_OBJECT_PT_visibility,
    GI_WORLD_PT_settings,
    GI_MATERIAL_PT_settings,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
