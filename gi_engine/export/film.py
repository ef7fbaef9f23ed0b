"""Frame size, border, pixel filter and passes to scene_data.Film."""

from __future__ import annotations

import numpy as np

from ..passes import NOISY, aovs_of, passes_of
from ..scene_data import Denoising, Film


def frame_size(render) -> tuple[int, int]:
    """Pixels of the full frame, as Blender rounds them."""
    scale = render.resolution_percentage
    return max(1, render.resolution_x * scale // 100), max(1, render.resolution_y * scale // 100)


def region(render, width: int, height: int) -> tuple[int, int, int, int]:
    """x0, y0, x1, y1 of the border, row 0 at the bottom; the whole frame without one."""
    if not render.use_border:
        return (0, 0, width, height)
    # In single precision, as Blender does: 0.7 of 320 pixels is 224 there and 223.99… in double.
    x0, x1 = (int(np.float32(x) * np.float32(width)) for x in (render.border_min_x, render.border_max_x))
    y0, y1 = (int(np.float32(y) * np.float32(height)) for y in (render.border_min_y, render.border_max_y))
    return (x0, y0, x1, y1)


def export_film(scene, view_layer, settings, size: tuple[int, int]) -> Film:
    """`settings` are the resolved ones (settings.py)."""
    width, height = size
    return Film(
        width=width,
        height=height,
        region=region(scene.render, width, height),
        filter=settings.pixel_filter,
        # The width of a box filter is not a setting in Blender: it is the pixel.
        filter_width=1.0 if settings.pixel_filter == "BOX" else settings.filter_width,
        exposure=settings.film_exposure,
        transparent=scene.render.film_transparent,
        transparent_glass=settings.transparent_glass,
        transparent_roughness=settings.transparent_roughness,
        passes=wanted_passes(scene, view_layer),
        aovs=[(aov.name, len(aov.channels)) for aov in aovs_of(view_layer)],
    )


def wanted_passes(scene, view_layer) -> list[str]:
    """What the view layer asks for and what guides the denoiser; the noisy image is the native side's picture."""
    wanted = [p.name for p in passes_of(view_layer, scene) if p.name != NOISY]
    denoising = export_denoising(scene)
    guides = denoising.guides.values() if denoising else ()
    return wanted + [name for name in guides if name not in wanted]


def export_denoising(scene) -> Denoising | None:
    own = scene.gi_engine
    if not own.use_denoising:
        return None
    return Denoising(own.denoising_input_passes, own.denoising_prefilter, own.denoising_quality)
