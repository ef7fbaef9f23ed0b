"""Inside Blender with a window: the engine is chosen with the mouse in the render panel; then panels, a tooltip, the preferences and the viewport
are gone through, for pictures of them (SCREENSHOTS in the environment names their folder) and so that none of them fails to draw."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from hands import click, corner, engine_module, in_window, picture, run, until, viewport, xdotool

ROW = 23  # pixels of a menu's row


def areas(kind):
    return [area for area in bpy.context.window_manager.windows[0].screen.areas if area.type == kind]


def region_of(area):
    return next(region for region in area.regions if region.type == "WINDOW")


def choose_engine():
    """Render Engine is the first row of the render tab; EEVEE, Workbench and Cycles stand before ours."""
    (area,) = areas("PROPERTIES")
    area.spaces.active.context = "RENDER"
    yield 1
    region = region_of(area)
    x, y = corner(region)
    x, y = x + 0.7 * region.width, y + 52
    click(x, y)
    yield 1
    picture("engine_menu")
    click(x, y + 25 + 4 * ROW - ROW)
    yield from until(lambda: bpy.context.scene.render.engine == "GI_ENGINE", 10, "the engine chosen with the mouse")


def wide_properties():
    """A column of properties wide enough to be read, where the viewport's right part was."""
    with in_window("VIEW_3D"):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.58)
    area = max(areas("VIEW_3D"), key=lambda a: a.x)
    area.type = "PROPERTIES"
    area.spaces.active.context = "RENDER"
    return area


def integrators(area):
    own = bpy.context.scene.gi_engine
    for item in own.bl_rna.properties["integrator"].enum_items:
        own.integrator = item.identifier
        area.tag_redraw()
        yield 0.7
        picture(f"panel_{item.identifier}", area)


def tooltip(area):
    """Of the first number of irradiance caching."""
    bpy.context.scene.gi_engine.integrator = "irradiance_cache"
    area.tag_redraw()
    yield 0.5
    x, y = corner(region_of(area))
    for step in (0, 3, 6):
        xdotool("mousemove", round(x + 0.7 * area.width) + step, round(y + 167))
        yield 0.3
    yield 1.5
    picture("tooltip")


def other_tabs(area):
    space = area.spaces.active
    for name in ("VIEW_LAYER", "OUTPUT", "SCENE", "WORLD", "MATERIAL", "DATA", "OBJECT"):
        for item in bpy.context.view_layer.objects:
            if item.type == {"DATA": "LIGHT"}.get(name, "MESH"):
                bpy.context.view_layer.objects.active = item
        yield 0.3
        space.context = name
        yield 0.7
        picture(f"tab_{name.lower()}", area)
    space.context = "RENDER"


def preferences(area):
    """The add-on's, in the place of an area."""
    area.type = "PREFERENCES"
    bpy.context.preferences.active_section = "ADDONS"
    bpy.context.window_manager.addon_search = "GI Engine"
    module = next(name for name in bpy.context.preferences.addons.keys() if name.endswith("gi_engine"))
    bpy.ops.preferences.addon_expand(module=module)
    yield 1.5
    picture("preferences", area)
    area.type = "PROPERTIES"


def pictures_shown():
    return [view.refiner.picture for view in list(engine_module("viewport")._open) if view.refiner.picture]


def rendered(samples):
    scene = bpy.context.scene
    scene.gi_engine.integrator = "path"
    scene.gi_engine.preview_samples = samples
    with in_window("VIEW_3D"):
        bpy.context.region_data.view_perspective = "CAMERA"
    viewport().shading.type = "RENDERED"
    yield from until(
        lambda: any(p.samples == samples for p in pictures_shown()), 120, "a picture of all viewport samples"
    )
    yield 1
    picture("viewport")


def story():
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    yield 2
    yield from choose_engine()
    picture("chosen")
    area = wide_properties()
    yield 1
    yield from integrators(area)
    yield from tooltip(area)
    yield from other_tabs(area)
    yield from preferences(area)
    yield from rendered(16)


run(story())
