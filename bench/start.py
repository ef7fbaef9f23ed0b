"""From pressing F12 to the first pass on the largest scene, GI Engine and Cycles by turns, each in a fresh process.

    python bench/start.py [--rounds N] [WORD …]

Exits with 1 if GI Engine's median is later than Cycles'."""

from __future__ import annotations

import argparse
import statistics
import sys

from measure import in_child, scenes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*", default=["zeyu_grass"])
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    late = 0
    for path in scenes(options.words):
        seconds = {"CYCLES": [], "GI_ENGINE": []}
        for _ in range(options.rounds):
            for engine, found in seconds.items():
                one = in_child(path, engine, 40_000, 0.0, 2)
                if "error" in one:
                    print(f"{path.stem}: {engine}: {one['error']}")
                    return 1
                found.append(one["start"])
        cycles, ours = (statistics.median(found) for found in seconds.values())
        print(f"{path.stem}: one pass after {ours:.2f} s, Cycles {cycles:.2f} s", flush=True)
        late += ours > cycles
    return int(late > 0)


if __name__ == "__main__":
    sys.exit(main())
