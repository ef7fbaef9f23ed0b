"""Fits the table of lobes/sheen_table.h: linearly transformed cosines for a layer of upright fibres.

The layer is the one of [Zeltner et al. 2022]: unit thickness and density, no absorption, SGGX microflakes
[Heitz et al. 2015] of a fibre along the normal with cross section sigma = roughness². For a grid of view
cosines and roughnesses, a random walk gives the reflected fraction R and a histogram of where the light
leaves; A and B of the inverse transform ((A, 0, B), (0, A, 0), (0, 0, 1)) are the least-cubes fit to it.
Leaves out: absorption in the fibres, tilted fibres. Takes about ten minutes; run it only to change the model:

    python native/tools/fit_sheen.py > native/src/shading/lobes/sheen_table.h
"""

import sys

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.optimize import minimize

GRID = 32  # entries along the cosine and along the roughness, as Cycles interpolates
WALKS = 300_000
BINS = 32  # of the polar angle and of half the azimuth
MAX_BOUNCES = 16


def cosine_about(axis: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(N, 3) unit vectors, cosine-weighted about the unit vectors `axis` (N, 3)."""
    z = 1 - 2 * rng.random(len(axis))
    phi = 2 * np.pi * rng.random(len(axis))
    s = np.sqrt(np.maximum(1 - z * z, 0))
    v = axis + np.stack([s * np.cos(phi), s * np.sin(phi), z], axis=1)
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12)


def reflected(mu: float, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Directions (M, 3) in which M of WALKS photons leave the top of the layer, seen from cosine `mu`."""
    stretch = np.array([1.0, 1.0, sigma])  # square root of the SGGX matrix; projected area of w is |stretch w|
    direction = np.tile([-np.sqrt(1 - mu * mu), 0.0, -mu], (WALKS, 1))
    depth = np.zeros(WALKS)
    out = []
    for _ in range(MAX_BOUNCES):
        extinction = np.linalg.norm(direction * stretch, axis=1)
        depth -= np.log1p(-rng.random(len(depth))) / extinction * -direction[:, 2]
        out.append(direction[depth < 0])
        alive = (depth >= 0) & (depth <= 1)
        direction, depth = direction[alive], depth[alive]
        if not len(depth):
            return np.concatenate(out)
        # Visible normals of the flakes: those of the ellipsoid that the unit sphere is stretched to.
        view = -direction * stretch
        normal = cosine_about(view / np.linalg.norm(view, axis=1, keepdims=True), rng) * stretch
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        direction = direction - 2 * np.sum(direction * normal, axis=1, keepdims=True) * normal
    # What is still inside counts by the way it is heading, as in the published fit.
    return np.concatenate([*out, direction[direction[:, 2] > 0]])


def histogram(w: np.ndarray) -> np.ndarray:
    """(BINS, BINS) reflected radiance times cosine, per unit irradiance, over polar angle and half azimuth."""
    theta = np.arccos(np.clip(w[:, 2], 0, 1))
    phi = np.abs(np.arctan2(w[:, 1], w[:, 0]))
    n = np.histogram2d(theta, phi, bins=BINS, range=[[0, np.pi / 2], [0, np.pi]])[0]
    edges = np.cos(np.linspace(0, np.pi / 2, BINS + 1))
    return n / WALKS / ((edges[:-1] - edges[1:])[:, None] * (2 * np.pi / BINS))


def ltc(a: float, b: float) -> np.ndarray:
    """The linearly transformed cosine at the centres of the histogram's bins."""
    theta = ((np.arange(BINS) + 0.5) * np.pi / 2 / BINS)[:, None]
    phi = ((np.arange(BINS) + 0.5) * np.pi / BINS)[None, :]
    x, y, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
    squared = (a * x + b * z) ** 2 + (a * y) ** 2 + z * z
    return a * a * z / (np.pi * squared * squared)


def fit(data: np.ndarray, albedo: float, start: np.ndarray) -> np.ndarray:
    def cost(p):
        return np.sum(np.abs(albedo * ltc(*p) - data) ** 3) / max(albedo, 1e-9) ** 3

    best = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-7}).x
    return best if best[0] > 0 else -best  # (-A, -B) is the same distribution


def main() -> None:
    cosines = np.maximum(np.linspace(0, 1, GRID), 0.01)
    roughnesses = np.maximum(np.linspace(0, 1, GRID), 0.01)
    table = np.zeros((GRID, GRID, 3))  # roughness, cosine, (A, B, R)
    for j, mu in enumerate(cosines):
        start = np.array([1.0, 0.0])
        for i in range(GRID - 1, -1, -1):  # from rough to smooth, each fit starting from the last
            w = reflected(mu, roughnesses[i] ** 2, np.random.default_rng(1))
            table[i, j, 2] = len(w) / WALKS
            if len(w) > 2000:
                start = fit(histogram(w), table[i, j, 2], start)
            table[i, j, :2] = start
        print(j, "of", GRID, file=sys.stderr)
    for k in range(2):  # the noise of the walks; R needs no smoothing
        table[:, :, k] = gaussian_filter(table[:, :, k], 0.6, mode="nearest")
    write(table)


def write(table: np.ndarray) -> None:
    print("// Made by native/tools/fit_sheen.py; do not edit. Rows: roughness 0..1, columns: view cosine 0..1.")
    print("// A, B: inverse linear transform; R: albedo.\n// clang-format off")
    print("#pragma once\n\nnamespace gi {\n")
    print(f"inline constexpr int kSheenGrid = {GRID};")
    for k, name in enumerate(("A", "B", "R")):
        print(f"inline constexpr float kSheen{name}[{GRID}][{GRID}] = {{")
        for row in table[:, :, k]:
            print("    {" + ", ".join(f"{v:.5g}f" if v != int(v) else f"{v:.1f}f" for v in row) + "},")
        print("};")
    print("\n}  // namespace gi")


if __name__ == "__main__":
    main()
