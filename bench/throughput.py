"""Samples per second of path tracing, GI Engine's over Cycles', and peak memory over Blender's own, scene by scene.

    python bench/throughput.py [--rounds N] [--seconds S] [--pixels N] [--threads N] [WORD …]

Engines take turns, each time in a fresh process; medians over the rounds. Writes bench/results/throughput.json and .md.
A scene is simple where it has no textures and no Principled BSDF: there the aim is 2, elsewhere 1.5."""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path

from measure import ROOT, in_child, scenes

ENGINES = ("CYCLES", "GI_ENGINE")
SIMPLE = ("cuteday_cornell-box", "cuteday_veach-mis", "jensen_box", "cornell")
RESULTS = ROOT / "bench" / "results"


def row_of(path: Path, options) -> dict:
    found = {engine: [] for engine in ENGINES}
    for _ in range(options.rounds):
        for engine in ENGINES:
            one = in_child(path, engine, options.pixels, options.seconds, options.threads)
            if "error" in one:
                return {"scene": path.stem, "error": f"{engine}: {one['error']}"}
            found[engine].append(one)
    medians = {
        e: {key: statistics.median(o[key] for o in found[e]) for key in ("start", "rate", "memory")} for e in ENGINES
    }
    cycles, ours = medians["CYCLES"], medians["GI_ENGINE"]
    goal = 2.0 if path.stem in SIMPLE else 1.5
    return {"scene": path.stem, "goal": goal, "ratio": ours["rate"] / cycles["rate"], "engines": medians}


def line_of(row: dict) -> str:
    if "error" in row:
        return f"| {row['scene']} | – | – | – | – | {row['error']} |"
    cycles, ours = (row["engines"][e] for e in ENGINES)
    verdict = "" if row["ratio"] >= row["goal"] else f"below {row['goal']:g}"
    return (
        f"| {row['scene']} | **{row['ratio']:.2f}** | {ours['rate']:.1f} / {cycles['rate']:.1f} | "
        f"{ours['start']:.2f} / {cycles['start']:.2f} | {ours['memory']:.0f} / {cycles['memory']:.0f} | {verdict} |"
    )


def write(rows: list[dict], options) -> str:
    reached = sum(row.get("ratio", 0) >= row.get("goal", 1) for row in rows)
    text = (
        f"# Path tracing, GI Engine / Cycles\n\n{options.threads} threads, {options.pixels} pixels, medians of {options.rounds} rounds;"
        f" {reached} of {len(rows)} reach their goal.\n\n"
        "| scene | ratio | samples/s | one sample, s | memory, MB | |\n|---|---|---|---|---|---|\n"
        + "\n".join(map(line_of, rows))
        + "\n"
    )
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "throughput.json").write_text(json.dumps(rows, indent=1) + "\n")
    (RESULTS / "throughput.md").write_text(text)
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--pixels", type=int, default=40_000)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    rows = []
    for path in scenes(options.words):
        rows.append(row_of(path, options))
        print(line_of(rows[-1]), flush=True)
        write(rows, options)


if __name__ == "__main__":
    main()
