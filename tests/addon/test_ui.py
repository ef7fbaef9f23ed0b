"""Panels: which of Blender's we join, and that ours draw what exists."""

from __future__ import annotations

import warnings
from types import SimpleNamespace

import bpy
import pytest

import gi_engine
from gi_engine import native
from gi_engine.ui import compat, object_panels, render_panels

from .conftest import add, mesh

PANELS = (*render_panels.CLASSES, *object_panels.CLASSES)
JOINED = (
    "RENDER_PT_format", "RENDER_PT_output", "RENDER_PT_color_management", "DATA_PT_camera", "DATA_PT_lens",
    "DATA_PT_camera_dof", "MATERIAL_PT_preview", "DATA_PT_uv_texture", "RENDER_PT_post_processing", "RENDER_PT_stamp",
    "OBJECT_PT_shadow_terminator",
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

    def menu(self, name, **_):
        assert hasattr(bpy.types, name)

    def column(self, **_):
        return Layout(self.drawn)

    row = column

    def label(self, **_):
        pass

    def template_list(self, kind, _id, owner, name, *_, **__):
        assert hasattr(bpy.types, kind)
        self.prop(owner, name)

    def template_preview(self, item):
        self.drawn.append(item.name)

    def template_node_view(self, tree, node, socket):
        assert node in tree.nodes[:] and socket in node.inputs[:]
        self.drawn.append(socket.name)


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
        camera=data if isinstance(data, bpy.types.Camera) else None,
    )


def draw(panel, context) -> list[str]:
    """The properties that a panel draws; none where it does not show."""
    drawn: list[str] = []
    if panel.poll(context):
        self = SimpleNamespace(layout=Layout(drawn), names=getattr(panel, "names", ()))
        if hasattr(panel, "draw_header"):
            panel.draw_header(self, context)
        panel.draw(self, context)
    return drawn


def with_nodes(owner):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # 5.x has materials' and worlds' nodes always in use
        owner.use_nodes = True
    return owner


@pytest.mark.parametrize("own", [False, True])
def test_panels_draw_what_exists(scene, own):
    scene.gi_engine.is_own = own
    scene.gi_engine.integrator = "irradiance_cache"  # which has a panel more
    scene.world = bpy.data.worlds.new("World")
    item = add(scene, "Square", mesh())
    item.data.materials.append(bpy.data.materials.new("Paint"))
    for owner in (scene.world, item.active_material):
        with_nodes(owner)
    items = [item, scene.camera]
    scene.camera.data.type = "PANO"
    for kind in ("POINT", "SPOT", "AREA", "SUN"):
        items.append(add(scene, kind, with_nodes(bpy.data.lights.new(kind, kind))))
    drawn = {panel: [name for i in items for name in draw(panel, context_of(i))] for panel in PANELS}
    silent = [p.__name__ for p, names in drawn.items() if not names]
    # A title over its parts, and one that shows only what a render has found.
    assert silent == ["GI_RENDER_PT_light_paths", "GI_MATERIAL_PT_approximated"]
    assert "samples" in drawn[render_panels.GI_RENDER_PT_sampling]
    assert {"size", "spread", "spot_size", "angle"} <= set(drawn[object_panels.GI_LIGHT_PT_light])


def test_every_parameter_is_drawn_by_some_panel(scene):
    scene.gi_engine.is_own = True
    for integrator in ("whitted", "distributed", "path"):
        scene.gi_engine.integrator = integrator
        drawn = {name for panel in render_panels.CLASSES for name in draw(panel, context_of())}
        missing = {p["name"] for p in render_panels.parameters(scene)} - drawn
        assert not missing, integrator


def test_what_is_rarely_changed_is_folded_away(scene):
    scene.gi_engine.integrator = "irradiance_cache"
    assert {"error", "refinement"} <= set(draw(render_panels.GI_RENDER_PT_integrator, context_of()))
    assert {"min_spacing", "max_length"} <= set(draw(render_panels.GI_RENDER_PT_advanced, context_of()))
    assert "DEFAULT_CLOSED" in render_panels.GI_RENDER_PT_advanced.bl_options
    scene.gi_engine.integrator = "whitted"
    assert render_panels.GI_RENDER_PT_advanced.poll(context_of()) == any(
        p["name"] in render_panels.ADVANCED for p in render_panels.parameters(scene)
    )


def test_every_parameter_says_its_unit_and_what_it_does(scene):
    for descriptor in native.integrators():
        group = getattr(scene.gi_engine, descriptor["id"]).bl_rna.properties
        for parameter in descriptor["parameters"]:
            assert len(parameter["help"]) > 15 or parameter["name"] in render_panels.BOUNCES, parameter
            prop = group.get(parameter["name"])
            if prop is None:  # shared with Cycles
                continue
            if parameter["unit"] == "LENGTH":
                assert prop.unit == "LENGTH", parameter["name"]
            elif parameter["unit"] in ("px", "%"):
                assert prop.subtype == {"px": "PIXEL", "%": "PERCENTAGE"}[parameter["unit"]], parameter["name"]
            elif parameter["unit"]:
                assert parameter["unit"] in prop.name


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


def test_a_constant_matters_while_it_is_chosen(scene):
    own = scene.gi_engine.path
    own.continuation = "THROUGHPUT"
    assert not render_panels.matters(own, "continuation_constant")
    own.continuation = "CONSTANT"
    assert render_panels.matters(own, "continuation_constant")
    assert render_panels.matters(own, "light_sampling")


def test_our_sub_panels_have_parents_that_show(scene):
    """Blender drops a panel whose parent it does not know, and hides one whose parent is hidden."""
    for panel in PANELS:
        parent = getattr(panel, "bl_parent_id", None)
        if parent:
            found = getattr(bpy.types, parent)
            assert found in PANELS or compat.ENGINE in found.COMPAT_ENGINES, panel.__name__


def test_our_panels_answer_for_any_object(scene):
    """Blender asks every panel of a tab; one that raises leaves errors on the console at every redraw."""
    items = [add(scene, "Square", mesh()), scene.camera, add(scene, "Empty", None)]
    items.append(add(scene, "Lamp", bpy.data.lights.new("Lamp", "AREA")))
    for item in items:
        for panel in PANELS:
            draw(panel, context_of(item))
