"""What a sample costs by each way: processor time of a pass over path tracing's, light that comes directly and after one bounce.

    python bench/cost.py [--pixels N] [--ways ID …] [WORD …]

Words are in names of the shared scenes. Prints a table; medians of seven rounds in which the ways take turns."""

from __future__ import annotations

import argparse
import dataclasses
import os
import statistics
import time
from types import SimpleNamespace

from measure import prepare, scenes

ROUNDS, PASSES = 7, 6


def cost(session) -> float:
    """Processor seconds a pass."""
    with session:
        start = time.process_time()
        while not session.wait():
            pass
        return (time.process_time() - start) / PASSES


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*", default=["cornell-box", "veach-mis", "veach-bidir", "staircase"])
    parser.add_argument("--ways", nargs="+", default=["bdpt"])
    parser.add_argument("--pixels", type=int, default=40_000)
    options = parser.parse_args()
    import bpy

    import gi_engine
    from gi_engine import native
    from gi_engine.export import export
    from gi_engine.session import Session

    gi_engine.register()
    ways = ["path", *options.ways]
    print(f"| scene | bounces | path, ms | {' | '.join(f'{way} / path' for way in options.ways)} |")
    print("|---" * (3 + len(options.ways)) + "|")
    for file in scenes(options.words):
        bpy.ops.wm.open_mainfile(filepath=str(file), load_ui=False, use_scripts=False)
        prepare(bpy.context.scene, SimpleNamespace(engine="GI_ENGINE", pixels=options.pixels, threads=1))
        for bounces in (0, 1):
            built = []
            for way in ways:
                found = export(bpy.context.evaluated_depsgraph_get(), native.integrators(), None, integrator=way)
                parameters = {**found.settings.parameters, "max_bounces": bounces}
                settings = dataclasses.replace(
                    found.settings, samples=PASSES, threads=1, time_limit=0.0, noise_target=0.0, parameters=parameters
                )
                built.append((Session(found.scene, settings), settings))
            rounds = [[cost(session.again(settings)) for session, settings in built] for _ in range(ROUNDS)]
            ratios = [statistics.median(r[k] / r[0] for r in rounds) for k in range(1, len(ways))]
            base = statistics.median(r[0] for r in rounds)
            cells = " | ".join(f"{ratio:.2f}" for ratio in ratios)
            print(f"| {file.stem} | {bounces} | {base * 1e3:.1f} | {cells} |", flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
