"""Settings that live in .blend files. The integrators' own are generated from their descriptors.

A scene follows its Cycles settings until one of ours is set (or copied): from then on all of them are its own.
"""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from . import native
from .export.settings import SHARED
from .scene_data import LIGHTMAP_CONTENTS as CONTENTS

# Blender 5 wants to be told of paths that may begin with "//".
RELATIVE = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (5, 0) else set()
MISFITS = (
    ("WITHOUT", "Render Without", "Leave the file as it is, under a warning"),
    ("REPLACE", "Replace", "Start a new one in its place, unless it is no file of GI Engine's"),
    ("STOP", "Stop", "Do not render"),
)
# Of the denoiser, as Cycles names them.
INPUTS = (
    ("RGB", "None", "The picture alone"),
    ("RGB_ALBEDO", "Albedo", "Guided by the colours of surfaces: keeps textures"),
    (
        "RGB_ALBEDO_NORMAL",
        "Albedo and Normal",
        "Guided by the colours and the directions of surfaces: keeps textures and edges",
    ),
)
PREFILTERS = (
    ("NONE", "None", "The guides are as noisy as they are; tolerant, keeps less detail"),
    ("FAST", "Fast", "The guides are taken for clean: keeps most detail, and their noise"),
    ("ACCURATE", "Accurate", "The guides are denoised first: keeps most detail, takes longest"),
)
QUALITY = (
    ("HIGH", "High", "Best, and slowest"),
    ("BALANCED", "Balanced", "Between the two"),
    ("FAST", "Fast", "For previews"),
)
# Of a parameter, and how Blender is told; what it has no word for stands beside the name.
UNITS = {"LENGTH": {"unit": "LENGTH"}, "px": {"subtype": "PIXEL"}, "%": {"subtype": "PERCENTAGE"}}
FILTERS = (
    ("BOX", "Box", "Equal weight over the filter's width"),
    ("GAUSSIAN", "Gaussian", "Bell curve"),
    ("BLACKMAN_HARRIS", "Blackman-Harris", "Bell curve that ends smoothly"),
)


def take_over(name: str):
    """Called when a shared setting is set: the others are copied from Cycles, once, and the scene has its own."""

    def update(settings, context):
        if settings.is_own:
            return
        settings.is_own = True
        cycles = getattr(settings.id_data, "cycles", None)
        for other, theirs in SHARED.items():
            if other != name and hasattr(settings, other) and hasattr(cycles, theirs):
                setattr(settings, other, getattr(cycles, theirs))

    return update


def fixed_properties() -> dict:
    """Those that do not depend on the integrators."""
    return {
        "is_own": BoolProperty(name="Own Settings", description="Off: samples, bounces, film and so on are Cycles'"),
        "samples": IntProperty(name="Samples", description="Samples of each pixel", default=128, min=1, max=1 << 24),
        "time_limit": FloatProperty(
            name="Time Limit", description="Seconds of sampling; 0 for no limit", min=0, unit="TIME_ABSOLUTE"
        ),
        "noise_target": FloatProperty(
            name="Noise Target",
            description="Stops when 95 % of the pixels have a relative standard error below this; 0 for no target",
            min=0,
            soft_max=0.5,
            precision=4,
        ),
        "seed": IntProperty(name="Seed", description="Another seed gives another pattern of noise", min=0),
        "use_animated_seed": BoolProperty(name="Animate Seed", description="Another seed for each frame"),
        "keep": BoolProperty(
            name="Keep for Further Frames",
            description="Of an animation: what was worked out for one frame serves the next, so that still things do not flicker. "
            "Where objects have changed, what lies near them is left out; where lights have, everything is",
            default=True,
        ),
        "kept_file": StringProperty(
            name="Cache File",
            description="Keeps what was worked out from one render to the next; empty for no file. A name without a folder is one in the cache folder of the add-on's preferences",
            subtype="FILE_PATH",
            options=RELATIVE,
        ),
        "kept_misfit": EnumProperty(
            name="Unusable File", description="Where the file is damaged or does not fit the scene", items=MISFITS
        ),
        "film_exposure": FloatProperty(
            name="Exposure", description="Image brightness scale", default=1, min=0, soft_max=10
        ),
        "transparent_glass": BoolProperty(
            name="Transparent Glass", description="Glass shows what is behind the scene as transparent"
        ),
        "transparent_roughness": FloatProperty(
            name="Roughness Threshold",
            description="Rougher transmission than this stays opaque",
            default=0.1,
            min=0,
            max=1,
        ),
        "pixel_filter": EnumProperty(
            name="Pixel Filter",
            description="How samples are weighed by their distance from the pixel's centre",
            items=FILTERS,
            default="BLACKMAN_HARRIS",
        ),
        "filter_width": FloatProperty(
            name="Filter Width", description="Width of the pixel filter", default=1.5, min=0.01, max=10, subtype="PIXEL"
        ),
    }


