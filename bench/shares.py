"""Where the time of path tracing goes, scene by scene: the share of the render threads' time in Embree, in shading, in sampling.

    python bench/shares.py [--seconds S] [--pixels N] [WORD …]

Needs Linux' perf, and the native package with its symbols (CMake's own build keeps them, a wheel drops them). Writes
bench/results/shares.md. Functions that the compiler has put into others count as these."""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import measure

RESULTS = measure.ROOT / "bench" / "results" / "shares.md"
THREADS = "gi-render"  # the name of the native render threads

# The first that matches (library, function) decides.
GROUPS = {
    "Embree": (r"embree", r""),
    "light sampling": (r"_core", r"Light|light_importance|Distribution|sample_around|triangle_light"),
    "camera, film, random numbers": (r"_core", r"for_each_pixel|Camera|Film|Sampler|ThreadPool"),
    "paths": (r"_core", r"Integrator::trace|transmittance|EmbreeAccel"),
    "geometry": (
        r"_core",
        r"Scene::(surface_point|shading_point|triangle_vertices|interpolate|attribute|shadow|corner|uv_)",
    ),
    "images": (r"_core", r"ImageSet|image"),
    "shading": (r"_core|libm\.so|libc\.so", r""),
    "other": (r"", r""),
}


def group_of(library: str, function: str) -> str:
    return next(name for name, (lib, fn) in GROUPS.items() if re.search(lib, library) and re.search(fn, function))


def shares(path: Path, options) -> dict[str, float]:
    """Group -> share of the render threads' time."""
    command = [sys.executable, measure.__file__, str(path), "GI_ENGINE"]
    command += ["--pixels", str(options.pixels), "--seconds", str(options.seconds)]
    with tempfile.TemporaryDirectory() as folder:
        data = str(Path(folder) / "perf.data")
        subprocess.run(
            ["perf", "record", "-q", "-F", "499", "-o", data, "--", *command], check=True, capture_output=True
        )
        report = ["perf", "report", "-i", data, "--stdio", "--comms", THREADS, "--sort", "dso,sym", "-t", ";"]
        lines = subprocess.run(report, check=True, capture_output=True, text=True).stdout.splitlines()
    found = dict.fromkeys(GROUPS, 0.0)
    for line in lines:
        match = re.match(r"\s*([\d.]+)%\s*;\s*([^;]*?)\s*;(.*)", line)
        if match:
            found[group_of(match[2], match[3])] += float(match[1])
    total = sum(found.values())
    return {name: share / total for name, share in found.items()} if total else found


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--pixels", type=int, default=40_000)
    options = parser.parse_args()
    if not shutil.which("perf"):
        sys.exit("this needs Linux' perf")
    table = [f"| scene | {' | '.join(GROUPS)} |", "|---" * (len(GROUPS) + 1) + "|"]
    for path in measure.scenes(options.words):
        found = shares(path, options)
        table.append(f"| {path.stem} | " + " | ".join(f"{100 * found[name]:.0f} %" for name in GROUPS) + " |")
        print(table[-1], flush=True)
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(
        "# Where path tracing spends its time\n\nShares of the render threads' time.\n\n" + "\n".join(table) + "\n"
    )


if __name__ == "__main__":
    main()
