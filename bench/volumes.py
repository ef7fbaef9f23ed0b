"""Volumes that vary in space, GI Engine over Cycles at equal samples: processor time of a picture, and its noise.

    python bench/volumes.py [--rounds N] [--pixels N] [--samples N]

The parity suite's cloud and misty worlds. Both engines in one process, taking turns; medians over the rounds. Noise is the root of the mean
squared difference of two pictures of the same engine over √2. Writes bench/results/volumes.md."""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.parity import compare, suite  # noqa: E402

CASES = ("cloud", "world, low mist", "world, even mist")


def measure(scene, engine: str, rounds: int) -> tuple[float, float]:
    """Processor seconds and noise."""
    seconds, pictures = [], []
    for i in range(rounds):
        start = time.process_time()
        pictures.append(compare.render(scene, engine, i + 1))
        seconds.append(time.process_time() - start)
    return statistics.median(seconds), float(np.sqrt(np.mean((pictures[0] - pictures[1]) ** 2) / 2))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--pixels", type=int, default=64)
    parser.add_argument("--samples", type=int, default=16)
    options = parser.parse_args()
    compare.register_once()
    lines = [
        "# Volumes that vary in space",
        "",
        f"`python bench/volumes.py`: Blender {bpy.app.version_string}, {options.pixels} x {options.pixels} pixels, {options.samples} samples,",
        f"medians of {options.rounds} rounds. Processor seconds of a picture, and noise of a pixel (standard error).",
        "",
        "| | Cycles | GI Engine | ratio | noise, Cycles | noise, GI Engine | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in CASES:
        case = suite.CASES[name]
        scene = suite.empty(case.size)
        case.build(scene)
        compare.neutral(scene, options.samples)
        scene.cycles.volume_bounces = case.cycles["volume_bounces"]
        scene.render.resolution_x = scene.render.resolution_y = options.pixels
        (theirs, their_noise), (ours, our_noise) = (measure(scene, e, options.rounds) for e in compare.ENGINES)
        figures = f"{theirs:.2f} | {ours:.2f} | {ours / theirs:.2f} | {their_noise:.4f} | {our_noise:.4f} | {our_noise / their_noise:.2f}"
        lines.append(f"| {name} | {figures} |")
        print(lines[-1], flush=True)
    (ROOT / "bench" / "results" / "volumes.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
