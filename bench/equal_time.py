"""Error against a long reference over time: GI Engine's integrators and Cycles, in one run.

    python bench/equal_time.py [--pixels N] [--seconds S …] [--seeds N] [--reference S] [--ways NAME …] [--processor] [WORD …]

Each way renders each scene (files, or words in names of the shared scenes) for about S seconds of sampling, once per seed, in a process of
its own. The error is the relative mean squared one, (x − r) (x − s) / (m² + (mean m / 10)²), of the worst pixels without a thousandth: r and
s are two long renders by other seeds and m their mean, so that their own noise cancels. `spread` is the same between seeds, which no
difference between the engines can touch, nor what a biased way is off; `blocks` the error of means over 8 x 8 pixels, in which noise of
single pixels fades and blotches stay. The references are by the unbiased way that is least noisy per second, or the way --by: vcm where
caustics of small lamps are seen through glass or in mirrors, which no unbiased way finds. --processor counts seconds of processor time over
threads, so that other work on the machine matters little. Denoising, adaptive sampling, clamping and Filter Glossy are off, caustics are on,
bounces are the scene's own. Replaces the scenes' rows in bench/results/equal_time.json and .md, and their pictures side by side."""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from measure import ROOT, prepare, scenes

WAYS = {
    "path": ("GI_ENGINE", "path"),
    "bdpt": ("GI_ENGINE", "bdpt"),
    "light": ("GI_ENGINE", "light"),
    "irradiance_cache": ("GI_ENGINE", "irradiance_cache"),
    "photon_map": ("GI_ENGINE", "photon_map"),
    "photon_map_gathered": ("GI_ENGINE", "photon_map", {"global_light": "GATHERED"}),
    "sppm": ("GI_ENGINE", "sppm"),
    "vcm": ("GI_ENGINE", "vcm"),
    "cycles": ("CYCLES", ""),
}
UNBIASED = ("bdpt", "path")  # of which one makes the reference
HOW = ("threads", "pixels", "seeds", "clock")  # that the figures of a scene depend on
RESULTS = ROOT / "bench" / "results"
LIMIT = 1800  # seconds
BLOCK = 8  # pixels


# -------------------------------------------------------------------------------------------------- in the child


def render_all(options) -> None:
    """Images of one way for each of the times and seeds, as options.into/<seconds>_<seed>.npy; prints their times."""
    import bpy

    import gi_engine

    gi_engine.register()
    bpy.ops.wm.open_mainfile(filepath=options.child, load_ui=False, use_scripts=False)
    scene = bpy.context.scene
    engine, integrator, *parameters = WAYS[options.ways[0]]
    prepare(scene, SimpleNamespace(engine=engine, pixels=options.pixels, threads=options.threads))
    cycles = scene.cycles
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.use_animated_seed = False
    scene.gi_engine.is_own = False
    if integrator:
        scene.gi_engine.integrator = "path"

    def now() -> float:
        return time.process_time() / options.threads if options.clock == "processor" else time.perf_counter()

    def timed(samples: int, seed: int) -> float:
        cycles.samples, cycles.seed = samples, seed
        start = now()
        bpy.ops.render.render(scene=scene.name)
        return now() - start

    timed(1, 1)
    start = timed(1, 1)  # reading the scene, and one pass of path tracing
    if integrator:
        scene.gi_engine.integrator = integrator
    for name, value in parameters[0].items() if parameters else ():
        setattr(getattr(scene.gi_engine, integrator), name, value)
    first = max(timed(1, 1) - start, 0.0)  # what a way does before its passes counts
    samples, seconds = 2, 0.0
    while seconds < 0.3 * min(options.seconds):
        samples *= 2
        seconds = timed(samples, 2) - start - first
    rate = (samples - 1) / seconds
    found = []
    for wanted in options.seconds:
        for seed in range(1, options.seeds + 1):
            took = timed(n := max(2, round((wanted - first) * rate)), 100 * options.first_seed + seed) - start
            name = f"{wanted:g}_{seed}"
            np.save(Path(options.into) / name, picture(bpy, options.into))
            found.append({"name": name, "wanted": wanted, "seconds": took, "samples": n})
    print("FOUND" + json.dumps(found), flush=True)


def picture(bpy, folder: str) -> np.ndarray:
    """(height, width, 3) scene-linear."""
    scene = bpy.context.scene
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    path = str(Path(folder) / "picture.exr")
    bpy.data.images["Render Result"].save_render(path, scene=scene)
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    width, height = image.size
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, -1)[..., :3]


# -------------------------------------------------------------------------------------------------- in the parent


