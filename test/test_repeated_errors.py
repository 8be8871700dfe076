"""What every step of a gait repeats: it is known as well from many steps as from one, and no better."""

from __future__ import annotations

import numpy as np
import pytest

from sysid_ros.estimators import JumpRule, Problem, make_estimator
from sysid_ros.estimators.variable_forgetting import VariableForgetting
from sysid_ros.floating.contact_projection import Stance
from sysid_ros.floating.stance_log import StanceLog
from sysid_ros.online.tare import Tare
from sysid_ros.sample import FloatArray

PERIOD, STEP = 0.01, 25
RULE = JumpRule(slice(0, 2), np.full(2, np.inf), 0.1, STEP * PERIOD)


def problem(m: int) -> Problem:
    return Problem(np.full(2, 10.0), np.full(m, 1e-4), PERIOD, 1e6, RULE)


def columns(k: int) -> FloatArray:
    """Of two rows: a constant, and something that changes within a step, shape (2, 2)."""
    return np.array([[1.0, np.sin(2.0 * np.pi * k / STEP)], [0.5, np.cos(2.0 * np.pi * k / STEP)]])


def learned(seed: int, steps: int, repeated: float, new: float, name: str = "") -> tuple[FloatArray, FloatArray]:
    """What is learned of zero, and the standard deviations with what repeats, shape (2,) each."""
    rng, estimator = np.random.default_rng(seed), make_estimator(name or "variable", problem(2))
    same = repeated * rng.normal(size=(STEP, 2))
    for k in range(steps * STEP):
        estimator.update(columns(k), same[k % STEP] + new * rng.normal(size=2))
    covariance = estimator.covariance() + estimator.repeated_covariance(slice(0, 2), np.full(2, repeated**2), STEP)
    return estimator.theta, np.sqrt(covariance.diagonal())


@pytest.mark.parametrize("steps", [20, 40])
def test_intervals_cover_what_every_step_repeats(steps: int) -> None:
    runs = [learned(seed, steps, 0.5, 0.05) for seed in range(12)]
    z = np.array([theta / std for theta, std in runs])
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.6
    assert np.mean(np.abs(z) < 1.96) >= 0.85


def test_it_does_not_average_out() -> None:
    some, many = learned(0, 20, 0.5, 0.05)[1], learned(0, 80, 0.5, 0.05)[1]
    np.testing.assert_allclose(many, some, rtol=0.4)
    # as of one step alone: least squares on its rows, which none weighted otherwise surpasses
    rows = np.concatenate([columns(k) for k in range(STEP)])
    one = np.sqrt(0.5**2 * np.linalg.inv(rows.T @ rows).diagonal())
    assert np.all((0.95 * one < many) & (many < 1.5 * one))


def test_an_estimator_that_does_not_watch_itself_has_it_from_the_one_beside_it() -> None:
    assert not isinstance(make_estimator("kalman", problem(2)), VariableForgetting)
    std = learned(0, 40, 0.5, 0.05, "kalman")[1]
    assert np.all(std > learned(0, 40, 0.5, 0.05)[1] - 0.05)
    assert np.all(std > 0.05)


def test_where_nothing_repeats_there_is_none() -> None:
    estimator = VariableForgetting.of(problem(2))
    rng = np.random.default_rng(0)
    for k in range(10 * STEP):
        estimator.update(columns(k), rng.normal(size=2))
    nothing = estimator.repeated_covariance(slice(0, 2), np.zeros(2), STEP)
    assert nothing.shape == (2, 2)
    assert not nothing.any()


def test_a_tare_may_have_had_what_is_repeated_too() -> None:
    estimator = make_estimator("variable", Problem(np.full(10, 10.0), np.full(2, 1e-4), PERIOD, 1e6, RULE))
    repeated = 0.04 * np.eye(10)
    plain, taken = Tare().tared(estimator)[1], Tare.of(estimator, repeated)
    np.testing.assert_allclose(Tare().tared(estimator, repeated)[1] - plain, repeated)
    np.testing.assert_allclose(taken.tared(estimator, repeated)[1] - 2.0 * plain, repeated)
    np.testing.assert_allclose(taken.tared(estimator, 3.0 * repeated)[1] - 2.0 * plain, 2.0 * repeated)


def test_a_robot_steps_for_a_step_after_a_foot_has_landed() -> None:
    log, feet, points = StanceLog(("left", "right")), np.ones(2, dtype=np.bool_), np.zeros((2, 3, 12))
    for k in range(400):
        feet[0] = not 100 <= k < 150
        log.add(Stance(feet, feet.copy(), np.zeros((2, 3)), np.zeros(3), True, False, False, False), k * PERIOD, points)
        if k < 150:
            assert log.stepping == 0.0
    assert log.stepping == pytest.approx(STEP / 400)
