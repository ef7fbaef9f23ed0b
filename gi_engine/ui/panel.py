"""What all our panels have in common. No panel lives here."""

from __future__ import annotations

from ..export.settings import source_of
from .compat import ENGINE


class Panel:
    """Base of our panels: they show while GI Engine is the scene's engine."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"

    @classmethod
    def poll(cls, context):
        return context.engine == ENGINE


class RenderPanel(Panel):
    bl_context = "render"


def columns(layout, heading: str = ""):
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout.column(heading=heading)


def setting(layout, scene, name: str, **options) -> None:
    """Draws one of our settings where it lives: ours, or Cycles' while the scene follows them."""
    owner, prop = source_of(scene, name)
    if "text" not in options:
        options["text"] = scene.gi_engine.bl_rna.properties[name].name
    layout.prop(owner, prop, **options)


def has_setting(scene, name: str) -> bool:
    return name in scene.gi_engine.bl_rna.properties
