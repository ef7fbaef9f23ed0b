"""A layer of upright fibres, walked through at random: what the sheen's table was fitted to.

The layer is the one of [Zeltner et al. 2022]: unit thickness and density, no absorption, SGGX microflakes
[Heitz et al. 2015] of a fibre along the normal with cross section sigma = roughness².
"""

import numpy as np

WALKS = 300_000
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
