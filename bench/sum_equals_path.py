"""Whether the ways that start at the lights see what path tracing sees, scene by scene: the examples and the shared scenes.

    python bench/sum_equals_path.py [--ways NAME …] [--pixels N] [--seconds S] [--seeds N] [--wide] [WORD …]

Each way renders each scene by several seeds, for about S seconds each; the means of blocks are compared with path tracing's in standard
errors. What deviates is rendered again, by other seeds and four times as long: a deviation is one that both show in the same block and of
the same sign. `light` sees nothing in mirrors and through clear glass, so it may be darker, never brighter. What is biased on its
way to the limit, `particle` by its texels and `vcm` by its radius, is allowed some percent of a block. Path tracing has to meet what the
others find: lamps are weighed both ways whatever they say and, with --wide, enlarged. Each scene has a process of its own.
Replaces the scenes' rows in bench/results/sum_equals_path.md; build/sum_equals_path.json keeps them."""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from measure import ROOT

RESULTS = ROOT / "bench" / "results"
ROWS = ROOT / "build" / "sum_equals_path.json"
WAYS = {"bdpt": {}, "light": {}, "particle": {}, "vcm": {"radius": 1.0}}
ALLOWED = {"bdpt": 0.002, "light": 0.002, "particle": 0.05, "vcm": 0.02}  # of a block, beside the noise
ONLY_BRIGHTER = ("light",)
KNOWN = {
    "pool": "path tracing hardly meets the small lamp; widened, bdpt, light and vcm agree with it, and particle with photon mapping",
    "techmeetup_caustics": "a sun of half a degree, whose caustics path tracing hardly finds; widened, bdpt, light and vcm agree",
    "mystery_mirror": "the particles of one pass are too few for its many texels: most of what is dark gets none, a few texels too much",
    "two-planes": "a ball of 1 cm that is 10,000 times as bright as the rest: whether a camera ray meets it decides about the mean",
}
BLOCK = 8  # pixels
LIMIT = 4.0  # standard errors that repeat
SUSPICIOUS = 2.0  # of the whole picture, which is then looked at again
DARKEST = 0.02  # of the picture's mean: darker blocks are allowed for as if they were that bright
TIMEOUT = 900  # seconds for a scene


# -------------------------------------------------------------------------------------------------- in the child


def widen(scene) -> None:
    """Lamps so large that path tracing meets them by chance."""
    lamps = [item for item in scene.objects if item.type == "LIGHT"]
    for item in lamps:
        lamp, distance = item.data, (item.matrix_world.translation - scene.camera.matrix_world.translation).length
        if lamp.type == "SUN":
            lamp.angle = max(lamp.angle, 0.3)
        elif lamp.type == "AREA":
            lamp.size, lamp.size_y = max(lamp.size, 0.1 * distance), max(lamp.size_y, 0.1 * distance)
        else:
            lamp.shadow_soft_size = max(lamp.shadow_soft_size, 0.05 * distance)


class Scene:
    def __init__(self, path: Path, options):
        import bpy

        from tests.parity import shared

        self.scene = shared.open_small(path, options.pixels, 1)
        cycles = self.scene.cycles
        cycles.caustics_reflective = cycles.caustics_refractive = True
        for lamp in bpy.data.lights:
            lamp.cycles.use_multiple_importance_sampling = True
        if options.wide:
            widen(self.scene)
        self.scene.gi_engine.is_own = False
        self.graph = bpy.context.evaluated_depsgraph_get()
        self.options = options
        self.exported, self.samples, self.built = {}, {}, None

    def render(self, way: str, seed: int, samples: int):
        """Seconds, and the picture (height, width, 3)."""
        from gi_engine import native
        from gi_engine.export import export
        from gi_engine.session import Session

        for name in {"path", way} - set(self.exported):
            self.exported[name] = export(self.graph, native.integrators(), integrator=name)
        found = self.exported[way]
        settings = found.settings
        settings.seed, settings.samples, settings.threads = seed, samples, self.options.threads
        settings.time_limit, settings.parameters = 0.0, {**settings.parameters, **WAYS.get(way, {})}
        session = Session(self.exported["path"].scene, settings, built=self.built)
        self.built = session.native_scene
        with session:
            while not session.wait():
                pass
            progress = session.progress()
            assert progress["bad_samples"] == 0, f"{way}: {progress['bad_samples']} samples are not finite"
            return progress["seconds"], session.read("Combined")[..., :3].astype(np.float64)

    def pictures(self, way: str, first_seed: int, seconds: float) -> np.ndarray:
        """(seeds, height, width, 3)"""
        if way not in self.samples:
            samples, took = 1, self.render(way, 9999, 1)[0]
            while took < 0.2 * self.options.seconds:
                samples *= 2
                took = self.render(way, 9999, samples)[0]
            self.samples[way] = samples / took  # a second
        samples = max(1, round(self.samples[way] * seconds))
        return np.stack([self.render(way, first_seed + k, samples)[1] for k in range(self.options.seeds)])


