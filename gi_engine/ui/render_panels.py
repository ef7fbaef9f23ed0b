"""Render and view-layer tabs: sampling, integrator, light paths, film, performance, passes."""

from __future__ import annotations

import bpy
from bl_ui.properties_view_layer import ViewLayerAOVPanelHelper

from .. import native
from ..export.settings import SHARED, value_of
from ..strategies import has_strategies
from .panel import Panel, RenderPanel, columns, has_setting, setting

BOUNCES = (
    "max_bounces",
    "diffuse_bounces",
    "glossy_bounces",
    "transmission_bounces",
    "volume_bounces",
    "transparent_bounces",
    "min_bounces",
)
# Of integrators: what is rarely changed, and folded away.
ADVANCED = (
    "aim",
    "alpha",
    "branches",
    "cached_bounces",
    "cached_caustics",
    "cached_sky",
    "caustic_count",
    "continuation",
    "continuation_constant",
    "direction_sampling",
    "global_count",
    "heuristic",
    "light_threshold",
    "max_length",
    "max_spacing",
    "min_length",
    "min_spacing",
    "only_s",
    "only_t",
    "photon_memory",
    "record_samples",
    "texel_memory",
    "weighted",
)
CLAMPING = ("clamp_direct", "clamp_indirect")
CAUSTICS = ("filter_glossy", "caustics_reflective", "caustics_refractive")


def parameters(scene) -> list[dict]:
    """Of the chosen integrator."""
    chosen = scene.gi_engine.integrator
    return next((d["parameters"] for d in native.integrators() if d["id"] == chosen), [])


def keeps(scene) -> bool:
    chosen = scene.gi_engine.integrator
    return any(d["kept_version"] for d in native.integrators() if d["id"] == chosen)


def has_any(scene, names) -> bool:
    return any(p["name"] in names for p in parameters(scene))


class GI_RENDER_PT_integrator(RenderPanel, bpy.types.Panel):
    bl_label = "Integrator"

    def draw(self, context):
        scene = context.scene
        if not native.available():
            self.layout.label(text="The compiled part is missing: see the console", icon="ERROR")
        self.layout.menu("GI_MT_presets", icon="PRESET")
        column = columns(self.layout)
        column.prop(scene.gi_engine, "integrator")
        draw_parameters(column, scene, advanced=False)
        if has_strategies(parameters(scene)):
            self.layout.operator("gi_engine.render_strategies", icon="RENDER_RESULT")


