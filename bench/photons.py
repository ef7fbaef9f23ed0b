"""What photons cost: sending them out and storing them, finding them, keeping them.

    python bench/photons.py [--threads N]

Writes bench/results/photons.md. Sending is measured in the Cornell box (examples/cornell.blend), and in one with a glass and a mirror ball
(examples/jensen_box.blend)."""

import argparse
import os
import time
from pathlib import Path

import bpy
import numpy as np

import gi_engine
from gi_engine import native
from gi_engine.engine import export
from gi_engine.session import Session

ROOT = Path(__file__).resolve().parent.parent
RESULT = ROOT / "bench" / "results" / "photons.md"
SCENES = "cornell", "jensen_box"
ROUNDS = 7
PATHS = 540_000  # which leave about a million photons


def exported(name: str):
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "examples" / f"{name}.blend"), load_ui=False)
    scene = bpy.context.scene
    scene.render.engine = "GI_ENGINE"
    depsgraph = bpy.context.evaluated_depsgraph_get()
    return export(depsgraph, native.integrators(), None, (8, 8))


def sent(name: str, threads: int, count: int) -> dict:
    """Figures of a map of all photons that `count` light paths leave, as final gathering reads it; the median run."""
    sending = exported(name)
    settings = sending.settings
    settings.integrator, settings.samples, settings.threads = "photon_map", 1, threads
    settings.parameters = {"global_photons": count, "caustic_photons": 1, "global_light": "GATHERED"}
    runs = []
    for _ in range(ROUNDS):
        with Session(sending.scene, settings) as session:
            while not session.wait():
                pass
            runs.append(session.native.figures())
    return sorted(runs, key=lambda f: f["photon seconds"])[ROUNDS // 2]


def found(count: int, neighbours: int) -> tuple[float, float]:
    """Seconds of building a tree of points on planes, microseconds of a query."""
    rng = np.random.default_rng(1)
    points = rng.random((count, 3)).astype(np.float32)
    points[np.arange(count), rng.integers(0, 3, count)] = 0
    start = time.perf_counter()
    tree = native.module().TestPoints(points, 1)
    built = time.perf_counter() - start
    places = points[np.lexsort(np.floor(points * 64).astype(int).T)][:: count // 50_000]
    start = time.perf_counter()
    tree.nearest(places, neighbours)
    return built, (time.perf_counter() - start) / len(places) * 1e6


def row(name: str, figures: dict) -> str:
    photons = figures["global photons"]
    whole, traced, settled = (figures[f"photon {part}seconds"] * 1e6 / photons for part in ("", "tracing ", "tree "))
    return f"| {name} | {traced:.2f} | {settled:.2f} | {whole - traced - settled:.2f} | {whole:.2f} | {figures['photon bytes'] / photons:.1f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    gi_engine.register()
    built, query = sorted(found(1_000_000, 50) for _ in range(ROUNDS))[ROUNDS // 2]
    lines = [
        f"# Photons\n\nOf a million photons, with {options.threads} thread (of {PATHS:,} light paths, about as many):\n"
    ]
    lines += [
        "| scene | sent and stored, s | made a tree of, s | aimed, s | in all, s | bytes a photon |",
        "|" + "---|" * 6,
    ]
    lines += [row(name, sent(name, options.threads, PATHS)) for name in SCENES]
    lines += [
        f"\n- a tree of 1,000,000 points: {built:.2f} s; the nearest 50: {query:.1f} us",
    ]
    RESULT.write_text("\n".join(lines) + "\n")
    print(*lines, sep="\n", flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