class Seen:
    """Means of blocks and of the picture, and their variances: of pixels between seeds, which are independent, or, as light that lights
    many at once makes them depend on one another, of the means themselves, where these are larger."""

    def __init__(self, pictures: np.ndarray):
        n, height, width, _ = pictures.shape
        rows, columns = height // BLOCK, width // BLOCK

        def cut(x):
            return x[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3).mean((1, 3))

        blocks = np.stack([cut(p) for p in pictures])
        of_pixels = cut(pictures.var(0, ddof=1)) / (BLOCK * BLOCK)
        self.blocks = blocks.mean(0), np.maximum(of_pixels, blocks.var(0, ddof=1)) / n
        means = blocks.mean((1, 2, 3))
        self.whole = means.mean(), max(of_pixels.mean() / of_pixels.size, means.var(ddof=1)) / n


def deviations(truth, found, allowed: float) -> np.ndarray:
    """Of means and variances: standard errors, with its sign, of what exceeds the allowance."""
    (a, var_a), (b, var_b) = truth, found
    floor = DARKEST * a.mean() + 1e-9
    beyond = np.maximum(np.abs(b - a) - allowed * np.maximum(np.abs(a), floor), 0)
    return np.sign(b - a) * beyond / (np.sqrt(var_a + var_b) + 1e-4 * floor)


def nearer(before, now):
    """Of two deviations the smaller, none where their signs differ."""
    both = np.sign(now) * np.minimum(np.abs(before), np.abs(now))
    return np.where((np.sign(before) == np.sign(now)) | np.isinf(before), both, 0)


def compare(path: Path, options) -> dict:
    scene = Scene(path, options)
    rounds = {}

    def truth(k):
        if k not in rounds:
            rounds[k] = Seen(scene.pictures("path", 100 + 1000 * k, options.seconds * 4**k))
        return rounds[k]

    row = {"name": name_of(path, options)}
    for way in options.ways:
        z, of_mean = math.inf, math.inf
        for k in (0, 1):
            found = Seen(scene.pictures(way, 500 + 1000 * k, options.seconds * 4**k))
            now = deviations(truth(k).blocks, found.blocks, ALLOWED[way])
            mean_now = deviations(truth(k).whole, found.whole, ALLOWED[way])
            if way in ONLY_BRIGHTER:
                now, mean_now = np.maximum(now, 0), np.maximum(mean_now, 0)
            z, of_mean = nearer(z, now), nearer(of_mean, mean_now)
            if np.abs(z).max() < LIMIT and abs(of_mean) < SUSPICIOUS:
                break
        worst = np.unravel_index(np.abs(z).argmax(), z.shape)
        (a, var_a), (b, var_b) = truth(k).whole, found.whole
        row[way] = {
            "ratio": b / max(a, 1e-12),
            "error": math.sqrt(var_a + var_b) / max(a, 1e-12),
            "worst": float(z[worst]),
            "at": [int(i) for i in worst],
            "there": [float(x.blocks[0][worst]) for x in (truth(k), found)],
            "blocks": z.size,
            "deviating": int((np.abs(z) >= LIMIT).sum()),
            "of_mean": float(of_mean),
            "repeated": k,
        }
    return row


