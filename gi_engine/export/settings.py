"""A scene's render settings, resolved: its own, or Cycles' where the scene never had settings of ours.

SHARED says which of our settings Cycles has too; panels and the copy operator read the same table.
"""

from __future__ import annotations

from types import SimpleNamespace

from .. import machine
from ..scene_data import Settings
from .film import export_denoising
from .ids import MASK, hash_words

# Our name -> Cycles' name on scene.cycles.
SHARED = {
    "samples": "samples",
    "time_limit": "time_limit",
    "preview_samples": "preview_samples",
    "preview_pause": "preview_pause",
    "seed": "seed",
    "use_animated_seed": "use_animated_seed",
    "film_exposure": "film_exposure",
    "transparent_glass": "film_transparent_glass",
    "transparent_roughness": "film_transparent_roughness",
    "pixel_filter": "pixel_filter_type",
    "filter_width": "filter_width",
    # Parameters of integrators.
    "max_bounces": "max_bounces",
    "diffuse_bounces": "diffuse_bounces",
    "glossy_bounces": "glossy_bounces",
    "transmission_bounces": "transmission_bounces",
    "volume_bounces": "volume_bounces",
    "transparent_bounces": "transparent_max_bounces",
    "min_bounces": "min_light_bounces",
    "clamp_direct": "sample_clamp_direct",
    "clamp_indirect": "sample_clamp_indirect",
    "caustics_reflective": "caustics_reflective",
    "caustics_refractive": "caustics_refractive",
    "filter_glossy": "blur_glossy",
    "light_threshold": "light_sampling_threshold",
}


def source_of(scene, name: str):
    """Where a setting lives now: (owner, property name). For panels, which show what will be rendered with."""
    own = scene.gi_engine
    cycles = getattr(scene, "cycles", None)
    if not own.is_own and cycles is not None and hasattr(cycles, SHARED.get(name, "")):
        return cycles, SHARED[name]
    return own, name


def value_of(scene, name: str):
    owner, prop = source_of(scene, name)
    return getattr(owner, prop)


def copy_from_cycles(scene) -> None:
    """Makes the scene's settings its own, starting from Cycles'."""
    own, cycles = scene.gi_engine, getattr(scene, "cycles", None)
    own.is_own = True
    for name, theirs in SHARED.items():
        if hasattr(own, name) and hasattr(cycles, theirs):
            setattr(own, name, getattr(cycles, theirs))


def resolve(scene, view_layer) -> SimpleNamespace:
    """All settings that are not an integrator's own, by our names."""
    names = [name for name in SHARED if hasattr(scene.gi_engine, name)]
    resolved = SimpleNamespace(**{name: value_of(scene, name) for name in names})
    resolved.samples = samples_of(scene, view_layer, resolved.samples)
    if resolved.use_animated_seed:
        resolved.seed = hash_words(scene.frame_current, resolved.seed & MASK) & 0x7FFFFFFF
    return resolved


def samples_of(scene, view_layer, samples: int) -> int:
    """The view layer may override the scene's samples, as scene.cycles.use_layer_samples says."""
    override = view_layer.samples
    mode = getattr(getattr(scene, "cycles", None), "use_layer_samples", "USE")
    if override <= 0 or mode == "IGNORE":
        return samples
    return min(override, samples) if mode == "BOUNDED" else override


def export_settings(scene, view_layer, descriptors: list[dict], integrator: str | None = None) -> Settings:
    """`descriptors` are the integrators' (native.integrators()); `integrator` overrides the scene's."""
    resolved = resolve(scene, view_layer)
    own = scene.gi_engine
    integrator = integrator or own.integrator
    chosen = next((d for d in descriptors if d["id"] == integrator), None)
    return Settings(
        integrator=integrator,
        samples=max(1, resolved.samples),
        time_limit=resolved.time_limit,
        noise_target=own.noise_target,
        seed=resolved.seed,
        threads=scene.render.threads if scene.render.threads_mode == "FIXED" else machine.current.threads,
        parameters=parameters_of(scene, chosen) if chosen else {},
        keep=own.keep,
        kept_file=own.kept_file,
        kept_misfit=own.kept_misfit,
        denoising=export_denoising(scene),
    )


def parameters_of(scene, descriptor: dict) -> dict:
    """The integrator's parameters by name."""
    own = getattr(scene.gi_engine, descriptor["id"])
    names = [p["name"] for p in descriptor["parameters"]]
    values = {name: value_of(scene, name) if name in SHARED else getattr(own, name) for name in names}
    # Switches are numbers to the native side.
    return {name: int(value) if isinstance(value, bool) else value for name, value in values.items()}


def unheeded(scene, descriptor: dict) -> list[str]:
    """What of the scene's settings shows in the picture all the same, since the integrator has no such switch."""
    names = [p["name"] for p in descriptor["parameters"]]
    if "diffuse_bounces" not in names:  # there are no caustics
        return []
    switches = {"caustics_reflective": "of mirrors and gloss", "caustics_refractive": "of glass"}
    return [
        f"{descriptor['label']} shows caustics {which}, which the scene has switched off"
        for name, which in switches.items()
        if name not in names and not value_of(scene, name)
    ]
