"""One scene by one engine in a process of its own: start-up, samples a second, peak memory. Used by throughput.py, start.py.

    python bench/measure.py FILE ENGINE [--pixels N] [--seconds S] [--threads N]

Prints one line of JSON. Denoising, adaptive sampling and the compositor are off for both engines; bounces are the scene's own."""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
LIMIT = 400  # seconds


def resident() -> float:
    """MB in use now."""
    with open("/proc/self/status") as status:
        return int(next(line for line in status if line.startswith("VmRSS")).split()[1]) / 1024


def peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measure(options) -> dict:
    import bpy

    import gi_engine

    gi_engine.register()
    bpy.ops.wm.open_mainfile(filepath=options.file, load_ui=False, use_scripts=False)
    scene = bpy.context.scene
    prepare(scene, options)

    def timed(samples: int) -> float:
        scene.cycles.samples = samples
        start = time.perf_counter()
        bpy.ops.render.render(scene=scene.name)
        return time.perf_counter() - start

    before = resident()
    start = timed(1)
    # As many samples as fill the time, found by doubling; the start is taken off.
    samples, seconds = 4, 0.0
    while options.seconds:
        seconds = timed(samples) - start
        if seconds > 0.5 * options.seconds or samples >= 1 << 16:
            break
        samples *= 2 if seconds < 0.1 * options.seconds else max(2, round(options.seconds / seconds))
    rate = (samples - 1) / max(seconds, 1e-6) if options.seconds else 0.0
    return {"start": start, "rate": rate, "samples": samples, "memory": peak() - before}


def prepare(scene, options):
    scene.render.engine = options.engine
    cycles, render = scene.cycles, scene.render
    cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_guiding = False
    cycles.time_limit, cycles.device = 0.0, "CPU"
    for layer in scene.view_layers:
        layer.samples = 0
    render.use_compositing = render.use_sequencer = render.use_motion_blur = False
    factor = (options.pixels / (render.resolution_x * render.resolution_y)) ** 0.5
    render.resolution_x, render.resolution_y = round(render.resolution_x * factor), round(render.resolution_y * factor)
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", options.threads


def in_child(path: Path, engine: str, pixels: int, seconds: float, threads: int) -> dict:
    """The measurement of a fresh process; {"error": …} where it fails."""
    command = [sys.executable, __file__, str(path), engine, "--pixels", str(pixels)]
    command += ["--seconds", str(seconds), "--threads", str(threads)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return {"error": f"not done after {LIMIT} s"}
    lines = [line for line in done.stdout.splitlines() if line.startswith('{"start"')]
    return (
        json.loads(lines[-1]) if lines else {"error": (done.stderr.strip().splitlines() or [str(done.returncode)])[-1]}
    )


def scenes(words=()) -> list[Path]:
    """The shared scenes beside the checkout, else the examples."""
    folder = next(
        (p / "shared" / "scenes" for p in ROOT.parents if (p / "shared" / "scenes").is_dir()), ROOT / "examples"
    )
    return [p for p in sorted(folder.glob("*.blend")) if not words or any(word in p.stem for word in words)]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file")
    parser.add_argument("engine", choices=("CYCLES", "GI_ENGINE"))
    parser.add_argument("--pixels", type=int, default=40_000)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--threads", type=int, default=2)
    print(json.dumps(measure(parser.parse_args())), flush=True)
    os._exit(0)  # Blender's module can hang at exit


if __name__ == "__main__":
    main()
