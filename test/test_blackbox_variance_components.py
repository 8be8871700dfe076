"""Variance components: those of a balanced design are known, intervals hold; parts of a rest; bristles and ripples."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sysid_ros.blackbox.joint_parts import JointParts, JointRest, turns_of
from sysid_ros.blackbox.rest_features import play
from sysid_ros.blackbox.variance_components import VarianceComponents
from sysid_ros.sample import FloatArray
from sysid_ros.signals.bristle import bristle

GROUPS, EACH = 30, 8


def grouped(rng: np.random.Generator, between: float, within: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A balanced one-way design: signal, its covariance between groups, and its part within them."""
    part = np.repeat(np.arange(GROUPS), EACH)
    noise = within * rng.standard_normal(GROUPS * EACH)
    same = (part[:, None] == part).astype(float)
    return between * rng.standard_normal(GROUPS)[part] + noise, same, noise


def test_sizes_of_a_balanced_design_are_those_of_the_analysis_of_variance() -> None:
    y, same, _ = grouped(np.random.default_rng(0), 0.8, 0.5)
    found = VarianceComponents.fitted(y, np.ones((len(y), 1)), [same, np.eye(len(y))])
    table = y.reshape(GROUPS, EACH)
    within = float(np.sum((table - table.mean(axis=1, keepdims=True)) ** 2)) / (GROUPS * (EACH - 1))
    between = EACH * float(np.var(table.mean(axis=1), ddof=1))
    # the likelihood settles to 0.02, its width is 1 / sqrt(15) of a size
    assert found.sizes[1] == pytest.approx(within, rel=0.02)
    assert found.sizes[0] == pytest.approx((between - within) / EACH, rel=0.03)


def test_a_part_that_is_not_there_is_nothing() -> None:
    rng = np.random.default_rng(1)
    y = rng.standard_normal(200)
    X = np.sin(np.outer(np.linspace(0.0, 7.0, 200), np.arange(1.0, 4.0)))
    found = VarianceComponents.fitted(y, np.ones((200, 1)), [X @ X.T / 3.0, np.eye(200)])
    assert found.sizes[0] < 0.05
    assert found.sizes[1] == pytest.approx(1.0, abs=0.25)
    assert found.gained_by(np.outer(X[:, 0], X[:, 0])) < 3.0


def test_a_part_that_the_fixed_columns_hold_is_nothing() -> None:
    rng, line = np.random.default_rng(2), np.linspace(-1.0, 1.0, 200)
    F = np.column_stack([np.ones(200), line])
    found = VarianceComponents.fitted(rng.standard_normal(200), F, [np.outer(line, line), np.ones((200, 200)), np.eye(200)])
    assert np.all(found.sizes[:2] == 0.0)
    assert found.sizes[2] == pytest.approx(1.0, abs=0.25)
    assert np.isfinite(found.log_likelihood)


def test_the_power_of_a_part_lies_in_its_interval() -> None:
    inside = 0
    for seed in range(60):
        y, same, noise = grouped(np.random.default_rng(100 + seed), 0.8, 0.5)
        found = VarianceComponents.fitted(y, np.ones((len(y), 1)), [same, np.eye(len(y))])
        power, std = found.power([1], np.ones(len(y), dtype=bool))
        inside += abs(float(np.mean(power)) - float(np.mean(noise**2))) < 1.96 * std
    # 57 are expected; fewer than 52 of 60 has a probability of 1 %
    assert inside >= 52


def rest_of(y: FloatArray, q: FloatArray, moving: NDArray[np.bool_], period: float = 0.05) -> JointRest:
    t = np.asarray(period * np.arange(len(y)), dtype=float)
    stands = np.where(moving, 0, 1 + (t > 0.5 * t[-1]))
    lag, alike = np.array([0.0, period]), np.array([1.0, 0.0])
    return JointRest(
        y,
        t,
        np.zeros(len(y), dtype=np.intp),
        moving,
        stands.astype(np.intp),
        (t // 1.5).astype(np.intp),
        {"position": np.column_stack([q, q**2])},
        lambda k: np.column_stack([np.sin(np.outer(q, k)), np.cos(np.outer(q, k))]),
        turns_of(q, 1.0),
        8.0,
        (lag, alike),
    )


@pytest.mark.parametrize("kind", ["ripple", "ringing"])
def test_noise_is_told_from_what_is_missing(kind: str) -> None:
    rng = np.random.default_rng(3)
    t = 0.05 * np.arange(600)
    moving = (t > 2.0) & (t < 28.0)
    q = np.where(moving, 1.2 * np.sin(0.9 * (t - 2.0)), 0.0)
    noise = 0.2 * rng.standard_normal(len(t))
    missing = np.sin(61.0 * q) if kind == "ripple" else np.sin(2.0 * np.pi * 3.1 * t + 3.0 * np.sin(0.7 * t))
    rms, (low, high) = JointParts(rest_of(np.where(moving, missing, 0.0) + noise, q, moving)).noise()
    true = float(np.sqrt(np.mean(noise[moving] ** 2)))
    # of the power of a ripple nothing is taken for noise; a ringing of an unknown shape takes the noise of its band along
    assert rms == pytest.approx(true, rel=0.1 if kind == "ripple" else 0.4)
    assert low < rms < high


def test_left_out_predictions_know_nothing_of_the_fold() -> None:
    rng = np.random.default_rng(4)
    t = 0.05 * np.arange(400)
    q, moving = np.sin(1.3 * t), np.ones(400, dtype=bool)
    fold = np.arange(400) * 5 // 400
    y = q + 0.1 * rng.standard_normal(400)
    made = JointParts(rest_of(y, q, moving)).left_out(fold)
    assert np.sqrt(np.mean((made - q) ** 2)) < 0.05
    other = np.where(fold == 2, 0.7 * y[::-1], y)
    again = JointParts(rest_of(other, q, moving)).left_out(fold)
    # both are fitted to the same rows of the other folds; only the common scale differs
    assert np.allclose(made[fold == 2], again[fold == 2], atol=1e-3)


def test_a_bristle_bends_and_slides() -> None:
    forth, back = np.linspace(0.0, 1.0, 50), np.linspace(1.0, 0.9, 20)
    z = bristle(np.concatenate([forth, back])[:, None], 0.05, 0.02)[:, 0]
    assert z[49] == pytest.approx(1.0, abs=1e-6)
    # Dahl: exact after a turn, z = -1 + 2 exp(-way / width)
    assert z[-1] == pytest.approx(-1.0 + 2.0 * np.exp(-0.1 / 0.05), abs=1e-6)
    assert play(forth, 0.1)[-1] == pytest.approx(-0.1)
    # what moves at the first position has moved 0.3 s before it; what stands there has bent nothing
    assert z[0] == pytest.approx(1.0 - np.exp(-15.0 * forth[1] / 0.05))
    stands = np.concatenate([np.zeros(20), forth])[:, None]
    assert np.all(bristle(stands, 0.05, 0.02)[:20] == 0.0)
    assert bristle(forth[:3, None], 0.05, 0.02).shape == (3, 1)
