"""Writes docs/parity.md: the small cases and the shared scenes, what agrees and what does not.

    python -m tests.parity.report [--samples N] [--size PIXELS] [--only small|shared] [WORD …]

Each shared scene is rendered in a process of its own, so that one that crashes is a row and not the end. Rows are kept in
build/parity.json; a run with words replaces the rows whose name has one of them."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

import bpy

from . import compare, shared, suite
from .known import KNOWN

ROWS = shared.ROOT / "build" / "parity.json"
PAGE = shared.ROOT / "docs" / "parity.md"
TOLERANCE = 0.01  # of a block, for whole scenes: textures and lookup tables add up
LIMIT = 540  # seconds for one scene


def small_rows(pick) -> dict:
    rows = {}
    for name in suite.CASES:
        if pick and not any(word in name for word in pick):
            continue
        try:
            for found in suite.agreements(name):
                rows[f"small {found.name}"] = asdict(found) | {"group": "small"}
        except Exception as error:  # a row that says so is the point of the table
            rows[f"small {name}"] = {"name": name, "group": "small", "error": str(error).splitlines()[0]}
        print(name, flush=True)
    return rows


def one_shared(path: Path, size: int, samples: int) -> dict:
    scene = shared.open_small(path, size, samples)
    seconds = {}
    seeds = iter((11, 23, 37, 41))
    pairs = {}
    for engine in compare.ENGINES:
        start = time.perf_counter()
        pairs[engine] = compare.np.stack([compare.render(scene, engine, next(seeds)) for _ in range(2)])
        seconds[engine] = time.perf_counter() - start
    return asdict(compare.agreement(path.stem, pairs, TOLERANCE)) | {"group": "shared", "seconds": seconds}


def shared_rows(options) -> dict:
    rows = {}
    for path in shared.files(options.words):
        command = [sys.executable, "-m", "tests.parity.report", "--one", str(path), "--size", str(options.size)]
        command += ["--samples", str(options.samples)]
        row = {"name": path.stem, "group": "shared"}
        try:
            done = subprocess.run(command, cwd=shared.ROOT, capture_output=True, text=True, timeout=LIMIT)
            lines = [line for line in done.stdout.splitlines() if line.startswith("ROW ")]
            row = json.loads(lines[-1][4:]) if lines else row | {"error": failure(done)}
        except subprocess.TimeoutExpired:
            row["error"] = f"not done after {LIMIT} s"
        rows[f"shared {path.stem}"] = row
        print(
            path.stem,
            row.get("error") or f"{row['ratio']:.4f} ± {row['ratio_error']:.4f}, {row['failed']} of {row['blocks']}",
            flush=True,
        )
    return rows


def failure(done) -> str:
    if done.returncode < 0:
        return f"crashed with signal {-done.returncode}"
    lines = [line for line in (done.stderr or done.stdout).strip().splitlines() if "Error" in line]
    return lines[-1] if lines else f"exit code {done.returncode}"


def line_of(row: dict) -> str:
    if "error" in row:
        return f"| {row['name']} | – | – | {row['error']} |"
    good = not row["failed"] and not row["invalid"]
    verdict = "agrees" if good else f"**{row['failed']} of {row['blocks']} blocks differ**"
    if row["ratio"] == 0:
        verdict = "black in both: nothing is compared"
    elif good and row["group"] == "shared" and abs(row["ratio"] - 1) > max(4 * row["ratio_error"], 0.003):
        verdict = (
            f"every block does, but the mean is {abs(row['ratio'] - 1) / row['ratio_error']:.0f} standard errors off"
        )
    if row["invalid"]:
        verdict += f", {row['invalid']} values not finite"
    if row["name"] in KNOWN:
        verdict += f": {KNOWN[row['name']]}"
    return f"| {row['name']} | {row['ratio']:.4f} ± {row['ratio_error']:.4f} | {row['worst']:.1f} | {verdict} |"


def page(rows: dict, options) -> str:
    out = [
        "# Parity with Cycles",
        "",
        f"Written by `python -m tests.parity.report`, Blender {bpy.app.version_string}. Both engines render in one process, twice each with",
        "different seeds; filters that bias, adaptive sampling, clamping and denoising are off. Mean: GI Engine's over Cycles'. Worst: the largest",
        f"difference of a block of {compare.BLOCK}×{compare.BLOCK} pixels in standard errors; the limit allows for the number of blocks, and for",
        f"rounding of {100 * TOLERANCE:g} % of a block in whole scenes, 0.3 % in small ones.",
    ]
    for group, title in (("shared", "Whole scenes"), ("small", "One feature each")):
        mine = [row for row in rows.values() if row["group"] == group]
        if not mine:
            continue
        agreeing = sum(
            "error" not in row and not row["failed"] and not row["invalid"] and row["ratio"] != 0 for row in mine
        )
        out += ["", f"## {title}: {agreeing} of {len(mine)} agree", "", "| | mean | worst | |", "|---|---|---|---|"]
        out += [line_of(row) for row in sorted(mine, key=lambda row: row["name"])]
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--only", choices=("small", "shared"))
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print("ROW " + json.dumps(one_shared(options.one, options.size, options.samples)), flush=True)
        return
    rows = json.loads(ROWS.read_text()) if ROWS.exists() else {}
    if options.only != "shared":
        rows |= small_rows(options.words)
    if options.only != "small":
        if shared.folder():
            rows |= shared_rows(options)
        else:
            print("the shared scenes are not here: their rows are left as they were")
    ROWS.parent.mkdir(exist_ok=True)
    ROWS.write_text(json.dumps(rows))
    PAGE.write_text(page(rows, options))


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
