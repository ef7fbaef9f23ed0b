"""A chi² test of direction samplers against the densities they claim, over bins of (cos θ, φ) on the whole sphere.

After Wenzel Jakob's test in Nori and Mitsuba: the density is integrated numerically in each bin; bins expected to hold too few
samples are pooled; directions that could not be drawn are a bin of their own.
"""

import functools

import numpy as np
from scipy import stats

SIGNIFICANCE = 0.01
COS_BINS, PHI_BINS = 24, 36
LEAST_EXPECTED = 5.0


def directions(cos_theta, phi):
    s = np.sqrt(np.maximum(1 - cos_theta**2, 0))
    return np.ascontiguousarray(np.stack([s * np.cos(phi), s * np.sin(phi), cos_theta], -1), np.float32)


def gauss_points(edges, order):
    """Gauss–Legendre points and weights in each interval between `edges`: (intervals, order) both."""
    x, w = np.polynomial.legendre.leggauss(order)
    half = np.diff(edges)[:, None] / 2
    return edges[:-1, None] + half * (1 + x), half * w


@functools.cache
def quadrature(order):
    """Directions and weights, bin by bin, `order` points each way. Over θ, not cos θ: narrow lobes near a pole need it."""
    theta, w_theta = gauss_points(np.arccos(np.linspace(1, -1, COS_BINS + 1)), order)
    phi, w_phi = gauss_points(np.linspace(0, 2 * np.pi, PHI_BINS + 1), order)
    t, p = np.meshgrid(theta[::-1].ravel(), phi.ravel(), indexing="ij")
    return directions(np.cos(t).ravel(), p.ravel()), (np.sin(t) * np.outer(w_theta[::-1], w_phi)).ravel()


def integrate_bins(pdf, order):
    """∫ pdf dω over each bin: (COS_BINS, PHI_BINS)."""
    wi, weights = quadrature(order)
    values = np.asarray(pdf(wi), np.float64) * weights
    return values.reshape(COS_BINS, order, PHI_BINS, order).sum((1, 3))


def count_bins(wi):
    c = np.clip(((wi[:, 2] + 1) / 2 * COS_BINS).astype(int), 0, COS_BINS - 1)
    phi = np.mod(np.arctan2(wi[:, 1], wi[:, 0]), 2 * np.pi)
    p = np.clip((phi / (2 * np.pi) * PHI_BINS).astype(int), 0, PHI_BINS - 1)
    return np.bincount(c * PHI_BINS + p, minlength=COS_BINS * PHI_BINS)


def p_value(sample, pdf, samples=100_000, seed=1, order=24):
    """`sample(u)` takes (n, 3) numbers and returns (m, 3) unit directions, m ≤ n; `pdf(wi)` is per steradian."""
    u = np.random.default_rng(seed).random((samples, 3), np.float32)
    wi = np.asarray(sample(u))
    observed = np.append(count_bins(wi), samples - len(wi)).astype(float)
    mass = integrate_bins(pdf, order).ravel()
    assert mass.sum() < 1.01, f"the density integrates to {mass.sum():.4f}"
    expected = np.append(mass, max(1 - mass.sum(), 0)) * samples

    few = expected < LEAST_EXPECTED
    observed = np.append(observed[~few], observed[few].sum())
    expected = np.append(expected[~few], expected[few].sum())
    if expected[-1] < LEAST_EXPECTED:  # too few even when pooled: they join the smallest bin
        k = expected[:-1].argmin()
        observed[k] += observed[-1]
        expected[k] += expected[-1]
        observed, expected = observed[:-1], expected[:-1]
    statistic = ((observed - expected) ** 2 / expected).sum()
    return stats.chi2.sf(statistic, len(expected) - 1)


def assert_matches(sample, pdf, tests=1, **options):
    """Fails at SIGNIFICANCE shared by `tests` tests. [Šidák 1967]"""
    p = p_value(sample, pdf, **options)
    threshold = 1 - (1 - SIGNIFICANCE) ** (1 / tests)
    assert p >= threshold, f"samples do not follow the density: p = {p:.2e} < {threshold:.2e}"
