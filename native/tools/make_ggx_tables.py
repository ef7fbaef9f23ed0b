"""Writes native/src/shading/lobes/ggx_tables.inc: albedos of GGX microfacets that follow one bounce only.

Integrates over visible normals by a Sobol sequence; runs once, by hand (about a minute), never in the build. The grids are those
of Blender's own tables, so that materials lose and regain the same energy.
"""

from pathlib import Path

import numpy as np
from scipy.stats import qmc

ROUGHNESS_MIN, COSINE_MIN = 1e-4, 1e-4


def visible_normals(alpha, wo, u):
    """GGX normals visible from each wo, (n, 3). [Dupuy & Benyoub 2023]"""
    v = wo * [alpha, alpha, 1.0]
    v /= np.linalg.norm(v, axis=-1, keepdims=True)
    phi, z = 2 * np.pi * u[:, 0], (1 - u[:, 1]) * (1 + v[:, 2]) - v[:, 2]
    s = np.sqrt(np.maximum(1 - z * z, 0))
    h = np.stack([s * np.cos(phi), s * np.sin(phi), z], -1) + v
    h *= [alpha, alpha, 1.0]
    return h / np.linalg.norm(h, axis=-1, keepdims=True)


def smith_lambda(alpha, z):
    return 0.5 * (np.sqrt(1 + alpha**2 * np.maximum(1 / z**2 - 1, 0)) - 1)


def fresnel(c, eta):
    """(reflectance, cosine of refraction) of a dielectric."""
    t2 = 1 - (1 - c * c) / eta**2
    t = np.sqrt(np.maximum(t2, 0))
    s, p = (c - eta * t) / (c + eta * t), (t - eta * c) / (t + eta * c)
    return np.where(t2 > 0, 0.5 * (s * s + p * p), 1.0), t


class View:
    """Samples for one roughness and one cosine (or one a sample)."""

    def __init__(self, roughness, mu, u):
        self.alpha = max(roughness, ROUGHNESS_MIN) ** 2
        self.mu = np.maximum(np.broadcast_to(mu, len(u)), COSINE_MIN)
        wo = np.stack([np.sqrt(1 - self.mu**2), 0 * self.mu, self.mu], -1)
        h = visible_normals(self.alpha, wo, u)
        self.c, self.hz = (wo * h).sum(-1), h[:, 2]
        self.reflected_z = 2 * self.c * self.hz - self.mu

    def shadowing(self, z):
        """G2/G1 of the directions with these (absolute) cosines."""
        a = smith_lambda(self.alpha, self.mu)
        return (1 + a) / (1 + a + smith_lambda(self.alpha, np.maximum(z, 1e-9)))

    def reflection(self):
        return np.where(self.reflected_z > 0, self.shadowing(self.reflected_z), 0)

    def glass(self, eta):
        """Light bent out of the surface on the wrong side is counted as kept, as Blender does: from inside and at grazing angles it is
        most of all, and what is left would be scaled up without bound."""
        if abs(eta - 1) < 1e-4:
            return np.ones_like(self.mu)
        f, t = fresnel(self.c, eta)
        z = (self.c / eta - t) * self.hz - self.mu / eta
        return f * self.reflection() + (1 - f) * self.shadowing(np.abs(z))

    def weight(self, curve):
        return np.where(self.reflected_z > 0, curve(self.c), 0)


def grid(n):
    return np.linspace(0, 1, n)


def index(z):
    f0 = min(max(z, 1e-4), 0.99) ** 4
    return (1 + np.sqrt(f0)) / (1 - np.sqrt(f0))


def schlick_curve(z):
    z = min(max(z, 1e-4), 0.99)
    return lambda c: (1 - np.minimum(c, 1)) ** (5 * (1 - z) / z)


def dielectric_curve(eta):
    lowest = ((eta - 1) / (eta + 1)) ** 2
    return lambda c: np.clip((fresnel(c, eta)[0] - lowest) / (1 - lowest), 0, 1)


def tables(u2, u3):
    g, mu = grid(16), u3[:, 2]
    many, few = [[View(r, m, u2) for r in grid(32)] for m in grid(32)], [[View(r, m, u2[:8192]) for r in g] for m in g]
    mean = [View(r, mu, u3[:, :2]) for r in grid(32)]
    mean_few = [View(r, mu, u3[:, :2]) for r in g]
    yield "kGgxE", [v.reflection().mean() for row in many for v in row]
    yield "kGgxEMean", [(2 * mu * v.reflection()).mean() for v in mean]
    for name, eta in [("kGgxGlassIn", index), ("kGgxGlassOut", lambda z: 1 / index(z))]:
        yield name + "E", [v.glass(eta(z)).mean() for z in g for row in few for v in row]
        yield name + "EMean", [(2 * mu * v.glass(eta(z))).mean() for z in g for v in mean_few]
    yield "kGgxDielectric", [v.weight(dielectric_curve(index(z))).mean() for z in g for row in few for v in row]
    yield "kGgxSchlick", [v.weight(schlick_curve(z)).mean() for z in g for row in few for v in row]


def main():
    u2 = qmc.Sobol(2, seed=1).random_base2(14)
    u3 = qmc.Sobol(3, seed=1).random_base2(15)
    lines = [
        "// Written by native/tools/make_ggx_tables.py. Fractions of one, as unsigned 16-bit numbers.",
        "// clang-format off",
    ]
    for name, values in tables(u2, u3):
        numbers = [str(round(65535 * min(max(v, 0), 1))) for v in values]
        lines.append(f"constexpr uint16_t {name}[{len(numbers)}] = {{")
        lines += [", ".join(numbers[i : i + 32]) + "," for i in range(0, len(numbers), 32)]
        lines.append("};")
    path = Path(__file__).parents[1] / "src/shading/lobes/ggx_tables.inc"
    path.write_text("\n".join(lines + ["// clang-format on", ""]))


if __name__ == "__main__":
    main()
