"""The Fourier motion: at rest at both ends, periodic, its derivatives its own, and the series that it states."""

from __future__ import annotations

import numpy as np
import pytest

from sysid_ros.exceptions import SettingsError
from sysid_ros.excitation.fourier_trajectory import FourierBasis, FourierTrajectory


def motion(
    seed: int, duration: float = 10.0, period: float = 10.0, harmonics: int = 5, anchored: bool = False
) -> FourierTrajectory:
    basis = FourierBasis(duration, period, harmonics, anchored)
    return FourierTrajectory(basis, np.random.default_rng(seed).normal(size=(basis.size, 4)))


CASES = [(0, 10.0, 10.0, 5, False), (1, 20.0, 5.0, 2, False), (2, 7.0, 3.5, 9, True), (3, 4.0, 4.0, 3, True)]


@pytest.mark.parametrize("case", CASES)
def test_it_rests_at_both_ends_and_between_periods(case: tuple[int, float, float, int, bool]) -> None:
    trajectory = motion(*case)
    for t in np.arange(0.0, case[1] + 1e-9, case[2]):
        q, v, a = trajectory.sample(np.array([t]))
        assert q[0] == pytest.approx(trajectory.start, abs=1e-12)
        assert v[0] == pytest.approx(0.0, abs=1e-11)
        assert a[0] == pytest.approx(0.0, abs=1e-10)
    q, v, a = trajectory.sample(np.array([-1.0, case[1] + 1.0]))
    assert q == pytest.approx(np.tile(trajectory.start, (2, 1)))
    assert np.abs(v).max() < 1e-11


@pytest.mark.parametrize("case", CASES)
def test_velocity_and_acceleration_are_the_derivatives(case: tuple[int, float, float, int, bool]) -> None:
    trajectory, h = motion(*case), 1e-6
    t = np.linspace(0.1, case[1] - 0.1, 50)
    before, middle, after = (trajectory.sample(t + x) for x in (-h, 0.0, h))
    for k in (0, 1):
        assert (after[k] - before[k]) / (2.0 * h) == pytest.approx(middle[k + 1], abs=1e-6)


@pytest.mark.parametrize("case", CASES)
def test_the_series_is_the_motion(case: tuple[int, float, float, int, bool]) -> None:
    trajectory = motion(*case)
    offset, sine, cosine = trajectory.basis.series(trajectory.coefficients)
    t = np.linspace(0.0, case[1], 37)
    phase = np.multiply.outer(t, 2.0 * np.pi / case[2] * np.arange(1, case[3] + 1))
    assert offset + np.sin(phase) @ sine + np.cos(phase) @ cosine == pytest.approx(trajectory.sample(t)[0], abs=1e-12)


def test_every_motion_of_the_series_that_rests_is_in_the_basis() -> None:
    basis = FourierBasis(10.0, 10.0, 5)
    t = np.linspace(0.0, 10.0, 200)
    value, _, _ = basis.functions(t)
    assert np.linalg.matrix_rank(value) == basis.size == 2 * 5 - 1
    assert basis.functions(np.zeros(1))[1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("anchored", [False, True])
def test_scaling_keeps_the_posture_of_the_first_row(anchored: bool) -> None:
    trajectory = motion(5, anchored=anchored)
    small = trajectory.scaled(0.25)
    t = np.linspace(0.0, 10.0, 20)
    posture = trajectory.coefficients[0]
    assert small.sample(t)[0] - posture == pytest.approx(0.25 * (trajectory.sample(t)[0] - posture))
    if anchored:
        assert small.start == pytest.approx(posture)


def test_the_grid_has_both_ends() -> None:
    grid = motion(0, 9.0, 3.0).grid(0.007)
    assert grid[0] == 0.0
    assert grid[-1] == 9.0
    assert np.diff(grid).max() <= 0.007 + 1e-12


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ((10.0, 4.0, 5), "whole number of periods"),
        ((10.0, 20.0, 5), "whole number of periods"),
        ((10.0, 10.0, 1), "harmonics is 1"),
        ((-1.0, 1.0, 5), "must be positive"),
    ],
)
def test_what_is_not_allowed_is_said(arguments: tuple[float, float, int], match: str) -> None:
    with pytest.raises(SettingsError, match=match):
        FourierBasis(*arguments)
