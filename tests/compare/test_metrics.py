"""The figures of a comparison, on pictures whose noise and bias are known."""

import math

import numpy as np
import pytest

from gi_engine.compare import metrics

SHAPE = (96, 128, 3)


@pytest.fixture
def truth():
    """A picture from dark to bright."""
    return np.broadcast_to(np.linspace(0.2, 2.0, SHAPE[1])[None, :, None], SHAPE).astype(np.float32)


def noisy(truth, seed, noise, gain=1.0):
    draws = np.random.default_rng(seed).standard_normal(truth.shape)
    return (gain * truth * (1 + noise * draws)).astype(np.float32)


def test_noise_is_no_bias(truth):
    a, b = noisy(truth, 1, 0.1), noisy(truth, 2, 0.1)
    assert metrics.relative_mse(a, truth) == pytest.approx(0.01, rel=0.05)
    # The product of independent errors has mean 0; its standard deviation is 0.01 over the root of the number of values.
    assert abs(metrics.systematic_mse(a, b, truth)) < 5 * 0.01 / math.sqrt(truth.size)


def test_bias_is_no_noise(truth):
    a, b = noisy(truth, 1, 0.05, gain=1.2), noisy(truth, 2, 0.05, gain=1.2)
    assert metrics.systematic_mse(a, b, truth) == pytest.approx(0.04, rel=0.08)


def test_the_noise_of_the_reference_is_taken_off(truth):
    a, b, reference = (noisy(truth, seed, 0.1) for seed in (1, 2, 3))
    assert metrics.systematic_mse(a, b, reference) == pytest.approx(0.01, rel=0.1)
    left = metrics.systematic_mse(a, b, reference, (0.1 * truth) ** 2)
    assert abs(left) < 0.002 and metrics.own_noise(truth, (0.1 * truth) ** 2) == pytest.approx(0.01, rel=0.05)


def test_an_outlier_hardly_counts(truth):
    image = noisy(truth, 1, 0.1)
    image[3, 3] = 1e4
    assert metrics.relative_mse(image, truth) < 0.011


def blocks(truth, gain, patch=False):
    a, b = noisy(truth, 1, 0.1), noisy(truth, 2, 0.1)
    if patch:
        a[16:24, 40:48], b[16:24, 40:48] = gain * a[16:24, 40:48], gain * b[16:24, 40:48]
    return metrics.block_errors(*metrics.of_two(a, b), truth, 0.0)


def test_blocks_of_noise_alone_agree(truth):
    found = blocks(truth, 1.0)
    assert found.relative.shape == (12, 16) and not found.beyond.any()


def test_one_block_that_is_brighter_is_found(truth):
    found = blocks(truth, 1.3, patch=True)
    assert np.argwhere(found.beyond).tolist() == [[2, 5]]
    assert found.figures()["largest_beyond_noise"] == pytest.approx(
        0.27, abs=0.06
    )  # the floor takes a tenth of the mean


def test_the_mean_ratio_knows_its_error(truth):
    errors = []
    for seed in range(40):
        a, b = noisy(truth, 2 * seed, 0.5, 1.1), noisy(truth, 2 * seed + 1, 0.5, 1.1)
        ratio, error = metrics.mean_ratio(*metrics.of_two(a, b), truth, 0.0)
        errors.append((ratio - 1.1) / error)
    assert abs(np.mean(errors)) < 4 / math.sqrt(40)
    assert 0.6 < np.std(errors) < 1.5


def test_partial_blocks_are_kept():
    assert metrics.blocks_of(np.ones((10, 17, 3)))[..., 1].tolist() == [[64, 64, 8], [16, 16, 2]]


def test_a_black_reference_has_no_ratio():
    ratio, error = metrics.mean_ratio(np.ones(SHAPE), np.zeros(SHAPE), np.zeros(SHAPE), 0.0)
    assert math.isnan(ratio) and math.isnan(error)


def test_flip_sees_a_difference(truth):
    pytest.importorskip("flip_evaluator")
    shown = np.clip(truth / 2, 0, 1)
    assert metrics.flip(shown, shown)[0] == pytest.approx(0, abs=1e-6)
    mean, colors = metrics.flip(np.clip(shown + 0.2, 0, 1), shown)
    assert mean > 0.05 and colors.shape == SHAPE
