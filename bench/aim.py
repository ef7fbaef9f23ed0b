"""What aiming particles is worth: the noise of particle tracing with and without, at equal passes and at equal time.

    python bench/aim.py [--passes N] [--seeds N] [--particles N] [--pixels N] [--threads N] [--reference N] FILE …

The error is the relative mean squared one of blocks of 4 x 4 pixels against path tracing with --reference samples, so that light that
no particle has found yet counts as missing. Writes nothing."""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
from measure import prepare

import gi_engine
from gi_engine import native
from gi_engine.engine import export
from gi_engine.session import Session


def exported(file: str, options):
    bpy.ops.wm.open_mainfile(filepath=file, load_ui=False, use_scripts=False)
    scene = bpy.context.scene
    prepare(scene, SimpleNamespace(engine="GI_ENGINE", pixels=options.pixels, threads=options.threads))
    scene.gi_engine.is_own = False
    size = (scene.render.resolution_x, scene.render.resolution_y)
    return export(bpy.context.evaluated_depsgraph_get(), native.integrators(), None, size, integrator="particle")


def rendered(found, options, passes: int, seed: int, aim: int | None):
    """The picture, the seconds that it took, and what the log holds; by path tracing where `aim` is None."""
    parameters = {**found.settings.parameters, "particles": options.particles, "aim": aim}
    integrator = "particle"
    if aim is None:
        integrator = "path"
        parameters = {
            k: v
            for k, v in parameters.items()
            if k not in ("particles", "aim", "texel_size", "texel_memory", "direct", "gather")
        }
    settings = replace(
        found.settings, integrator=integrator, samples=passes, seed=seed, threads=options.threads, parameters=parameters
    )
    with Session(found.scene, settings) as session:
        start = time.perf_counter()
        while not session.wait():
            pass
        seconds = time.perf_counter() - start
        return session.read("Combined")[..., :3].astype(np.float64), seconds, dict(session.native.figures())


def blocks(image: np.ndarray, side: int = 4) -> np.ndarray:
    height, width = (n // side * side for n in image.shape[:2])
    return image[:height, :width].reshape(height // side, side, width // side, side, 3).mean((1, 3))


def error(image: np.ndarray, reference: np.ndarray) -> float:
    image, reference = blocks(image), blocks(reference)
    return float(((image - reference) ** 2 / (reference**2 + (0.1 * reference.mean()) ** 2)).mean())


def measure(found, options, aim: int, reference: np.ndarray) -> dict:
    first = rendered(found, options, 1, 1, aim)[1]
    runs = [rendered(found, options, options.passes, seed, aim) for seed in range(1, options.seeds + 1)]
    a_pass = (float(np.median([seconds for _, seconds, _ in runs])) - first) / (options.passes - 1)
    errors = [error(image, reference) for image, _, _ in runs]
    brightness = float(np.mean([image.mean() for image, _, _ in runs]) / reference.mean())
    return {
        "error": float(np.mean(errors)),
        "start": first - a_pass,
        "pass": a_pass,
        "brightness": brightness,
        "figures": runs[0][2],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+")
    numbers = {"passes": 32, "seeds": 3, "particles": 200_000, "pixels": 4000, "threads": 2, "reference": 1024}
    for name, default in numbers.items():
        parser.add_argument(f"--{name}", type=int, default=default)
    options = parser.parse_args()
    gi_engine.register()
    for file in options.files:
        name, found = Path(file).stem, exported(file, options)
        rendered(found, options, 1, 1, 0)  # the first one reads what the others find in memory
        reference = rendered(found, options, options.reference, 99, None)[0]
        even, aimed = (measure(found, options, aim, reference) for aim in (0, 1))
        for way, m in (("even", even), ("aimed", aimed)):
            figures = {k: v for k, v in m["figures"].items() if "aim" in k or "way" in k}
            print(
                f"{name}, {way}: error {m['error']:.4g}, {m['brightness']:.3f} of the light, start {m['start']:.2f} s, pass {m['pass']:.2f} s",
                figures,
            )
        gain = even["error"] / aimed["error"]
        print(
            f"{name}: lower by {gain:.2f} at equal passes, {gain * even['pass'] / aimed['pass']:.2f} at equal time of passes",
            flush=True,
        )
    os._exit(0)


if __name__ == "__main__":
    main()