def denoising_properties() -> dict:
    """Named as Cycles names its own. Not shared with it: a comparison would compare denoisers."""
    return {
        "use_denoising": BoolProperty(
            name="Denoise",
            description="Takes the noise out of the finished picture; the pass Noisy Image keeps it as it was",
        ),
        "denoising_input_passes": EnumProperty(
            name="Passes", description="What guides the denoiser", items=INPUTS, default="RGB_ALBEDO_NORMAL"
        ),
        "denoising_prefilter": EnumProperty(
            name="Prefilter", description="What is done about noise in the guides", items=PREFILTERS, default="ACCURATE"
        ),
        "denoising_quality": EnumProperty(name="Quality", description="Slower is better", items=QUALITY),
    }


VIEWED = (
    ("Combined", "Combined", "The picture"),
    ("Depth", "Depth", "Distance from the camera, in metres"),
    ("Position", "Position", "Where the surface lies, in metres"),
    ("Normal", "Normal", "Where the surface faces"),
    ("Denoising Albedo", "Albedo", "Share of light that the surface reflects or transmits"),
    ("Cache Samples", "Cache Samples", "Irradiance caching: where the records lie"),
    ("Photons", "Photons", "Photon mapping: how many lie in the pixel"),
    ("Photon Density", "Photon Density", "Photon mapping: photons on a square metre"),
)


def viewport_properties() -> dict:
    return {
        "preview_samples": IntProperty(
            name="Viewport Samples",
            description="Samples of each pixel in the viewport; 0 for no end",
            default=32,
            min=0,
        ),
        "preview_pause": BoolProperty(name="Pause Preview", description="Leaves the viewport as it is"),
        "viewport_pass": EnumProperty(name="Pass", description="What the viewport shows", items=VIEWED),
        "use_preview_denoising": BoolProperty(
            name="Denoise Viewport", description="Takes the noise out of the viewport's picture, again and again"
        ),
        "preview_denoising_input_passes": EnumProperty(
            name="Passes", description="What guides the denoiser", items=INPUTS, default="RGB_ALBEDO"
        ),
        "preview_denoising_quality": EnumProperty(
            name="Quality", description="Slower is better", items=QUALITY, default="FAST"
        ),
        "preview_denoising_start_sample": IntProperty(
            name="Start Sample", description="The first sample whose picture is denoised", default=1, min=1
        ),
    }


def property_of(parameter: dict):
    """A bpy property for one parameter of a descriptor."""
    options = {"name": parameter["label"], "description": parameter.get("help", ""), "default": parameter["default"]}
    kind = parameter["type"]
    if kind == "BOOL":
        return BoolProperty(**options)
    if kind == "ENUM":
        return EnumProperty(items=list(parameter["items"]), **options)
    number, make = {"INT": (int, IntProperty), "FLOAT": (float, FloatProperty)}[kind]
    options |= UNITS.get(parameter["unit"], {})
    if parameter["unit"] and parameter["unit"] not in UNITS:
        options["name"] += f" ({parameter['unit']})"
    return make(min=number(parameter["min"]), max=number(parameter["max"]), **options)


def shared_parameters(descriptors: list[dict]) -> dict[str, dict]:
    """Parameters that Cycles has too: set once for all integrators."""
    return {p["name"]: p for d in descriptors for p in d["parameters"] if p["name"] in SHARED}


def draw_at_once(properties: dict) -> None:
    """Of a value that a script sets Blender tells a viewport only where there is a function to be called."""
    for made in properties.values():
        made.keywords.setdefault("update", lambda group, context: None)


def integrator_group(descriptor: dict) -> type:
    """The PropertyGroup of one integrator's own parameters."""
    own = {p["name"]: property_of(p) for p in descriptor["parameters"] if p["name"] not in SHARED}
    draw_at_once(own)
    return type(f"GI_PG_{descriptor['id']}", (bpy.types.PropertyGroup,), {"__annotations__": own})


