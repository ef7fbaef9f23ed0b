"""Renders a scene by Cycles and by GI Engine in one process and tests whether they agree, block by block (gi_engine/compare/metrics.py).

Each engine renders twice, with different seeds. Pixels are independent (box filter of one pixel), so the squared
differences of the two renders give each block's variance with as many degrees of freedom as it has pixels."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import OpenEXR

import gi_engine
from gi_engine.compare import metrics

ENGINES = ("CYCLES", "GI_ENGINE")


@dataclass
class Agreement:
    name: str
    ratio: float  # GI Engine's mean over Cycles', all channels
    ratio_error: float  # its standard error
    worst: float  # largest |difference| / standard error of a block
    largest: float  # relative difference of the block beyond the limit that is farthest off; 0 if there is none
    failed: int  # blocks beyond the limit
    blocks: int
    invalid: int  # pixels that are not finite

    @property
    def agrees(self) -> bool:
        return self.failed == 0 and self.invalid == 0

    def __str__(self):
        return (
            f"{self.name}: GI Engine / Cycles = {self.ratio:.4f} ± {self.ratio_error:.4f}, "
            f"{self.failed} of {self.blocks} blocks differ (worst {self.worst:.1f} standard errors), {self.invalid} pixels not finite"
        )


def register_once():
    if not hasattr(bpy.types.Scene, "gi_engine"):
        gi_engine.register()


def neutral(scene, samples: int):
    """Takes away what would make the engines differ by design: biased, adaptive and artistic settings."""
    cycles, render = scene.cycles, scene.render
    for name, value in {
        "samples": samples,
        "time_limit": 0.0,
        "use_adaptive_sampling": False,
        "use_denoising": False,
        "sample_clamp_direct": 0.0,
        "sample_clamp_indirect": 0.0,
        "blur_glossy": 0.0,
        "light_sampling_threshold": 0.0,
        "pixel_filter_type": "BOX",
        "filter_width": 1.0,
        "sampling_pattern": "TABULATED_SOBOL",
        "use_animated_seed": False,
        "use_guiding": False,
        "use_fast_gi": False,
    }.items():
        setattr(cycles, name, value)
    for layer in scene.view_layers:
        layer.samples = 0
    for item in scene.objects:
        if hasattr(item, "shadow_terminator_geometry_offset"):
            item.shadow_terminator_geometry_offset = 0.0
    for item in bpy.data.lights:
        item.cycles.is_caustics_light = (
            False  # Cycles' manifold walks: caustics of lamps without a size, too dark elsewhere
        )
    render.use_compositing = render.use_sequencer = render.use_border = render.use_motion_blur = False
    render.use_simplify = False
    render.threads_mode, render.threads = "FIXED", 2
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"


def render(scene, engine: str, seed: int) -> np.ndarray:
    """(height, width, 3) float64, scene-linear, row 0 at the top."""
    scene.render.engine = engine
    scene.cycles.seed = seed
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "render.exr"
        scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True, scene=scene.name)
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = file.channels()
            picked = [next(c for n, c in channels.items() if n.split(".")[-1] == letter) for letter in "RGB"]
            return np.stack([c.pixels for c in picked], -1).astype(np.float64)


def render_pairs(scene) -> dict[str, np.ndarray]:
    """Engine -> (2, height, width, 3). Every render has its own seed."""
    seeds = iter((11, 23, 37, 41))
    return {engine: np.stack([render(scene, engine, next(seeds)) for _ in range(2)]) for engine in ENGINES}


def agreement(name: str, pairs: dict[str, np.ndarray], tolerance: float) -> Agreement:
    """`tolerance`: relative difference of a block that counts as rounding and table lookup."""
    theirs, ours = (pairs[e] for e in ENGINES)
    invalid = int(np.count_nonzero(~np.isfinite(ours)))
    both = (metrics.of_two(*np.nan_to_num(pair, posinf=0, neginf=0)) for pair in (ours, theirs))
    (mean, variance), (truth, noise) = both
    found = metrics.block_errors(mean, variance, truth, noise, tolerance).figures()
    return Agreement(
        name,
        *metrics.mean_ratio(mean, variance, truth, noise),
        worst=found["worst_block"],
        largest=found["largest_beyond_noise"],
        failed=found["blocks_beyond_noise"],
        blocks=found["blocks"],
        invalid=invalid,
    )
