"""Writes docs/parity-features.md: each feature's small scene, whether it agrees with Cycles. Whole scenes are `gi-engine parity`'s.

    python -m tests.parity.report [WORD …]

Rows are kept in build/parity.json; a run with words replaces the rows whose name has one of them."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

import bpy

from gi_engine.compare import summary

from . import suite
from .known import KNOWN

ROOT = Path(__file__).resolve().parents[2]
ROWS = ROOT / "build" / "parity.json"
PAGE = ROOT / "docs" / "parity-features.md"
ANY_MEAN = 1e9  # small scenes are judged by their blocks


def rows_of(name: str) -> dict[str, dict]:
    """One for the scene, or one for each tile of a sheet."""
    try:
        return {found.name: row_of(found) for found in suite.agreements(name)}
    except Exception as error:  # a row that says so is the point of the table
        return {name: {"name": name, "error": str(error).splitlines()[0]}}


def row_of(found) -> dict:
    return {
        "name": found.name,
        "mean_ratio": found.ratio,
        "mean_ratio_error": found.ratio_error,
        "worst_block": found.worst,
        "largest_beyond_noise": found.largest,
        "blocks_beyond_noise": found.failed,
        "blocks": found.blocks,
        "not_finite": found.invalid,
    }


def page(rows: dict) -> str:
    lines = [summary.line_of(row | {"note": KNOWN.get(row["name"])}, rounding=ANY_MEAN) for row in rows.values()]
    agreeing = sum(summary.verdict(row, ANY_MEAN)[0] == summary.AGREES for row in rows.values())
    return "\n".join(
        [
            "# Feature by feature against Cycles",
            "",
            f"Written by `python -m tests.parity.report`, Blender {bpy.app.version_string}. Both engines render in one process, twice each with",
            "different seeds; filters that bias, adaptive sampling, clamping and denoising are off. Mean: GI Engine's over Cycles'. Worst: the largest",
            "difference of a block of 8×8 pixels in standard errors; the limit allows for the number of blocks, and for rounding of 0.3 % of a block.",
            "The same cases are tests (tests/parity). Whole scenes: [parity.md](parity.md); nodes: [parity-nodes.md](parity-nodes.md).",
            "",
            f"{agreeing} of {len(rows)} agree.",
            "",
            "| | mean | worst | |",
            "|---|---|---|---|",
            *sorted(lines),
        ]
    ) + "\n"  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    words = parser.parse_args().words
    rows = json.loads(ROWS.read_text()) if ROWS.exists() else {}
    for name in suite.CASES:
        if not words or any(word in name for word in words):
            rows |= rows_of(name)
            print(name, flush=True)
    ROWS.parent.mkdir(exist_ok=True)
    ROWS.write_text(json.dumps(rows))
    PAGE.write_text(page(rows))


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