class GI_RENDER_PT_advanced(RenderPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = "GI_RENDER_PT_integrator"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and has_any(context.scene, ADVANCED)

    def draw(self, context):
        draw_parameters(columns(self.layout), context.scene, advanced=True)


def draw_parameters(column, scene, advanced: bool) -> None:
    """The chosen integrator's own, and of those that Cycles has the one that no other panel shows."""
    own = getattr(scene.gi_engine, scene.gi_engine.integrator, None)
    for name in (parameter["name"] for parameter in parameters(scene)):
        if (name in ADVANCED) != advanced:
            continue
        if name == "light_threshold":
            setting(column, scene, name)
        elif name not in SHARED:
            row = column.row()
            row.active = matters(own, name)
            row.prop(own, name)


def matters(own, name: str) -> bool:
    """A parameter that is named "choice_item" matters only while that item of the enum `choice` is chosen."""
    choice, _, item = name.rpartition("_")
    found = own.bl_rna.properties.get(choice)
    return found is None or item.upper() not in found.enum_items or getattr(own, choice) == item.upper()


class GI_RENDER_PT_cache(RenderPanel, bpy.types.Panel):
    bl_label = "Cache"
    bl_parent_id = "GI_RENDER_PT_integrator"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and keeps(context.scene)

    def draw(self, context):
        own = context.scene.gi_engine
        column = columns(self.layout)
        column.prop(own, "keep")
        column.prop(own, "kept_file")
        row = column.row()
        row.active = bool(own.kept_file)
        row.prop(own, "kept_misfit")
        self.layout.operator("gi_engine.render_along", icon="RENDER_ANIMATION")


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
        if not hasattr(scene, "cycles"):  # its add-on is switched off
            return
        if scene.gi_engine.is_own:
            row = column.row(align=True)
            row.operator("gi_engine.copy_from_cycles")
            row.operator("gi_engine.follow_cycles")
        else:
            column.label(text="Shared with Cycles", icon="LINKED")
            column.operator("gi_engine.copy_from_cycles", text="Make Own Settings")


class GI_RENDER_PT_viewport(RenderPanel, bpy.types.Panel):
    bl_label = "Viewport"
    bl_parent_id = "GI_RENDER_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        scene, own = context.scene, context.scene.gi_engine
        column = columns(self.layout)
        row = column.row(align=True)
        setting(row, scene, "preview_samples", text="Samples")
        setting(row, scene, "preview_pause", text="", icon="PAUSE")
        column.prop(own, "viewport_pass")
        column.prop(own, "use_preview_denoising", text="Denoise")
        column = columns(self.layout)
        column.active = own.use_preview_denoising
        for name in ("preview_denoising_input_passes", "preview_denoising_quality", "preview_denoising_start_sample"):
            column.prop(own, name)


class GI_RENDER_PT_denoise(RenderPanel, bpy.types.Panel):
    bl_label = "Denoise"
    bl_parent_id = "GI_RENDER_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.gi_engine, "use_denoising", text="")

    def draw(self, context):
        own = context.scene.gi_engine
        column = columns(self.layout)
        column.active = own.use_denoising
        column.prop(own, "denoising_input_passes")
        row = column.row()
        row.active = own.denoising_input_passes != "RGB"
        row.prop(own, "denoising_prefilter")
        column.prop(own, "denoising_quality")


class GI_RENDER_PT_light_paths(RenderPanel, bpy.types.Panel):
    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and has_any(context.scene, BOUNCES + CLAMPING + CAUSTICS)

    def draw(self, context):
        pass


class LightPathPanel(RenderPanel):
    """A group of the chosen integrator's parameters that Cycles has too."""

    bl_parent_id = "GI_RENDER_PT_light_paths"
    names: tuple[str, ...]

    @classmethod
    def poll(cls, context):
        return super().poll(context) and has_any(context.scene, cls.names)

    def draw(self, context):
        chosen = {p["name"] for p in parameters(context.scene)}
        column = columns(self.layout)
        for name in self.names:
            if name in chosen and has_setting(context.scene, name):
                setting(column, context.scene, name)


class GI_RENDER_PT_bounces(LightPathPanel, bpy.types.Panel):
    bl_label = "Max Bounces"
    names = BOUNCES


class GI_RENDER_PT_clamping(LightPathPanel, bpy.types.Panel):
    bl_label = "Clamping"
    names = CLAMPING


class GI_RENDER_PT_caustics(LightPathPanel, bpy.types.Panel):
    bl_label = "Caustics"
    names = CAUSTICS


class GI_RENDER_PT_simplify(RenderPanel, bpy.types.Panel):
    """Blender's own would come before everything else."""

    bl_label = "Simplify"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_simplify", text="")

    def draw(self, context):
        render = context.scene.render
        for heading, suffix in (("Viewport", ""), ("Render", "_render")):
            column = columns(self.layout)
            column.active = render.use_simplify
            column.label(text=heading)
            column.prop(render, f"simplify_subdivision{suffix}", text="Max Subdivision")
            column.prop(render, f"simplify_child_particles{suffix}", text="Child Particles")


class GI_RENDER_PT_film(RenderPanel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        setting(columns(self.layout), context.scene, "film_exposure")


class GI_RENDER_PT_pixel_filter(RenderPanel, bpy.types.Panel):
    bl_label = "Pixel Filter"
    bl_parent_id = "GI_RENDER_PT_film"

    def draw(self, context):
        column = columns(self.layout)
        setting(column, context.scene, "pixel_filter", text="Type")
        setting(column, context.scene, "filter_width", text="Width")


class GI_RENDER_PT_transparent(RenderPanel, bpy.types.Panel):
    bl_label = "Transparent"
    bl_parent_id = "GI_RENDER_PT_film"

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "film_transparent", text="")

    def draw(self, context):
        scene = context.scene
        column = columns(self.layout)
        column.active = scene.render.film_transparent
        setting(column, scene, "transparent_glass")
        row = column.row()
        row.active = value_of(scene, "transparent_glass")
        setting(row, scene, "transparent_roughness")


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


class GI_RENDER_PT_compositor(RenderPanel, bpy.types.Panel):
    bl_label = "Compositor"
    bl_parent_id = "GI_RENDER_PT_performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        render = context.scene.render
        column = columns(self.layout)
        column.row().prop(render, "compositor_device", text="Device", expand=True)
        if render.compositor_device == "GPU":
            column.prop(render, "compositor_precision", text="Precision")


class GI_VIEWLAYER_PT_passes(Panel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        layer = context.view_layer
        column = columns(self.layout, heading="Data")
        for name in ("use_pass_z", "use_pass_normal", "use_pass_position", "use_pass_uv"):
            column.prop(layer, name)
        column.prop(layer.gi_engine, "use_pass_sample_count")
        column.prop(layer.gi_engine, "use_pass_cache_samples")
        column.prop(layer.gi_engine, "use_pass_photons")
        column = columns(self.layout, heading="Indexes")
        for name in ("use_pass_object_index", "use_pass_material_index"):
            column.prop(layer, name)
        column = columns(self.layout, heading="Light")
        for name in ("use_pass_emit", "use_pass_environment"):
            column.prop(layer, name)
        column.prop(layer.gi_engine, "use_pass_terms")
        column.prop(layer.gi_engine, "use_pass_albedo")


class GI_VIEWLAYER_PT_aovs(Panel, ViewLayerAOVPanelHelper, bpy.types.Panel):
    bl_context = "view_layer"
    bl_parent_id = "GI_VIEWLAYER_PT_passes"


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
        column = columns(self.layout, heading="Include")
        column.prop(layer, "use_sky", text="Environment")
        column.prop(layer, "use_solid", text="Surfaces")


CLASSES = (
    GI_RENDER_PT_integrator,
    GI_RENDER_PT_advanced,
    GI_RENDER_PT_cache,
    GI_RENDER_PT_sampling,
    GI_RENDER_PT_viewport,
    GI_RENDER_PT_denoise,
    GI_RENDER_PT_light_paths,
    GI_RENDER_PT_bounces,
    GI_RENDER_PT_clamping,
    GI_RENDER_PT_caustics,
    GI_RENDER_PT_simplify,
    GI_RENDER_PT_film,
    GI_RENDER_PT_pixel_filter,
    GI_RENDER_PT_transparent,
    GI_RENDER_PT_performance,
    GI_RENDER_PT_compositor,
    GI_VIEWLAYER_PT_passes,
    GI_VIEWLAYER_PT_aovs,
    GI_VIEWLAYER_PT_override,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
