"""Panels: which of Blender's we join, and that ours draw what exists."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest

import gi_engine
from gi_engine.ui import compat, object_panels, render_panels

from .conftest import add, mesh

PANELS = (*render_panels.CLASSES, *object_panels.CLASSES)
JOINED = (
    "RENDER_PT_format", "RENDER_PT_output", "RENDER_PT_color_management", "DATA_PT_camera", "DATA_PT_lens",
    "DATA_PT_camera_dof", "MATERIAL_PT_preview", "EEVEE_MATERIAL_PT_surface", "EEVEE_WORLD_PT_surface",
    "DATA_PT_uv_texture",
)  # fmt: skip


class Layout:
    """Stands in for Blender's UI layout, which exists only in a window: checks that each property is there."""

    def __init__(self, drawn: list[str]):
        self.drawn = drawn

    def prop(self, owner, name, **_):
        assert name in owner.bl_rna.properties, f"{owner!r} has no property {name}"
        self.drawn.append(name)

    def operator(self, name, **_):
        category, _, function = name.partition(".")
        assert getattr(getattr(bpy.ops, category), function).idname()

    def column(self, **_):
        return Layout(self.drawn)

    row = column

    def label(self, **_):
        pass


def context_of(item=None):
    scene = bpy.context.scene
    data = item.data if item else None
    return SimpleNamespace(
        engine="GI_ENGINE",
        scene=scene,
        view_layer=scene.view_layers[0],
        world=scene.world,
        object=item,
        material=item.active_material if item else None,
        light=data if isinstance(data, bpy.types.Light) else None,
    )


def draw(panel, context) -> list[str]:
    """The properties that a panel draws; none where it does not show."""
    drawn: list[str] = []
    if panel.poll(context) and panel.__name__ != "GI_LIGHT_PT_nodes":  # which is Blender's own tree view
        panel.draw(SimpleNamespace(layout=Layout(drawn)), context)
    return drawn


@pytest.mark.parametrize("own", [False, True])
def test_panels_draw_what_exists(scene, own):
    scene.gi_engine.is_own = own
    scene.world = bpy.data.worlds.new("World")
    item = add(scene, "Square", mesh())
    item.data.materials.append(bpy.data.materials.new("Paint"))
    items = [item]
    for kind in ("POINT", "SPOT", "AREA", "SUN"):
        items.append(add(scene, kind, bpy.data.lights.new(kind, kind)))
    drawn = {panel: [name for i in items for name in draw(panel, context_of(i))] for panel in PANELS}
    silent = [p.__name__ for p, names in drawn.items() if not names]
    assert silent == ["GI_LIGHT_PT_nodes"]
    assert "samples" in drawn[render_panels.GI_RENDER_PT_sampling]
    assert {"size", "spread", "spot_size", "angle"} <= set(drawn[object_panels.GI_LIGHT_PT_light])


def test_every_parameter_is_drawn_by_some_panel(scene):
    scene.gi_engine.is_own = True
    for integrator in ("whitted", "distributed", "path"):
        scene.gi_engine.integrator = integrator
        drawn = {name for panel in render_panels.CLASSES for name in draw(panel, context_of())}
        missing = {p["name"] for p in render_panels.parameters(scene)} - drawn
        assert not missing, integrator


def test_nothing_shows_for_another_engine(scene):
    context = context_of(add(scene, "Square", mesh()))
    context.engine = "CYCLES"
    assert not any(panel.poll(context) for panel in PANELS)


def test_blenders_panels_are_joined_and_left(scene):
    for name in JOINED:
        panel = getattr(bpy.types, name, None)
        assert panel and compat.ENGINE in panel.COMPAT_ENGINES, name
    for name in compat.NOT_OURS:
        panel = getattr(bpy.types, name, None)
        assert compat.ENGINE not in getattr(panel, "COMPAT_ENGINES", ()), name
    gi_engine.unregister()
    try:
        left = [n for n in dir(bpy.types) if compat.ENGINE in getattr(getattr(bpy.types, n), "COMPAT_ENGINES", ())]
        assert not left and not hasattr(bpy.types.Scene, "gi_engine")
    finally:
        gi_engine.register()
    assert compat.ENGINE in bpy.types.RENDER_PT_format.COMPAT_ENGINES