def settings_group(descriptors: list[dict], groups: dict[str, type], compared: type) -> type:
    items = [(d["id"], d["label"], d.get("blurb", "")) for d in descriptors] or [("path", "Path tracing", "")]
    default = next((item[0] for item in items if item[0] == "path"), items[0][0])
    annotations = fixed_properties() | denoising_properties() | viewport_properties()
    annotations["integrator"] = EnumProperty(
        name="Integrator", items=items, default=default, description="How light is followed"
    )
    for name, parameter in shared_parameters(descriptors).items():
        annotations[name] = property_of(parameter)
    for name in annotations.keys() & SHARED.keys():
        annotations[name].keywords["update"] = take_over(name)
    draw_at_once(annotations)
    annotations["lightmap"] = PointerProperty(type=GI_PG_lightmap)
    annotations["compare"] = PointerProperty(type=compared)
    for identifier, group in groups.items():
        annotations[identifier] = PointerProperty(type=group)
    return type("GI_PG_scene", (bpy.types.PropertyGroup,), {"__annotations__": annotations})


def compare_group(descriptors: list[dict]) -> type:
    """Of the button that compares."""
    engines = [*((d["id"], d["label"], d.get("blurb", "")) for d in descriptors), ("cycles", "Cycles", "Blender's own")]
    chosen = {"path", "cycles"} & {item[0] for item in engines}
    from_file = ("FILE", "Image File", "An EXR of the same size")
    annotations = {
        "engines": EnumProperty(
            name="Engines", description="What renders the scene", items=engines, default=chosen, options={"ENUM_FLAG"}
        ),
        "seconds": FloatProperty(
            name="Time",
            description="Seconds of sampling of each engine's last picture; it renders shorter ones before, and one more by another seed",
            default=10,
            min=0.1,
            soft_max=600,
            unit="TIME_ABSOLUTE",
        ),
        "reference": EnumProperty(
            name="Reference",
            description="What is taken for the truth: an engine, for ten times as long, or a picture",
            items=[*reversed(engines), from_file],
            default="cycles",
        ),
        "reference_file": StringProperty(
            name="File", description="The reference's EXR", subtype="FILE_PATH", options=RELATIVE
        ),
        "folder": StringProperty(
            name="Folder",
            description="For the report and all pictures; empty keeps them until Blender is closed",
            subtype="DIR_PATH",
            options=RELATIVE,
        ),
        "open_report": BoolProperty(name="Open Report", description="In the browser, when it is done", default=True),
    }
    return type("GI_PG_compare", (bpy.types.PropertyGroup,), {"__annotations__": annotations})


class GI_PG_lightmap(bpy.types.PropertyGroup):
    """Of the button that bakes."""

    content: EnumProperty(name="Content", description="What the lightmap holds", items=CONTENTS)
    uv_map: StringProperty(
        name="UV Map", description="Where on the image each face lies; empty for a fresh map without overlaps"
    )
    width: IntProperty(name="Width", description="Texels", default=512, min=4, max=16384, subtype="PIXEL")
    height: IntProperty(name="Height", description="Texels", default=512, min=4, max=16384, subtype="PIXEL")
    margin: IntProperty(
        name="Margin", description="Texels filled beyond the edges of the map's islands", default=8, min=0, max=64
    )
    denoise: BoolProperty(name="Denoise", description="By Blender's own Open Image Denoise", default=True)
    folder: StringProperty(
        name="Folder",
        description="For an EXR of each object; empty keeps images in the .blend file",
        subtype="DIR_PATH",
        options=RELATIVE,
    )


class GI_PG_view_layer(bpy.types.PropertyGroup):
    use_pass_albedo: BoolProperty(name="Albedo", description="Share of light that the surface reflects or transmits")
    use_pass_sample_count: BoolProperty(name="Sample Count", description="Samples that each pixel got")
    use_pass_cache_samples: BoolProperty(
        name="Cache Samples", description="Irradiance caching: where the records lie that light is interpolated between"
    )
    use_pass_terms: BoolProperty(
        name="Terms",
        description="Photon mapping: Direct, Specular, Caustic and Global, which the picture is the sum of",
    )
    use_pass_photons: BoolProperty(
        name="Photons",
        description="Photon mapping: the photons in each pixel, how many lie on a square metre, and the radius in metres "
        "within which they are averaged",
    )


_registered: list[type] = []


def register() -> None:
    descriptors = native.integrators()
    groups = {d["id"]: integrator_group(d) for d in descriptors}
    compared = compare_group(descriptors)
    scene_group = settings_group(descriptors, groups, compared)
    for cls in (*groups.values(), compared, GI_PG_lightmap, scene_group, GI_PG_view_layer):
        bpy.utils.register_class(cls)
        _registered.append(cls)
    bpy.types.Scene.gi_engine = PointerProperty(type=scene_group)
    bpy.types.ViewLayer.gi_engine = PointerProperty(type=GI_PG_view_layer)


def unregister() -> None:
    del bpy.types.ViewLayer.gi_engine
    del bpy.types.Scene.gi_engine
    while _registered:
        bpy.utils.unregister_class(_registered.pop())
