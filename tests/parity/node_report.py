"""Writes docs/parity-nodes.md: every shader node of Blender's RNA, and how its rows (node_rows.py) compare with Cycles.

    python -m tests.parity.node_report [WORD …]

Rows are kept in build/parity_nodes.json by Blender's version; a run replaces those of nodes whose name has one of the words. The page
shows all versions that have been run."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import defaultdict
from dataclasses import asdict
from pathlib import Path

import bpy

from . import node_rows, node_suite
from .known_nodes import CYCLES_OWN

ROOT = Path(__file__).resolve().parents[2]
ROWS = ROOT / "build" / "parity_nodes.json"
PAGE = ROOT / "docs" / "parity-nodes.md"
AGREES, DIFFERS, FALLBACK = "agrees", "differs", "fallback"
# Nodes without rows: what they are instead. A node that is neither here nor has rows is missing.
ZONES = "flattened by Blender: tests/nodes/test_zones.py"
WITHOUT_ROWS = {
    "FunctionNodeInputMenu": ZONES,
    "GeometryNodeRepeatOutput": ZONES,
    "NodeClosureInput": ZONES,
    "NodeClosureOutput": ZONES,
    "NodeCombineBundle": ZONES,
    "NodeEvaluateClosure": ZONES,
    "NodeJoinBundle": ZONES,
    "NodeSeparateBundle": ZONES,
    "ShaderNodeOutputAOV": "output: tests/addon/test_aovs.py",
    "ShaderNodeOutputMaterial": "output: every row goes through it",
    "ShaderNodeOutputWorld": "output: tests/parity/cases_lights.py",
    "ShaderNodeOutputLight": "output: tests/parity/cases_lights.py",
    "ShaderNodeOutputLineStyle": "Freestyle's alone",
    "ShaderNodeScript": "unsupported: Open Shading Language needs its compiler",
}


def label_of(idname: str) -> str:
    return getattr(bpy.types, idname).bl_rna.name


def gather(words: list[str]) -> dict:
    kinds = [kind for kind in node_rows.kinds() if not words or any(word in kind for word in words)]
    rows = [row for kind in kinds for row in node_rows.rows_of(kind)]
    found = {kind: {"label": label_of(kind), "rows": []} for kind in kinds}
    for result in node_suite.results(rows):
        found[result.idname]["rows"].append(asdict(result))
    return found


# -------------------------------------------------------------------- the page


def state_of(idname: str, entry: dict | None) -> str:
    if entry is None:
        return "–"
    rows = [row for row in entry["rows"] if row["state"] != "unavailable"]
    if not rows:
        return WITHOUT_ROWS.get(idname, "**missing**")
    counts = {state: sum(row["state"] == state for row in rows) for state in (AGREES, DIFFERS, FALLBACK)}
    if counts[AGREES] == len(rows):
        return f"exact: {len(rows)} rows"
    if counts[FALLBACK]:
        return f"**approximated** in {counts[FALLBACK]} of {len(rows)} rows"
    return f"**differs** in {counts[DIFFERS]} of {len(rows)} rows"


def off(entry: dict | None) -> str:
    """The part of the pixels of all rows that are compared by pixels which are off by more than the tolerance."""
    rows = [row for row in (entry or {"rows": []})["rows"] if row["pixels"] and row["state"] in (AGREES, DIFFERS)]
    return f"{100 * sum(row['wrong'] for row in rows) / len(rows):.2f} %" if rows else ""


def page(kept: dict) -> str:
    versions = sorted(kept, reverse=True)
    kinds = sorted({kind for found in kept.values() for kind in found}, key=str.lower)
    states = {kind: [state_of(kind, kept[v].get(kind)) for v in versions] for kind in kinds}
    exact = [sum(states[k][i].startswith("exact") for k in kinds) for i in range(len(versions))]
    out = [
        "# Shader nodes against Cycles",
        "",
        "Written by `python -m tests.parity.node_report`: the nodes, their modes and their inputs come from Blender's RNA. Values are the",
        f"emission of a bent patch, one sample a pixel, and agree where pixels are within {node_suite.TOLERANCE:g} (relative above 1) but for",
        f"{node_suite.FEW_PIXELS} of 576, where jumps and cusps fall between the rays of both engines, which are jittered by a hundredth of a pixel; a row where",
        f"more are off is rendered by {len(node_suite.SEEDS)} seeds, and a pixel is off where all values of one engine are above all of the other's. *off* is the part",
        "of such pixels over all rows of a node. Closures are balls under a lamp and a sky and agree where every block of 8×8 pixels does",
        "(z-test). *Approximated*: a warning says what is rendered instead.",
        "",
        ", ".join(f"Blender {v}: {n} nodes exact" for v, n in zip(versions, exact, strict=True)) + ".",
        "",
        f"| node | {' | '.join(f'{v} | off' for v in versions)} |",
        f"|---|{'---|---|' * len(versions)}",
    ]
    for kind in kinds:
        label = next(found[kind]["label"] for found in kept.values() if kind in found)
        cells = " | ".join(f"{s} | {off(kept[v].get(kind))}" for s, v in zip(states[kind], versions, strict=True))
        out.append(f"| {label} | {cells} |")
    out += ["", "## What is not exact", ""]
    out += failures(kept, versions) or ["Nothing."]
    return "\n".join(out) + "\n"


def failures(kept: dict, versions: list[str]) -> list[str]:
    """Approximations by what their warning says, and every row that differs."""
    lines = []
    for version in versions:
        said = defaultdict(set)
        for kind, entry in kept[version].items():
            for row in entry["rows"]:
                if row["state"] == FALLBACK:
                    said[row["warnings"][0].split("): ")[-1].split("' ")[-1]].add(entry["label"])
                elif row["state"] == DIFFERS:
                    unit = "of the pixels" if row["pixels"] else "of the blocks"
                    reason = next(
                        (f". {why}" for (k, part), why in CYCLES_OWN.items() if k == kind and part in row["name"]), ""
                    )
                    lines.append(
                        f"- {version}, {entry['label']}: {row['name']}: {100 * row['wrong']:.1f} % {unit}{reason}"
                    )
        lines += [f"- {version}, {', '.join(sorted(labels))}: {text}" for text, labels in sorted(said.items())]
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    options = parser.parse_args()
    kept = json.loads(ROWS.read_text()) if ROWS.exists() else {}
    version = ".".join(str(part) for part in bpy.app.version[:2])
    if not options.words:
        kept.pop(version, None)
    kept.setdefault(version, {}).update(gather(options.words))
    ROWS.parent.mkdir(exist_ok=True)
    ROWS.write_text(json.dumps(kept))
    PAGE.write_text(page(kept))


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
