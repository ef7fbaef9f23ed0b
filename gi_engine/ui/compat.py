"""Which of Blender's own panels show for this engine: those that every engine shares, and a few of EEVEE's.

They are joined by adding our id to COMPAT_ENGINES and left again when the add-on is switched off.
"""

from __future__ import annotations

import bpy

ENGINE = "GI_ENGINE"
# Panels for every engine that show settings we do not read, or that we draw ourselves.
NOT_OURS = {
    "DATA_PT_EEVEE_light",
    "DATA_PT_falloff_curve",
    "DATA_PT_light",
    "DATA_PT_spot",
    "NODE_DATA_PT_light",
    "RENDER_PT_freestyle",
    "RENDER_PT_simplify",
    "RENDER_PT_simplify_greasepencil",
    "RENDER_PT_simplify_render",
    "RENDER_PT_simplify_viewport",
    "VIEWLAYER_PT_layer_passes",
}
# Panels that not every engine has but that show data we read.
FROM_EEVEE = {
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "MATERIAL_PT_preview",
    "OBJECT_PT_shadow_terminator",
    "WORLD_PT_context_world",
}


def panels():
    """Blender's panels that this engine joins."""
    for name in dir(bpy.types):
        panel = getattr(bpy.types, name)
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if not isinstance(engines, set) or name in NOT_OURS:
            continue
        if "BLENDER_RENDER" in engines or name in FROM_EEVEE:
            yield panel


def register() -> None:
    for panel in panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    for panel in panels():
        panel.COMPAT_ENGINES.discard(ENGINE)
