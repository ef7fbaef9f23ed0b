"""Render and view-layer tabs: sampling, integrator, light paths, film, performance, passes."""

from __future__ import annotations

import bpy

from .. import native
from ..export.settings import SHARED
from .panel import Panel, RenderPanel, columns, has_setting, setting

BOUNCES = (
    "max_bounces",
    "diffuse_bounces",
    "glossy_bounces",
    "transmission_bounces",
    "transparent_bounces",
    "min_bounces",
)
CLAMPING = ("clamp_direct", "clamp_indirect")
CAUSTICS = ("filter_glossy", "caustics_reflective", "caustics_refractive")


def parameters(scene) -> list[dict]:
    """Of the chosen integrator."""
    chosen = scene.gi_engine.integrator
    return next((d["parameters"] for d in native.integrators() if d["id"] == chosen), [])


def has_any(scene, names) -> bool:
    return any(p["name"] in names for p in parameters(scene))


class GI_RENDER_PT_integrator(RenderPanel, bpy.types.Panel):
    bl_label = "Integrator"

    def draw(self, context):
        scene = context.scene
        if not native.available():
            self.layout.label(text="The compiled part is missing: see the console", icon="ERROR")
        column = columns(self.layout)
        column.prop(scene.gi_engine, "integrator")
        own = getattr(scene.gi_engine, scene.gi_engine.integrator, None)
        for parameter in parameters(scene):
            if parameter["name"] not in SHARED:
                column.prop(own, parameter["name"])
            elif parameter["name"] == "light_threshold":
                setting(column, scene, "light_threshold")


class GI_RENDER_PT_sampling(RenderPanel, bpy.types.Panel):
    bl_label = "Sampling"

    def draw(self, context):
        scene = context.scene
        column = columns(self.layout)
        setting(column, scene, "samples")
        setting(column, scene, "time_limit")
        column.prop(scene.gi_engine, "noise_target")
        row = column.row(align=True)
        setting(row, scene, "seed")
        setting(row, scene, "use_animated_seed", text="", icon="TIME")
        if scene.gi_engine.is_own:
            column.operator("gi_engine.copy_from_cycles")
            column.operator("gi_engine.follow_cycles")
        else:
            column.label(text="Shared with Cycles until changed here", icon="LINKED")
            column.operator("gi_engine.copy_from_cycles", text="Make Own Settings")


class GI_RENDER_PT_light_paths(RenderPanel, bpy.types.Panel):
    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and has_any(context.scene, BOUNCES + CLAMPING + CAUSTICS)

    def draw(self, context):
        names = {p["name"] for p in parameters(context.scene)}
        for group in (BOUNCES, CLAMPING, CAUSTICS):
            column = columns(self.layout)
            for name in group:
                if name in names and has_setting(context.scene, name):
                    setting(column, context.scene, name)


class GI_RENDER_PT_film(RenderPanel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        scene = context.scene
        column = columns(self.layout)
        setting(column, scene, "film_exposure")
        setting(column, scene, "pixel_filter")
        setting(column, scene, "filter_width")
        column = columns(self.layout)
        column.prop(scene.render, "film_transparent", text="Transparent")
        column = column.column()
        column.active = scene.render.film_transparent
        setting(column, scene, "transparent_glass")
        setting(column, scene, "transparent_roughness")


class GI_RENDER_PT_performance(RenderPanel, bpy.types.Panel):
    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        render = context.scene.render
        column = columns(self.layout)
        column.prop(render, "threads_mode")
        row = column.row()
        row.active = render.threads_mode == "FIXED"
        row.prop(render, "threads")


class GI_VIEWLAYER_PT_passes(Panel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        layer = context.view_layer
        column = columns(self.layout)
        for name in ("use_pass_z", "use_pass_normal", "use_pass_position", "use_pass_uv"):
            column.prop(layer, name)
        column = columns(self.layout)
        for name in ("use_pass_object_index", "use_pass_material_index"):
            column.prop(layer, name)
        column = columns(self.layout)
        for name in ("use_pass_emit", "use_pass_environment"):
            column.prop(layer, name)
        for name in ("use_pass_albedo", "use_pass_sample_count"):
            column.prop(layer.gi_engine, name)


class GI_VIEWLAYER_PT_override(Panel, bpy.types.Panel):
    bl_label = "Override and Filter"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layer = context.view_layer
        column = columns(self.layout)
        column.prop(layer, "material_override")
        if hasattr(layer, "world_override"):  # from 5.0 on
            column.prop(layer, "world_override")
        column.prop(layer, "samples")
        column = columns(self.layout)
        column.prop(layer, "use_sky", text="Environment")
        column.prop(layer, "use_solid", text="Surfaces")


CLASSES = (
    GI_RENDER_PT_integrator,
    GI_RENDER_PT_sampling,
    GI_RENDER_PT_light_paths,
    GI_RENDER_PT_film,
    GI_RENDER_PT_performance,
    GI_VIEWLAYER_PT_passes,
    GI_VIEWLAYER_PT_override,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