# -------------------------------------------------------------------------------------------------- in the parent


def name_of(path: Path, options) -> str:
    return path.stem + (", lamps widened" if options.wide else "")


def in_child(path: Path, options) -> dict:
    command = [sys.executable, __file__, "--child", str(path), "--pixels", str(options.pixels)]
    command += ["--seconds", str(options.seconds), "--seeds", str(options.seeds), "--threads", str(options.threads)]
    command += ["--ways", *options.ways, *["--wide"] * options.wide]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        return {"name": name_of(path, options), "failure": f"not done after {TIMEOUT} s"}
    lines = [line for line in done.stdout.splitlines() if line.startswith("ROW ")]
    if lines:
        return json.loads(lines[-1][4:])
    errors = [line for line in done.stderr.splitlines() if "Error" in line]
    return {"name": name_of(path, options), "failure": errors[-1] if errors else f"exit code {done.returncode}"}


def files(words) -> list[Path]:
    sys.path.insert(0, str(ROOT))
    from tests.parity import shared

    found = sorted((ROOT / "examples").glob("*.blend")) + (shared.files() if shared.folder() else [])
    return [f for f in found if not words or any(word in str(f) for word in words)]


def cell(found: dict | None) -> str:
    if not found:
        return "–"
    text = f"{found['ratio']:.4f} ± {found['error']:.4f}, {abs(found['worst']):.1f}"
    if found["deviating"]:
        text = f"**{text}: {found['deviating']} of {found['blocks']}**"
    elif abs(found.get("of_mean", 0)) >= LIMIT:
        text = f"**{text}: the mean**"
    return text


def write(rows: dict, options) -> None:
    ways = list(WAYS)
    out = [
        "# Does the light's way see what the eye's way sees?",
        "",
        f"`python bench/sum_equals_path.py`: pictures of {options.pixels} pixels, {options.seeds} seeds of {options.seconds:g} s, blocks of "
        f"{BLOCK} x {BLOCK} pixels. Mean over",
        "path tracing's, then the largest deviation of a block in standard errors; in bold where one of 4 or more comes again with other seeds",
        "and four times the samples, and how many blocks do. `light` may be darker: it sees nothing in mirrors. Allowed beside noise: "
        + ", ".join(f"{way} {100 * ALLOWED[way]:g} %" for way in ways)
        + ".",
        "",
        "| | " + " | ".join(ways) + " |",
        "|---" * (len(ways) + 1) + "|",
    ]
    for row in sorted(rows.values(), key=lambda row: row["name"]):
        if "failure" in row:
            out.append(f"| {row['name']} | {row['failure']} |" + " |" * (len(ways) - 1))
        else:
            out.append(f"| {row['name']} | " + " | ".join(cell(row.get(way)) for way in ways) + " |")
    out += [
        "",
        "Rows are of runs of different lengths, 0.4 to 1 s a seed.",
        "",
        *(f"- {name}: {reason}." for name, reason in KNOWN.items()),
    ]
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "sum_equals_path.md").write_text("\n".join(out) + "\n")
    ROWS.parent.mkdir(exist_ok=True)
    ROWS.write_text(json.dumps(rows))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    parser.add_argument("--pixels", type=int, default=64, help="of the longer side")
    parser.add_argument("--seconds", type=float, default=0.7)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--wide", action="store_true", help="lamps enlarged")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        sys.path.insert(0, str(ROOT))
        print("ROW " + json.dumps(compare(options.child, options)), flush=True)
        return 0
    rows = json.loads(ROWS.read_text()) if ROWS.exists() else {}
    for path in files(options.words):
        row = in_child(path, options)
        old = rows.get(row["name"], {})
        rows[row["name"]] = row if "failure" in row or "failure" in old else old | row
        print(row["name"], row.get("failure") or " | ".join(f"{w} {cell(row[w])}" for w in options.ways), flush=True)
        write(rows, options)
    return int(any(cell(row.get(way)).startswith("*") for row in rows.values() for way in WAYS))


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)  # Blender's module can hang at exit
