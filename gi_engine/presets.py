"""Named ways to render: an integrator, its parameters and limits that suit each other. No bpy."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Preset:
    label: str
    help: str
    integrator: str
    settings: dict = field(default_factory=dict)  # of the scene: samples, bounces, denoising, …
    parameters: dict = field(default_factory=dict)  # the integrator's own


def bounces(number: int) -> dict:
    """As many of every kind."""
    kinds = ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces", "transparent_bounces")
    return dict.fromkeys(kinds, number)


PRESETS = {
    "PREVIEW": Preset(
        "Preview",
        "Something to look at in seconds: few samples and bounces, denoised",
        "path",
        {"samples": 16, **bounces(4), "use_denoising": True, "denoising_quality": "FAST", "noise_target": 0.0},
    ),
    "INTERIOR": Preset(
        "Interior",
        "Rooms lit through windows or by lamps out of sight: irradiance caching, smooth diffuse light soon",
        "irradiance_cache",
        {"samples": 64, **bounces(8), "use_denoising": False, "noise_target": 0.0},
    ),
    "CAUSTICS": Preset(
        "Caustics",
        "Light thrown by glass and mirrors, seen in them as well: vertex connection and merging",
        "vcm",
        {"samples": 256, **bounces(16), "clamp_indirect": 0.0, "use_denoising": False, "noise_target": 0.0},
    ),
    "REFERENCE": Preset(
        "Reference",
        "What others are measured by: path tracing without clamping or smoothing, until one percent of noise is left",
        "path",
        {
            "samples": 16384,
            **bounces(64),
            "caustics_reflective": True,
            "caustics_refractive": True,
            "clamp_direct": 0.0,
            "clamp_indirect": 0.0,
            "filter_glossy": 0.0,
            "noise_target": 0.01,
            "use_denoising": False,
        },
    ),
    "LECTURE": Preset(
        "Lecture",
        "As it was first done, to be set beside the others: Whitted's ray tracing, without light between diffuse surfaces",
        "whitted",
        {"samples": 4, "use_denoising": False, "noise_target": 0.0},
    ),
}


def apply(preset: Preset, scene) -> None:
    """To a scene's settings, which become its own; what the preset does not name stays."""
    own = scene.gi_engine
    own.integrator = preset.integrator
    # Setting a shared one takes over the rest of Cycles' first.
    for name, value in preset.settings.items():
        setattr(own, name, value)
    group = getattr(own, preset.integrator)
    for name, value in preset.parameters.items():
        setattr(group, name, value)
