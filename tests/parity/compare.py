"""Renders a scene by Cycles and by GI Engine in one process and tests whether they agree, block by block.

Each engine renders twice, with different seeds. Pixels are independent (box filter of one pixel), so the squared
differences of the two renders give each block's variance with as many degrees of freedom as it has pixels.
A block passes where |difference| < t * standard error + tolerance * mean, t being corrected for the number of blocks."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
from scipy import stats

import gi_engine

BLOCK = 8  # pixels
FALSE_ALARM = 1e-5  # probability that one image that agrees is said not to
ENGINES = ("CYCLES", "GI_ENGINE")


@dataclass
class Agreement:
    name: str
    ratio: float  # GI Engine's mean over Cycles', all channels
    ratio_error: float  # its standard error
    worst: float  # largest |difference| / standard error of a block
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


def blocks_of(image: np.ndarray) -> np.ndarray:
    """(rows, columns, 3) sums over the blocks; what does not fill a block is left out."""
    h, w = image.shape[0] // BLOCK * BLOCK, image.shape[1] // BLOCK * BLOCK
    return image[:h, :w].reshape(h // BLOCK, BLOCK, w // BLOCK, BLOCK, -1).sum((1, 3))


@lru_cache
def limit(blocks: int) -> float:
    return float(stats.t.isf(FALSE_ALARM / (2 * blocks), BLOCK * BLOCK))


def agreement(name: str, pairs: dict[str, np.ndarray], tolerance: float) -> Agreement:
    """`tolerance`: relative difference of a block that counts as rounding and table lookup."""
    theirs, ours = (pairs[e] for e in ENGINES)
    invalid = int(np.count_nonzero(~np.isfinite(ours)))
    theirs, ours = np.nan_to_num(theirs, posinf=0, neginf=0), np.nan_to_num(ours, posinf=0, neginf=0)
    difference = blocks_of(ours.mean(0) - theirs.mean(0))
    variance = sum(blocks_of((pair[0] - pair[1]) ** 2) / 4 for pair in (theirs, ours))
    error, mean = np.sqrt(variance), blocks_of(theirs.mean(0))
    # An absolute floor, for blocks that are black in one engine by 1e-7 and in the other exactly.
    allowed = limit(mean.size) * error + tolerance * np.abs(mean) + 1e-6 * BLOCK * BLOCK
    total = max(theirs.mean(), 1e-12)
    return Agreement(
        name=name,
        ratio=ours.mean() / total,
        ratio_error=float(np.sqrt(variance.sum()) / (theirs[0].size * total)),
        worst=float((np.abs(difference) / np.maximum(error, tolerance * np.abs(mean) + 1e-6)).max()),
        failed=int(np.count_nonzero(np.abs(difference) > allowed)),
        blocks=mean.size,
        invalid=invalid,
    )
