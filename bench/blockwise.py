"""How soon a picture is right to one in a hundred, block by block: Cycles, path tracing and particle tracing, in one process.

    python bench/blockwise.py FILE.blend [--pixels N] [--target X] [--threads N] [--set name=value …] [--reference FILE.npy]

The error is the root mean square over blocks of 8 x 8 pixels of the relative error of the block's mean, against a long render by path
tracing (kept in --reference, if named). Ours is read from one growing picture; Cycles renders anew with twice the samples until it is
there, and the time of its start is taken off. Denoising and adaptive sampling are off, bounces the scene's own, lengths of renders such
that every engine gets past the target. Exits with 1 if particle tracing is not there before Cycles."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import gi_engine
from gi_engine import native
from gi_engine.export import export
from gi_engine.scene_data import Settings
from gi_engine.session import Session

BLOCK = 8
DARKEST = 0.05  # of the picture's mean: darker blocks count as if they were this bright


def blocks(picture: np.ndarray) -> np.ndarray:
    height, width = (n // BLOCK * BLOCK for n in picture.shape[:2])
    cut = picture[:height, :width, :3].astype(np.float64)
    return cut.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean((1, 3, 4))


def error_of(picture: np.ndarray, reference: np.ndarray) -> float:
    truth = blocks(reference)
    return float(np.sqrt(np.mean(((blocks(picture) - truth) / np.maximum(truth, DARKEST * truth.mean())) ** 2)))


class Ours:
    """The scene, exported once, for any of our integrators."""

    def __init__(self, threads: int):
        self.found = export(bpy.context.evaluated_depsgraph_get(), native.integrators())
        self.threads = threads

    def settings(self, integrator: str, seed: int, parameters: dict, **limits) -> Settings:
        names = {p["name"] for d in native.integrators() if d["id"] == integrator for p in d["parameters"]}
        shared = {k: v for k, v in self.found.settings.parameters.items() if k in names}
        return Settings(integrator, seed=seed, threads=self.threads, parameters={**shared, **parameters}, **limits)

    def reference(self, samples: int) -> np.ndarray:
        with Session(self.found.scene, self.settings("path", 1000, {}, samples=samples)) as session:
            while not session.wait():
                pass
            return session.read("Combined")

    def curve(
        self, integrator: str, parameters: dict, reference, target: float, limit: float
    ) -> list[tuple[float, float]]:
        """(seconds, error) until the error stays below the target; `limit` in seconds."""
        curve = []
        settings = self.settings(integrator, 1, parameters, samples=0, time_limit=limit)
        with Session(self.found.scene, settings) as session:
            while not session.wait():
                progress = session.progress()
                if progress["passes"] and (not curve or progress["seconds"] > 1.05 * curve[-1][0]):
                    curve.append((progress["seconds"], error_of(session.read("Combined"), reference)))
                    if len(curve) > 3 and max(e for _, e in curve[-3:]) < target:
                        break
        return curve


def cycles(scene, samples: int) -> tuple[np.ndarray, float]:
    scene.render.engine = "CYCLES"
    scene.cycles.samples = samples
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "cycles.exr")
        start = time.perf_counter()
        bpy.ops.render.render(write_still=True)
        seconds = time.perf_counter() - start
        image = bpy.data.images.load(scene.render.filepath)
        pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
        image.pixels.foreach_get(pixels)
        pixels = pixels.reshape(image.size[1], image.size[0], 4)
        bpy.data.images.remove(image)
    return pixels, seconds


def cycles_curve(scene, reference, target: float, limit: float) -> list[tuple[float, float]]:
    cycles(scene, 1)
    start = cycles(scene, 1)[1]
    curve, samples = [], 32
    while not curve or (curve[-1][1] > target and curve[-1][0] < limit):
        picture, seconds = cycles(scene, samples)
        curve.append((max(seconds - start, 1e-3), error_of(picture, reference)))
        samples *= 2
    return curve


def time_to(curve: list[tuple[float, float]], target: float) -> float:
    """Seconds at which error = a / sqrt(seconds), fitted to the curve's last points, meets the target: single points jump about.
    Infinite where the last point is above the target: a bias may be in the way."""
    last = curve[-3:]
    if min(error for _, error in last) > target:
        return float("inf")
    return float(np.mean([seconds * (error / target) ** 2 for seconds, error in last]))


def prepare(path: Path, pixels: int, threads: int):
    gi_engine.register()
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    scene = bpy.context.scene
    render, settings = scene.render, scene.cycles
    settings.use_adaptive_sampling = settings.use_denoising = settings.use_guiding = False
    settings.pixel_filter_type, settings.device = "BOX", "CPU"
    settings.sample_clamp_direct = settings.sample_clamp_indirect = 0.0
    render.use_compositing = render.use_sequencer = False
    factor = (pixels / (render.resolution_x * render.resolution_y)) ** 0.5
    render.resolution_x, render.resolution_y = (
        max(BLOCK, round(n * factor / BLOCK) * BLOCK) for n in (render.resolution_x, render.resolution_y)
    )
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", threads
    scene.update_tag()
    return scene


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--pixels", type=int, default=128 * 128)
    parser.add_argument("--target", type=float, default=0.01)
    parser.add_argument("--limit", type=float, default=120.0, help="seconds for any of them")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--samples", type=int, default=8192, help="of the reference")
    parser.add_argument("--reference", type=Path)
    parser.add_argument("--set", action="append", default=[], help="a parameter of particle tracing")
    options = parser.parse_args()
    scene = prepare(options.file, options.pixels, options.threads)
    ours = Ours(options.threads)
    if options.reference and options.reference.exists():
        reference = np.load(options.reference)
    else:
        reference = ours.reference(options.samples)
        if options.reference:
            np.save(options.reference, reference)
    particle = dict(item.split("=", 1) for item in options.set)
    found = {
        "Cycles": cycles_curve(scene, reference, options.target, options.limit),
        "path": ours.curve("path", {}, reference, options.target, options.limit),
        "particle": ours.curve("particle", particle, reference, options.target, options.limit),
    }
    print(f"| | seconds to {100 * options.target:g} % | last error |\n|---|---|---|")
    for name, curve in found.items():
        print(
            f"| {name} | {time_to(curve, options.target):.1f} | {100 * curve[-1][1]:.2f} % after {curve[-1][0]:.1f} s |"
        )
    return int(not time_to(found["particle"], options.target) < time_to(found["Cycles"], options.target))


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)
