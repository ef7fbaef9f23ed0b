"""Samples a second by the number of threads: what threads that add light to one film cost one another.

    python bench/threads.py [--pixels N] [--seconds S | --samples N] [--threads N …] [--ways ID …] [WORD …]

Scenes are files, or words in names of the shared scenes. With --samples whole renders of as many, with what ways work out before their
first. Prints a table. Best of three, since a thread can only be held up: a
machine that does other work meanwhile shows less than there is."""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
from pathlib import Path
from types import SimpleNamespace

from measure import prepare, scenes

ROUNDS = 3


def rate(session, seconds: float) -> float:
    """Passes a second, of a render that ends by itself or after so many seconds."""
    with session:
        while not session.wait() and session.progress()["seconds"] < seconds:
            pass
        session.native.cancel()
        while not session.native.wait(0.05):
            pass
        progress = session.progress()
    return progress["passes"] / progress["seconds"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--ways", nargs="+", default=["path", "bdpt", "light"])
    parser.add_argument("--threads", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--samples", type=int, help="of whole renders, however long they take")
    parser.add_argument("--pixels", type=int, default=20_000)
    options = parser.parse_args()
    import bpy

    import gi_engine
    from gi_engine import native
    from gi_engine.export import export
    from gi_engine.session import Session

    gi_engine.register()
    print("| scene | way | threads | samples/s | times one thread |")
    print("|---|---|---|---|---|")
    for file in [Path(w) for w in options.words if w.endswith(".blend")] or scenes(options.words):
        bpy.ops.wm.open_mainfile(filepath=str(file), load_ui=False, use_scripts=False)
        prepare(bpy.context.scene, SimpleNamespace(engine="GI_ENGINE", pixels=options.pixels, threads=1))
        for way in options.ways:
            found = export(bpy.context.evaluated_depsgraph_get(), native.integrators(), None, integrator=way)
            settings = dataclasses.replace(
                found.settings, samples=options.samples or 1 << 20, time_limit=0.0, noise_target=0.0
            )
            built = Session(found.scene, settings)
            first = None
            for threads in options.threads:
                some = [
                    rate(
                        built.again(dataclasses.replace(settings, threads=threads)),
                        math.inf if options.samples else options.seconds,
                    )
                    for _ in range(ROUNDS)
                ]
                speed = max(some)
                first = first or speed
                print(f"| {file.stem} | {way} | {threads} | {speed:.1f} | {speed / first:.2f} |", flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
