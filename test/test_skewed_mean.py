"""The mean of few skewed numbers: interval and test are one, and hold their level where Student's t does not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from sysid_ros.blackbox.skewed_mean import SkewedMean
from sysid_ros.sample import FloatArray


@pytest.mark.parametrize("seed", range(5))
def test_ends_of_the_interval_are_the_values_that_the_test_just_allows(seed: int) -> None:
    x = np.random.default_rng(seed).lognormal(0.0, 1.0, 24)
    low, high = SkewedMean(x).interval(0.9)
    assert SkewedMean(x - low).by_chance() == pytest.approx(0.05, rel=1e-6)
    assert SkewedMean(x - high).by_chance() == pytest.approx(0.95, rel=1e-6)
    assert low < np.mean(x) < high


def test_without_skewness_it_is_students() -> None:
    x = np.array([-2.0, -1.0, 0.0, 1.0, 2.0]) + 0.7
    student = stats.ttest_1samp(x, 0.0, alternative="greater")
    assert SkewedMean(x).by_chance() == pytest.approx(float(student.pvalue))
    assert SkewedMean(x).interval() == pytest.approx(_two_sided(x))


def _two_sided(x: FloatArray) -> tuple[float, float]:
    low, high = stats.ttest_1samp(x, 0.0).confidence_interval(0.95)
    return float(low), float(high)


def test_numbers_that_lean_to_the_right_are_covered_as_often_as_told() -> None:
    rng = np.random.default_rng(8)
    draws = rng.exponential(1.0, (3000, 20))
    spans = [SkewedMean(x).interval() for x in draws]
    above = np.mean([low > 1.0 for low, _ in spans])
    below = np.mean([high < 1.0 for _, high in spans])
    student = [stats.ttest_1samp(x, 0.0).confidence_interval(0.95) for x in draws]
    assert 0.01 < above < 0.04
    assert 0.01 < below < 0.05
    assert np.mean([s.high < 1.0 for s in student]) > 1.5 * below
