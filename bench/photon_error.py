"""Bias of photon maps against bidirectional path tracing, by neighbours and by radius; draws docs/images.

    python bench/photon_error.py [--file BLEND] [--pixels N] [--reference S]

The measure is the relative root mean square over blocks of 8 x 8 pixels, a product of differences of two pictures to two references, all of
them independent: so no noise is left in it, and it is what more passes by photons of the same number or radius do not mend."""

from __future__ import annotations

import argparse
import os

from irradiance_error import draw, open_scene, picture
from measure import ROOT

NEIGHBOURS, PHOTONS = (10, 30, 100, 300, 1000), (10_000, 100_000, 1_000_000)
RADII = (1.5, 3, 6, 12, 24)  # pixels
PASSES = (16,)
IMAGES = ROOT / "docs" / "images"


def bias(found, references) -> float:
    a, b = references
    mean = (a + b) / 2
    square = ((found[0] - a) * (found[1] - b)).mean(1) / (mean.mean(1) ** 2 + (0.1 * mean.mean()) ** 2)
    return float(max(square.mean(), 0.0) ** 0.5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--file", default=str(ROOT / "examples" / "jensen_box.blend"))
    parser.add_argument("--pixels", type=int, default=20_000)
    parser.add_argument("--reference", type=float, default=60.0, help="seconds of each of two")
    options = parser.parse_args()
    scene = open_scene(options)
    references = [picture(scene, "bdpt", seed, seconds=options.reference)[0] for seed in (101, 102)]

    def measured(integrator, passes, **parameters) -> float:
        return bias([picture(scene, integrator, seed, passes, **parameters)[0] for seed in (1, 2)], references)

    by_count, by_radius = {}, {}
    for photons in PHOTONS:
        for count in NEIGHBOURS:
            sent = {"global_photons": photons, "caustic_photons": photons, "global_light": "PHOTONS"}
            far = {"global_count": count, "caustic_count": count, "radius": 1000}
            by_count[count, photons] = measured("photon_map", 8, **sent, **far)
            print(f"{photons:9,} photons, {count:4} neighbours {100 * by_count[count, photons]:.2f} %", flush=True)
    for radius in RADII:
        by_radius[radius, PASSES[0]] = measured("sppm", PASSES[0], photons=100_000, radius=radius, alpha=1.0)
        print(f"radius {radius:4} pixels {100 * by_radius[radius, PASSES[0]]:.2f} %", flush=True)
    counts = draw(by_count, NEIGHBOURS, PHOTONS, "Neighbours (k), maps read directly", "photons")
    (IMAGES / "photon_map_neighbours.svg").write_text(counts, encoding="utf-8")
    radii = draw(by_radius, RADII, PASSES, "Radius in pixels, the same in all passes", "passes")
    (IMAGES / "photon_map_radius.svg").write_text(radii, encoding="utf-8")
    os._exit(0)  # Blender's module can hang at exit


if __name__ == "__main__":
    main()
