"""How far a picture is off its reference: figures, and which of it is noise and which is not. Arrays only."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

BLOCK = 8  # pixels
OUTLIERS = 0.001  # of the pixels, the worst, that the relative error leaves out
FALSE_ALARM = 1e-5  # probability that a picture that is right is said not to be
DARKEST = 0.1  # of the mean: darker pixels and blocks count as if they were this bright
ROUNDING = 0.01  # of a block, that is no difference


def relative_errors(image: np.ndarray, other: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """By pixel: (x − r)(y − r) / (r² + (mean r / 10)²); with y = x the relative squared error."""
    floor = (DARKEST * float(reference.mean(dtype=np.float64))) ** 2 + 1e-20
    return ((image - reference) * (other - reference) / (reference**2 + floor)).mean(-1).astype(np.float64)


def relative_mse(image: np.ndarray, reference: np.ndarray) -> float:
    """Of all pixels but the worst thousandth."""
    errors = np.sort(relative_errors(image, image, reference), axis=None)
    return float(errors[: math.ceil((1 - OUTLIERS) * errors.size)].mean())


def systematic_mse(image: np.ndarray, other: np.ndarray, reference: np.ndarray, reference_variance=0.0) -> float:
    """What of the relative error two pictures by different seeds have in common, less the reference's own noise: bias. May come out a
    little below 0."""
    worst = np.maximum(relative_errors(image, image, reference), relative_errors(other, other, reference))
    kept = worst <= np.quantile(worst, 1 - OUTLIERS)
    return float(relative_errors(image, other, reference)[kept].mean()) - own_noise(reference, reference_variance, kept)


def own_noise(reference: np.ndarray, variance, kept=...) -> float:
    """Relative mean squared error of the reference itself, of the pixels `kept`."""
    noise = np.sqrt(np.broadcast_to(variance, reference.shape))
    return float(relative_errors(reference + noise, reference + noise, reference)[kept].mean())


def of_two(image: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of two pictures by different seeds, and the variance of each pixel of it, with one degree of freedom."""
    image, other = np.asarray(image, np.float64), np.asarray(other, np.float64)
    return (image + other) / 2, (image - other) ** 2 / 4


def blocks_of(pixels: np.ndarray) -> np.ndarray:
    """(rows, columns, channels) sums over blocks; blocks at the right and lower edge may be partial."""
    rows, columns = range(0, pixels.shape[0], BLOCK), range(0, pixels.shape[1], BLOCK)
    return np.add.reduceat(np.add.reduceat(pixels.astype(np.float64), rows, 0), columns, 1)


def allowed_errors(freedom: np.ndarray) -> np.ndarray:
    """Standard errors that each of these sums may be off: quantiles of Student's t, corrected for the number of sums
    [Abramowitz & Stegun 1964, 26.7.5]."""
    z = NormalDist().inv_cdf(1 - FALSE_ALARM / (2 * max(freedom.size, 1)))
    terms = ((z**3 + z) / 4, (5 * z**5 + 16 * z**3 + 3 * z) / 96, (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384)
    return z + sum(term / freedom**power for power, term in enumerate(terms, 1))


@dataclass
class Blocks:
    relative: np.ndarray  # (rows, columns) signed error of each block over the reference's
    beyond: np.ndarray  # (rows, columns) where that is no noise, in any channel
    worst: float  # the largest error in standard errors

    def figures(self) -> dict:
        found = self.relative[self.beyond]
        return {
            "blocks": self.relative.size,
            "blocks_beyond_noise": int(self.beyond.sum()),
            "worst_block": self.worst,
            "largest_beyond_noise": float(found[np.abs(found).argmax()]) if found.size else 0.0,
        }


def block_errors(
    mean: np.ndarray, variance: np.ndarray, reference: np.ndarray, reference_variance, rounding: float = ROUNDING
) -> Blocks:
    """`variance`: of each pixel of `mean`; pixels are taken as independent, with a degree of freedom each. `rounding`: share of a block that
    is no difference."""
    truth = blocks_of(reference)
    difference = blocks_of(mean) - truth
    error = np.sqrt(blocks_of(variance) + blocks_of(np.broadcast_to(reference_variance, reference.shape)))
    allowed = allowed_errors(blocks_of(np.ones(reference.shape)))
    # An absolute part, for blocks that are black in one by 1e-7 and in the other exactly.
    tolerance = rounding * np.abs(truth) + 1e-6 * BLOCK * BLOCK
    brightness = np.abs(truth.sum(-1))
    return Blocks(
        relative=difference.sum(-1) / (brightness + DARKEST * float(brightness.mean()) + 1e-20),
        beyond=(np.abs(difference) > allowed * error + tolerance).any(-1),
        worst=float((np.abs(difference) / np.maximum(error, tolerance)).max()),
    )


def mean_ratio(
    mean: np.ndarray, variance: np.ndarray, reference: np.ndarray, reference_variance
) -> tuple[float, float]:
    """Mean of the picture over the reference's, and its standard error."""
    total = float(reference.sum(dtype=np.float64))
    if abs(total) < 1e-12:
        return math.nan, math.nan
    ratio = float(mean.sum(dtype=np.float64)) / total
    noise = float(np.sum(variance, dtype=np.float64))
    own = float(np.sum(np.broadcast_to(reference_variance, reference.shape), dtype=np.float64))
    return ratio, math.sqrt(noise + ratio**2 * own) / abs(total)


def has_flip() -> bool:
    return importlib.util.find_spec("flip_evaluator") is not None


def flip(shown: np.ndarray, reference: np.ndarray) -> tuple[float, np.ndarray]:
    """[Andersson et al. 2020] of two pictures as they are shown (0 to 1): mean, and the map in its colours."""
    import flip_evaluator

    colors, mean, _ = flip_evaluator.evaluate(
        np.ascontiguousarray(reference, np.float32), np.ascontiguousarray(shown, np.float32), "LDR"
    )
    return float(mean), colors
