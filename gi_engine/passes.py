"""The render passes: how Blender asks for each and what it is called there, by version."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

NAMES_CHANGED = bpy.app.version >= (5, 0, 0)


@dataclass(frozen=True)
class Pass:
    name: str  # the contract's: Blender's from 5.0 on
    old_name: str  # Blender's before that
    channels: str
    kind: str  # COLOR, VALUE or VECTOR
    wanted: tuple[str, ...] = ()  # the view layer's properties that ask for it; none: always there

    @property
    def blender_name(self) -> str:
        return self.name if NAMES_CHANGED else self.old_name


# Cycles' switches, which mean the same here.
DENOISING = "cycles.denoising_store_passes"
SAMPLE_COUNT = "cycles.pass_debug_sample_count"

# The picture before it is denoised. The native side calls it Combined.
NOISY = "Noisy Image"
OF_SCENE = "id_data."  # what follows is the scene's, not the view layer's
DENOISED = OF_SCENE + "gi_engine.use_denoising"

TERMS = ("Direct", "Specular", "Caustic", "Global")  # which photon mapping's picture is the sum of
PHOTONS = ("Photons", "Photon Density", "Photon Radius")

PASSES = (
    Pass("Combined", "Combined", "RGBA", "COLOR"),
    Pass(NOISY, NOISY, "RGBA", "COLOR", (DENOISED,)),
    Pass("Depth", "Depth", "Z", "VALUE", ("use_pass_z",)),
    Pass("Normal", "Normal", "XYZ", "VECTOR", ("use_pass_normal",)),
    Pass("Position", "Position", "XYZ", "VECTOR", ("use_pass_position",)),
    Pass("UV", "UV", "UVA", "VECTOR", ("use_pass_uv",)),
    Pass("Object Index", "IndexOB", "X", "VALUE", ("use_pass_object_index",)),
    Pass("Material Index", "IndexMA", "X", "VALUE", ("use_pass_material_index",)),
    Pass("Emission", "Emit", "RGB", "COLOR", ("use_pass_emit",)),
    Pass("Environment", "Env", "RGB", "COLOR", ("use_pass_environment",)),
    Pass("Denoising Albedo", "Denoising Albedo", "RGB", "COLOR", ("gi_engine.use_pass_albedo", DENOISING)),
    Pass("Denoising Normal", "Denoising Normal", "XYZ", "VECTOR", (DENOISING,)),
    Pass("Debug Sample Count", "Debug Sample Count", "X", "VALUE", ("gi_engine.use_pass_sample_count", SAMPLE_COUNT)),
    Pass("Cache Samples", "Cache Samples", "X", "VALUE", ("gi_engine.use_pass_cache_samples",)),
    *(Pass(name, name, "RGB", "COLOR", ("gi_engine.use_pass_terms",)) for name in TERMS),
    *(Pass(name, name, "X", "VALUE", ("gi_engine.use_pass_photons",)) for name in PHOTONS),
)


def passes_of(view_layer, scene=None) -> list[Pass]:
    """The passes that the view layer asks for. `scene`: its own, which it does not know itself while Blender registers passes."""
    scene = scene or view_layer.id_data
    return [p for p in PASSES if not p.wanted or any(flag(view_layer, scene, path) for path in p.wanted)]


def aovs_of(view_layer) -> list[Pass]:
    """The passes that AOV outputs of node trees fill. Blender marks those whose names clash."""
    kinds = {"COLOR": "RGBA", "VALUE": "X"}
    return [Pass(aov.name, aov.name, kinds[aov.type], aov.type) for aov in view_layer.aovs if aov.is_valid]


def flag(view_layer, scene, path: str) -> bool:
    owner = scene if path.startswith(OF_SCENE) else view_layer
    for name in path.removeprefix(OF_SCENE).split("."):
        owner = getattr(owner, name, False)
    return bool(owner)


def contract_name(blender_name: str) -> str | None:
    return next((p.name for p in PASSES if p.blender_name == blender_name), None)
