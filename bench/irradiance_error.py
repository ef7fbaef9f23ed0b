"""Bias and noise of irradiance caching against path tracing, by the error allowed and the rays of a record; draws docs/images.

    python bench/irradiance_error.py [--file BLEND] [--pixels N] [--passes N] [--reference S]

The measure is the relative root mean square over blocks of 8 x 8 pixels, which noise of single pixels hardly touches and blotches do. It
is a product of differences to two independent references, so that their noise cancels."""

from __future__ import annotations

import argparse
import os
import sys
import time

import numpy as np
from measure import ROOT

ERRORS = (0.8, 0.4, 0.2, 0.1)
SAMPLES = (64, 256, 1024, 4096)
BLOCK = 8
FIXED = {"refinement": 0, "min_spacing": 3}  # so that the rays of a record are as many as they say
PICTURE = ROOT / "docs" / "images" / "irradiance_cache_error.svg"
COLORS = ("#c44", "#c92", "#4a4", "#37c")


def open_scene(options):
    import bpy

    sys.path.insert(0, str(ROOT))
    import gi_engine
    from gi_engine import native
    from gi_engine.export import export

    gi_engine.register()
    bpy.ops.wm.open_mainfile(filepath=options.file, load_ui=False, use_scripts=False)
    render = bpy.context.scene.render
    render.engine = "GI_ENGINE"
    factor = (options.pixels / (render.resolution_x * render.resolution_y)) ** 0.5
    size = round(render.resolution_x * factor), round(render.resolution_y * factor)
    return export(bpy.context.evaluated_depsgraph_get(), native.integrators(), None, size).scene


def picture(scene, integrator, seed, samples=0, seconds=0.0, **parameters):
    """(blocks, 3) of the picture, and seconds."""
    from gi_engine.scene_data import Settings
    from gi_engine.session import Session

    settings = Settings(integrator, samples, time_limit=seconds, seed=seed, parameters=parameters)
    start = time.perf_counter()
    with Session(scene, settings) as session:
        while not session.wait():
            pass
        image = session.read("Combined")[..., :3].astype(np.float64)
    took = time.perf_counter() - start
    h, w = (n // BLOCK for n in image.shape[:2])
    blocks = image[: h * BLOCK, : w * BLOCK].reshape(h, BLOCK, w, BLOCK, 3).mean((1, 3))
    return blocks.reshape(-1, 3), took


def relative_error(found, references) -> float:
    a, b = references
    mean = (a + b) / 2
    square = ((found - a) * (found - b)).mean(1) / (mean.mean(1) ** 2 + (0.1 * mean.mean()) ** 2)
    return float(np.sqrt(max(square.mean(), 0.0)))


def draw(table, across, along, title, unit) -> str:
    """Errors, by (of `across`, of `along`): over `across`, both logarithmic, a line for each of `along`, a number of `unit`."""
    width, height, left, right, bottom = 560, 340, 60, 140, 40
    low, high = 1e-3, 1.0

    def x(value):
        return left + (width - left - right) * np.log(value / min(across)) / np.log(max(across) / min(across))

    def y(value):
        return (height - bottom) * (1 - np.log(max(value, low) / low) / np.log(high / low)) + 5

    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif" font-size="12">'
    ]
    out.append(f'<rect width="{width}" height="{height}" fill="white"/>')
    for value, name in ((1e-3, "0.1 %"), (1e-2, "1 %"), (1e-1, "10 %"), (1.0, "100 %")):
        out.append(f'<path d="M{left} {y(value):.0f}H{width - right}" stroke="#ccc"/>')
        out.append(f'<text x="{left - 8}" y="{y(value) + 4:.0f}" text-anchor="end">{name}</text>')
    for value in across:
        out.append(f'<text x="{x(value):.0f}" y="{height - 18}" text-anchor="middle">{value:g}</text>')
    out.append(f'<text x="{(width + left - right) / 2}" y="{height - 3}" text-anchor="middle">{title}</text>')
    for line, color in zip(along, COLORS, strict=False):
        points = " ".join(f"{x(v):.1f},{y(table[v, line]):.1f}" for v in across)
        out.append(f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="2"/>')
        last = y(table[max(across), line])
        out.append(f'<text x="{width - right + 8}" y="{last + 4:.0f}" fill="{color}">{line:,} {unit}</text>')
    return "\n".join([*out, "</svg>"]) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--file", default=str(ROOT / "examples" / "interior.blend"))
    parser.add_argument("--pixels", type=int, default=20_000)
    parser.add_argument("--passes", type=int, default=64)
    parser.add_argument("--reference", type=float, default=60.0, help="seconds of each of two")
    options = parser.parse_args()
    scene = open_scene(options)
    references = [picture(scene, "path", seed, seconds=options.reference)[0] for seed in (101, 102)]
    table = {}
    for error in ERRORS:
        for samples in SAMPLES:
            found, took = picture(
                scene, "irradiance_cache", 1, options.passes, error=error, record_samples=samples, **FIXED
            )
            table[error, samples] = relative_error(found, references)
            print(f"{error} {samples:5} {100 * table[error, samples]:.2f} % {took:.1f} s", flush=True)
    PICTURE.write_text(draw(table, ERRORS, SAMPLES, "Error allowed (\u03b1)", "rays"), encoding="utf-8")
    os._exit(0)  # Blender's module can hang at exit


if __name__ == "__main__":
    main()