def run_child(file: Path, way: str, options, seconds, seeds: int, first_seed: int) -> list[dict]:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, __file__, "--child", str(file), "--into", folder, "--ways", way]
        command += ["--pixels", str(options.pixels), "--threads", str(options.threads), "--seeds", str(seeds)]
        command += ["--processor"] if options.clock == "processor" else []
        command += ["--first-seed", str(first_seed), "--seconds", *map(str, seconds)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
        lines = [line for line in done.stdout.splitlines() if line.startswith("FOUND")]
        if not lines:
            raise SystemExit(f"{file.stem}, {way}: {done.stderr.strip()[-800:]}")
        found = json.loads(lines[-1][5:])
        for one in found:
            one["image"] = np.load(Path(folder) / f"{one['name']}.npy").astype(np.float64)
    return found


def relative_error(image: np.ndarray, references: list[np.ndarray]) -> float:
    mean = np.mean(references, 0)
    square = np.prod([image - r for r in references], 0) if len(references) == 2 else (image - mean) ** 2
    weight = 1.0 / (mean**2 + (0.1 * mean.mean()) ** 2)
    order = np.argsort((((image - mean) ** 2) * weight).mean(-1).ravel())
    errors = (square * weight).mean(-1).ravel()[order]
    return float(errors[: math.ceil(0.999 * len(errors))].mean())


def in_blocks(image: np.ndarray) -> np.ndarray:
    h, w = (n // BLOCK for n in image.shape[:2])
    return image[: h * BLOCK, : w * BLOCK].reshape(h, BLOCK, w, BLOCK, 3).mean((1, 3))


def spread(images: list[np.ndarray], reference: np.ndarray) -> float:
    """Relative variance of one image, by differences in pairs."""
    pairs = [(a, b) for i, a in enumerate(images) for b in images[i + 1 :]]
    return float(np.mean([relative_error(reference + (a - b) / math.sqrt(2), [reference]) for a, b in pairs]))


def measure_scene(file: Path, options) -> dict:
    found = {way: run_child(file, way, options, options.seconds, options.seeds, 1) for way in options.ways}
    last = {way: [o["image"] for o in found[way] if o["wanted"] == options.seconds[-1]] for way in options.ways}
    rough = np.mean([image for images in last.values() for image in images], 0)
    calmest = options.by or min(
        (w for w in UNBIASED if w in options.ways), key=lambda w: spread(last[w], rough), default=UNBIASED[0]
    )
    references = [o["image"] for o in run_child(file, calmest, options, [options.reference], 2, 7)]
    reference = np.mean(references, 0)
    row = {"scene": file.stem, "reference": calmest, **{name: getattr(options, name) for name in HOW}, "ways": {}}
    for way in options.ways:
        row["ways"][way] = []
        for wanted in options.seconds:
            group = [o for o in found[way] if o["wanted"] == wanted]
            row["ways"][way].append(
                {
                    "seconds": float(np.mean([o["seconds"] for o in group])),
                    "samples": group[0]["samples"],
                    "error": float(np.mean([relative_error(o["image"], references) for o in group])),
                    "blocks": float(
                        np.mean([relative_error(in_blocks(o["image"]), [*map(in_blocks, references)]) for o in group])
                    ),
                    "spread": spread([o["image"] for o in group], reference),
                }
            )
    save_pictures(file.stem, reference, {way: images[0] for way, images in last.items()})
    return row


def save_pictures(stem: str, reference: np.ndarray, images: dict) -> None:
    """The reference and the last picture of each way, side by side, in their order."""
    import bpy

    bright = 0.7 / max(float(np.percentile(reference, 90)), 1e-9)
    strip = np.concatenate([reference, *images.values()], 1) * bright
    srgb = np.where(strip < 0.0031308, 12.92 * strip, 1.055 * np.maximum(strip, 1e-9) ** (1 / 2.4) - 0.055).clip(0, 1)
    height, width, _ = srgb.shape
    image = bpy.data.images.new("strip", width, height)
    image.pixels.foreach_set(np.dstack([srgb, np.ones((height, width))]).astype(np.float32).ravel())
    image.filepath_raw, image.file_format = str(RESULTS / f"equal_time_{stem}.png"), "PNG"
    image.save()


def ratio(step: dict, theirs: list[dict], name: str) -> str:
    return f"{step[name] * step['seconds'] / (theirs[0][name] * theirs[0]['seconds']):.3f}" if theirs else "–"


def table(rows: list[dict]) -> str:
    lines = ["# Error at equal time\n", "`python bench/equal_time.py`\n"]
    for row in rows:
        how = ", ".join(f"{row[name]} {name}" for name in HOW if row.get(name, "wall") != "wall")
        lines += [
            f"## {row['scene']}\n\n{how}; reference by {row['reference']}\n",
            "| way | seconds | samples | relative MSE | of blocks | between seeds | MSE × time, of Cycles' | between seeds × time, of Cycles' |",
            "|---|---|---|---|---|---|---|---|",
        ]
        for way, steps in row["ways"].items():
            for k, step in enumerate(steps):
                ratios = [ratio(step, row["ways"].get("cycles", [])[k : k + 1], name) for name in ("error", "spread")]
                blocks = f"{step['blocks']:.5f}" if "blocks" in step else "–"
                figures = (
                    f"{step['seconds']:.1f} | {step['samples']} | {step['error']:.4f} | {blocks} | {step['spread']:.4f}"
                )
                lines.append(f"| {way} | {figures} | {' | '.join(ratios)} |")
        lines.append("")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=["path", "bdpt", "cycles"])
    parser.add_argument("--seconds", nargs="+", type=float, default=[4.0, 16.0])
    parser.add_argument("--reference", type=float, default=120.0)
    parser.add_argument("--by", choices=WAYS, help="the way that makes the reference")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--pixels", type=int, default=20_000)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--processor", dest="clock", action="store_const", const="processor", default="wall")
    for hidden in ("--child", "--into"):
        parser.add_argument(hidden, help=argparse.SUPPRESS)
    parser.add_argument("--first-seed", type=int, default=1, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        render_all(options)
        sys.stdout.flush()
        os._exit(0)  # Blender's module can hang at exit
    files = [Path(w) for w in options.words if w.endswith(".blend")] or scenes(options.words)
    RESULTS.mkdir(exist_ok=True)
    record = RESULTS / "equal_time.json"
    for file in files:
        row = measure_scene(file, options)
        rows = json.loads(record.read_text()) if record.exists() else []
        rows = sorted([r for r in rows if r["scene"] != row["scene"]] + [row], key=lambda r: r["scene"])
        record.write_text(json.dumps(rows, indent=1) + "\n")
        (RESULTS / "equal_time.md").write_text(table(rows))
        print(table([row]), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
