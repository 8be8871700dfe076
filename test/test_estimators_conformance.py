"""What every recursive estimator keeps to: one suite over all that are registered, on synthetic rows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import signal

from sysid_ros.estimators import (
    ESTIMATORS,
    ConstantForgetting,
    ConstantInformation,
    DirectionalForgetting,
    Estimator,
    JumpRule,
    KalmanRandomWalk,
    LongRunVariance,
    Problem,
    SquareRootInformation,
    VariableForgetting,
    WatchedEstimator,
    kernels,
    make_estimator,
    register,
)
from sysid_ros.estimators.estimator import STATUSES
from sysid_ros.estimators.kernels import joseph_update
from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray

PERIOD = 0.01
Factory = Callable[..., Estimator]


def make_variable(
    prior_std: FloatArray, variance: FloatArray, period: float = PERIOD, forgetting_time: float = 1e12, block: slice | None = None
) -> VariableForgetting:
    block = slice(0, len(prior_std)) if block is None else block
    least = 0.01 * prior_std[block]
    return VariableForgetting(Problem(prior_std, variance, period, forgetting_time, JumpRule(block, least, 0.1)))


def make_constant(
    prior_std: FloatArray, variance: FloatArray, period: float = PERIOD, forgetting_time: float = 1e12
) -> ConstantForgetting:
    return ConstantForgetting(prior_std, variance, float(np.exp(-period / forgetting_time)))


FACTORIES: dict[str, Factory] = {
    "variable": make_variable,
    "constant": make_constant,
    "constant_information": ConstantInformation,
    "directional": DirectionalForgetting,
    "kalman": KalmanRandomWalk,
    "square_root": SquareRootInformation,
}
every_estimator = pytest.mark.parametrize("make", FACTORIES.values(), ids=FACTORIES)


def smooth_rows(rng: np.random.Generator, count: int, m: int, p: int, highest: float = 0.4) -> FloatArray:
    """Regressors like those of a robot that swings: sums of slow sines, shape (count, m, p)."""
    t = PERIOD * np.arange(count)[:, None, None]
    Y = np.zeros((count, m, p))
    for _ in range(4):
        frequency, phase = rng.uniform(0.05, highest, (m, p)), rng.uniform(0.0, 2.0 * np.pi, (m, p))
        Y += 0.5 * rng.normal(size=(m, p)) * np.sin(2.0 * np.pi * frequency * t + phase)
    return Y


def coloured(rng: np.random.Generator, count: int, m: int, std: float, phi: float) -> FloatArray:
    """AR(1) noise, shape (count, m)."""
    white = rng.normal(size=(count + 1000, m)) * np.sqrt(1.0 - phi**2)
    noise: FloatArray = std * signal.lfilter([1.0], [1.0, -phi], white, axis=0)[1000:]
    return noise


def problem(
    seed: int = 0, count: int = 1500, m: int = 3, p: int = 5, std: float = 0.1, phi: float = 0.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    Y = smooth_rows(rng, count, m, p, highest=2.0)
    theta = rng.normal(size=p)
    return Y, Y @ theta + coloured(rng, count, m, std, phi), theta


def feed(estimator: Estimator, Y: FloatArray, tau: FloatArray) -> Estimator:
    for rows, values in zip(Y, tau, strict=True):
        estimator.update(rows, values)
    return estimator


def batch(Y: FloatArray, tau: FloatArray, prior_std: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least squares over all rows with the prior, theta and covariance."""
    information = np.diag(1.0 / prior_std**2) + np.einsum("tja,j,tjb->ab", Y, 1.0 / variance, Y)
    return np.linalg.solve(information, np.einsum("tja,j,tj->a", Y, 1.0 / variance, tau)), np.linalg.inv(information)


def assert_positive_definite(covariance: FloatArray) -> None:
    np.testing.assert_array_equal(covariance, covariance.T)
    scale = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(scale, scale))[0] > 0.0


def test_every_registered_estimator_is_in_this_suite() -> None:
    assert set(FACTORIES) == set(ESTIMATORS)
    for name, make in FACTORIES.items():
        assert type(make(np.ones(2), np.ones(1))) is ESTIMATORS[name]


# With a noise larger than any that the residuals show, the weights of the rows are the given variance from the first row to the
# last: what the estimators learn of the noise then plays no part, and the recursion must be the batch solution to rounding.
LARGE = np.array([0.3, 0.5, 0.4])


@every_estimator
def test_without_forgetting_it_is_the_batch_solution(make: Factory) -> None:
    Y, tau, _ = problem()
    prior_std = np.array([2.0, 1.0, 0.5, 3.0, 1.0])
    estimator = feed(make(prior_std, LARGE**2), Y, tau)
    theta, covariance = batch(Y, tau, prior_std, LARGE**2)
    np.testing.assert_allclose(estimator.theta, theta, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(estimator.covariance(), covariance, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("floor_std", [0.1, 0.001], ids=["floor is the noise", "floor is far below"])
def test_with_noise_that_it_learned_it_is_near_the_batch_solution(floor_std: float) -> None:
    """What learning costs is a small part of the uncertainty; the covariance is that of the batch solution, or a little more."""
    distances, prior_std = [], np.full(5, 3.0)
    for seed in range(8):
        Y, tau, _ = problem(seed, count=2000)
        estimator = feed(make_variable(prior_std, np.full(3, floor_std**2)), Y, tau)
        theta, covariance = batch(Y, tau, prior_std, np.full(3, 0.1**2))
        std = np.sqrt(np.diag(covariance))
        distances.append((estimator.theta - theta) / std)
        ratio = np.sqrt(np.diag(estimator.covariance())) / std
        assert np.all((ratio > 0.85) & (ratio < 1.6)), ratio
    assert np.sqrt(np.mean(np.square(distances))) < 0.4


def test_first_rows_leave_nothing_of_the_noise_they_were_weighed_with() -> None:
    """A floor far below coloured noise makes theta run away until the noise is known; nothing is forgotten towards that."""
    Y, tau, _ = problem(3, count=400, phi=0.98)
    Y[:, :, 4] *= 1e-4  # a direction that the motion hardly shows
    prior_std, variance, never = np.full(5, 3.0), np.full(3, 1e-5), JumpRule(slice(0, 5), np.full(5, np.inf), 0.1)
    estimator, count = VariableForgetting(Problem(prior_std, variance, PERIOD, 1.0, never)), 0
    while not estimator.noise_known:
        estimator.update(Y[count], tau[count])
        count += 1
    assert np.all(np.abs(estimator.theta) < 2.0 * prior_std), estimator.theta


@every_estimator
def test_the_order_of_rows_does_not_matter(make: Factory) -> None:
    Y, tau, _ = problem()
    shuffled = np.random.default_rng(1).permutation(len(tau))
    rows = np.array([2, 0, 1])
    one = feed(make(np.ones(5), LARGE**2), Y, tau)
    # in one piece, as the rows of the front end: for another layout everything would be compiled anew
    Y, tau = (np.ascontiguousarray(x[shuffled][:, rows]) for x in (Y, tau))
    other = feed(make(np.ones(5), LARGE[rows] ** 2), Y, tau)
    np.testing.assert_allclose(other.theta, one.theta, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(other.covariance(), one.covariance(), rtol=1e-6, atol=1e-12)


@every_estimator
def test_the_units_of_parameters_and_of_torque_do_not_matter(make: Factory) -> None:
    """Also with forgetting and with noise that is learned."""
    Y, tau, _ = problem(phi=0.9, std=0.2)
    tau[700:] += Y[700:] @ np.full(5, 2.0)  # a jump, in the other units as well
    units, torque_unit = np.array([1e3, 1e-3, 1.0, 50.0, 0.2]), 1e-2
    prior_std, variance = np.full(5, 2.0), np.full(3, 0.02**2)
    one = feed(make(prior_std, variance, forgetting_time=5.0), Y, tau)
    other = feed(
        make(prior_std * units, variance * torque_unit**2, forgetting_time=5.0), torque_unit * Y / units, torque_unit * tau
    )
    assert getattr(one, "jumps", 0) == getattr(other, "jumps", 0)
    np.testing.assert_allclose(other.theta / units, one.theta, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(other.covariance() / np.outer(units, units), one.covariance(), rtol=1e-6, atol=1e-12)


@every_estimator
def test_how_rows_are_split_into_updates_does_not_matter(make: Factory) -> None:
    Y, tau, _ = problem()
    pairs = len(tau) // 2
    one = feed(make(np.ones(5), LARGE**2), Y, tau)
    together = feed(make(np.ones(5), np.tile(LARGE**2, 2), period=2 * PERIOD), Y.reshape(pairs, 6, 5), tau.reshape(pairs, 6))
    np.testing.assert_allclose(together.theta, one.theta, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(together.covariance(), one.covariance(), rtol=1e-6, atol=1e-12)


@every_estimator
def test_extra_variance_gives_a_row_less_weight(make: Factory) -> None:
    Y, tau, _ = problem()
    extra = np.array([0.2, 0.0, 3.0])
    estimator = make(np.ones(5), LARGE**2)
    for rows, values in zip(Y, tau, strict=True):
        estimator.update(rows, values, extra_variance=extra)
    theta, _ = batch(Y, tau, np.ones(5), LARGE**2 + extra)
    np.testing.assert_allclose(estimator.theta, theta, rtol=1e-8, atol=1e-10)


@every_estimator
def test_errors_that_are_considered_are_in_the_covariance_and_not_in_the_estimate(make: Factory) -> None:
    """theta of least squares has the bias -P sum Y' R^-1 Z z, whose covariance is added for z ~ N(0, 1)."""
    Y, tau, _ = problem()
    Z = smooth_rows(np.random.default_rng(9), len(tau), 3, 2)
    estimator, plain = (make(np.ones(5), LARGE**2) for _ in range(2))
    for k in range(len(tau)):
        estimator.update(Y[k], tau[k], considered=Z[k])
        plain.update(Y[k], tau[k])
    np.testing.assert_array_equal(estimator.theta, plain.theta)
    _, covariance = batch(Y, tau, np.ones(5), LARGE**2)
    bias = covariance @ np.einsum("tja,j,tjc->ac", Y, 1.0 / LARGE**2, Z)
    np.testing.assert_allclose(estimator.covariance(), covariance + bias @ bias.T, rtol=1e-6, atol=1e-12)
    estimator.reset()
    np.testing.assert_array_equal(estimator.covariance(), np.eye(5))


def test_a_row_of_infinite_variance_changes_nothing() -> None:
    rng = np.random.default_rng(0)
    Y, tau = rng.normal(size=(3, 4)), rng.normal(size=3)
    theta, P = np.zeros(4), np.eye(4)
    joseph_update(theta, P, Y, tau, np.array([1.0, np.inf, 2.0]))
    expected, covariance = batch(Y[None, [0, 2]], tau[None, [0, 2]], np.ones(4), np.array([1.0, 2.0]))
    np.testing.assert_allclose(theta, expected, atol=1e-12)
    np.testing.assert_allclose(P, covariance, atol=1e-12)


@every_estimator
@pytest.mark.parametrize("forgetting_time", [1e12, 2.0])
def test_covariance_is_symmetric_and_positive_definite_whatever_comes(make: Factory, forgetting_time: float) -> None:
    rng = np.random.default_rng(4)
    Y, tau, _ = problem(count=4000, p=6)
    Y[1000:1500] = 0.0  # nothing excites
    Y[2000:2500] = Y[2000]  # one direction excites
    tau[3000:3300] += Y[3000:3300] @ np.full(6, 5.0)  # a jump
    Y[3400:3450] *= 1e4  # badly scaled
    tau[rng.integers(0, 4000, 40)] = 1e4  # outliers
    tau[3500, 1], Y[3600, 0, 2] = np.nan, np.inf
    estimator = make(np.array([5.0, 1.0, 1.0, 0.1, 0.1, 0.01]), np.full(3, 1e-4), forgetting_time=forgetting_time)
    for k in range(len(tau)):
        estimate = estimator.update(Y[k], tau[k], hold=bool(k % 500 > 450))
        assert estimate.status in STATUSES
        if k % 20 == 0:
            assert_positive_definite(estimator.covariance())
        assert np.isfinite(estimate.theta).all()


@every_estimator
def test_the_estimate_is_a_value(make: Factory) -> None:
    Y, tau, _ = problem(count=30)
    estimator = make(np.ones(5), LARGE**2)
    before = estimator.theta
    estimate = estimator.update(Y[0], tau[0])
    np.testing.assert_array_equal(estimate.innovation, tau[0] - Y[0] @ before)
    np.testing.assert_array_equal(estimate.theta, estimator.theta)
    covariance = estimator.covariance()
    kept = [np.copy(a) for a in (estimate.theta, covariance, estimate.innovation)]
    assert estimate.theta.shape == (5,)
    assert covariance.shape == (5, 5)
    assert estimate.innovation.shape == (3,)
    feed(estimator, Y[1:], tau[1:])
    estimator.theta[:] = 7.0
    estimator.covariance()[:] = 7.0
    for array, copy in zip((estimate.theta, covariance, estimate.innovation), kept, strict=True):
        np.testing.assert_array_equal(array, copy)
    assert not np.any(estimator.theta == 7.0)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_noise_of_the_regressors_is_compensated(seed: int) -> None:
    """Noise that is in Y and in the rows looks like information, and draws the estimate to where it hides in the noise."""
    prior_std, floor, spread, count = np.array([2.0, 2.0]), np.full(2, 0.05**2), 0.02, 4000
    truth, hidden = np.array([0.5, -0.3]), np.array([[3.0, 0.5], [0.2, 1.0]])  # what a unit of each source does to the rows
    columns = np.array([[[1.0, 0.2], [0.3, 0.5]], [[0.1, 0.7], [0.2, 1.0]]])  # and to Y, a source each
    slow = 0.05 * smooth_rows(np.random.default_rng(seed), count, 2, 2, highest=0.05)
    noise = spread * np.random.default_rng([seed, 1]).normal(size=(count, 2))
    white = 0.05 * np.random.default_rng([seed, 2]).normal(size=(count, 2))
    off = {}
    for compensated in (False, True):
        estimator = make_variable(prior_std, floor)
        for k in range(count):
            Y = slow[k] + np.einsum("s,smp->mp", noise[k], columns)
            estimator.update(Y, slow[k] @ truth - noise[k] @ hidden + white[k])
            if compensated and k % 10 == 9:
                estimator.compensate((spread * columns, -spread * hidden, np.zeros((2, 2, 0))), False, None)
                assert_positive_definite(estimator.covariance())
        off[compensated] = float(np.abs(estimator.theta - truth).max())
        std = np.sqrt(estimator.covariance().diagonal())
        assert np.all(std <= prior_std)
    assert off[True] < 0.2 * off[False]
    assert off[True] < 3.0 * std.max()


@every_estimator
def test_hold_changes_nothing(make: Factory) -> None:
    Y, tau, _ = problem()
    estimator = feed(make(np.ones(5), np.full(3, 1e-4), forgetting_time=3.0), Y, tau)
    theta, covariance = estimator.theta, estimator.covariance()
    for _ in range(2000):
        estimate = estimator.update(Y[-1], tau[-1], hold=True)
    assert estimate.status == "not_excited"
    assert estimate.reason
    np.testing.assert_array_equal(estimator.theta, theta)
    np.testing.assert_array_equal(estimator.covariance(), covariance)


@every_estimator
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["tau", "Y"])
@pytest.mark.parametrize("early", [True, False])
def test_rows_that_are_not_finite_never_enter(make: Factory, bad: float, where: str, early: bool) -> None:
    Y, tau, _ = problem(count=600)
    spoilt = 20 if early else 400
    one, other = (make(np.ones(5), np.full(3, 1e-3)) for _ in range(2))
    for k in range(len(tau)):
        one.update(Y[k], tau[k])
        other.update(Y[k], tau[k])
        if k == spoilt:
            rows, values = Y[k].copy(), tau[k].copy()
            if where == "tau":
                values[1] = bad
            else:
                rows[2, 0] = bad
            estimate = other.update(rows, values)
            assert estimate.status == "not_finite"
            assert estimate.reason
            np.testing.assert_array_equal(estimate.theta, one.theta)
    np.testing.assert_array_equal(one.theta, other.theta)
    np.testing.assert_array_equal(one.covariance(), other.covariance())


@every_estimator
def test_one_absurd_row_does_not_end_the_estimation(make: Factory) -> None:
    """Finite rows whose squares overflow: what was known may be lost, but what follows is used again."""
    Y, tau, theta = problem(count=3000)
    estimator = make(np.full(5, 3.0), np.full(3, 0.1**2), forgetting_time=5.0)
    feed(estimator, Y[:500], tau[:500])
    estimator.update(1e160 * Y[500], tau[500])
    estimator.update(Y[501], np.full(3, 1e160))
    feed(estimator, Y[502:], tau[502:])
    assert np.isfinite(estimator.theta).all()
    assert np.all(np.abs(estimator.theta - theta) < 0.2)


def two_halves(make: Factory, apart: float = 0.0) -> tuple[Estimator, Estimator, Estimator]:
    """Estimators of the first rows, of the others, whose first two parameters are ``apart``, and of all."""
    rng = np.random.default_rng(4)
    std, theta = np.full(4, 3.0), np.array([1.0, -0.5, 0.3, 2.0])
    first, second, both = (make(std, np.full(2, 0.01)) for _ in range(3))
    for k in range(80):
        Y = rng.normal(size=(2, 4))
        Y[:, 2:] *= k < 40  # the others tell of the first two alone
        tau = Y @ (theta + apart * np.array([1.0, 1.0, 0.0, 0.0]) * (k >= 40)) + 0.1 * rng.normal(size=2)
        (first if k < 40 else second).update(Y, tau)
        both.update(Y, tau)
    return first, second, both


def combining(make: Factory) -> bool:
    """Whether an estimator combines: one that learns it from rows to come need not."""
    return type(make(np.ones(2), np.ones(1))).combine is not Estimator.combine


@every_estimator
def test_what_other_rows_say_is_as_good_as_the_rows(make: Factory) -> None:
    first, second, both = two_halves(make)
    if make is make_variable or not combining(make):  # that one weighs the rows by the noise that it has learned of them
        return
    block = slice(0, 2)
    prior = second.covariance()[block, block]
    value, covariance, sensitivity = second.parts(block)
    # a prior counts once: of what the second says its own is taken off
    alone = np.asarray(np.linalg.inv(np.linalg.inv(prior) - np.eye(2) / 9.0), dtype=float)
    first.combine(block, (np.asarray(alone @ np.linalg.solve(covariance, value), dtype=float), alone, sensitivity))
    np.testing.assert_allclose(first.theta, both.theta, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(first.covariance(), both.covariance(), rtol=1e-6, atol=1e-12)


@every_estimator
def test_what_is_further_apart_than_both_say_is_as_uncertain_as_that(make: Factory) -> None:
    if not combining(make):
        return
    block, std = slice(0, 2), []
    for apart in (0.0, 1.0):
        first, second, _ = two_halves(make, apart)
        before = first.theta[0]
        first.combine(block, second.parts(block))
        assert min(before, before + apart) - 0.1 < first.theta[0] < max(before, before + apart) + 0.1
        std.append(float(np.sqrt(first.covariance()[0, 0])))
    assert std[0] < 0.05
    assert 0.2 < std[1] < 2.0


@every_estimator
def test_reset_forgets_everything_but_the_prior(make: Factory) -> None:
    Y, tau, _ = problem(phi=0.9)
    tau[700:] += Y[700:] @ np.full(5, 3.0)
    new, used = (make(np.full(5, 2.0), np.full(3, 1e-3), forgetting_time=5.0) for _ in range(2))
    feed(used, Y[::-1], tau[::-1])
    used.reset()
    np.testing.assert_array_equal(used.theta, np.zeros(5))
    np.testing.assert_array_equal(used.covariance(), 4.0 * np.eye(5))
    for k in range(len(tau)):
        a, b = new.update(Y[k], tau[k]), used.update(Y[k], tau[k])
        assert a.status == b.status
    np.testing.assert_array_equal(new.theta, used.theta)
    np.testing.assert_array_equal(new.covariance(), used.covariance())


def watched(make: Factory, forgetting_time: float = 30.0) -> Estimator:
    """What the online estimation runs: six parameters, four of which may jump, five rows of a noise of 0.1."""
    rule = JumpRule(slice(0, 4), np.full(4, 0.02), 0.1)
    problem = Problem(np.full(6, 2.0), np.full(5, 0.05**2), PERIOD, forgetting_time, rule)
    estimator = make(problem.prior_std, problem.floor, forgetting_time=forgetting_time)
    assert estimator.noise_variance.shape == estimator.row_variance.shape == (5,)
    return VariableForgetting.of(problem) if estimator.watches_itself else WatchedEstimator(estimator, problem)


@every_estimator
@pytest.mark.parametrize("seed", range(3))
def test_watched_it_learns_the_noise_and_finds_jumps(make: Factory, seed: int) -> None:
    Y, tau, theta = problem(seed, count=2400, m=5, p=6)
    change = np.zeros(6)
    change[:4] = np.random.default_rng(seed).choice([-1.5, 1.5], 4)
    tau[1200:] += Y[1200:] @ change
    estimator = watched(make)
    statuses, found = [], []
    for k in range(len(tau)):
        known, jumps = estimator.noise_known, estimator.jumps
        statuses.append(estimator.update(Y[k], tau[k]).status)
        if estimator.jumps > jumps:
            found.append(k)
            assert known
            np.testing.assert_allclose(estimator.before_jump, theta[:4], atol=0.15)
            np.testing.assert_allclose(estimator.last_jump, change[:4], atol=0.8)
    assert len(found) == 1
    assert 0 <= found[0] - 1200 <= estimator.found_after + 15
    assert statuses[0] == statuses[found[0]] == "warming_up"
    assert statuses[1150] == statuses[-1] == "ok"
    assert set(statuses) <= set(STATUSES)
    assert np.all((estimator.noise_variance > 0.06**2) & (estimator.noise_variance < 0.22**2))  # from some twenty blocks
    np.testing.assert_allclose(np.sqrt(estimator.row_variance), 0.1, rtol=0.2)
    std = np.sqrt(np.diag(estimator.covariance()))
    assert np.all(np.abs(estimator.theta - theta - change) < 4.5 * std + 1e-3)


@every_estimator
def test_watched_it_finds_no_jump_where_there_is_none(make: Factory) -> None:
    for phi in (0.0, 0.9):
        Y, tau, _ = problem(5, count=3000, m=5, p=6, phi=phi)
        assert feed(watched(make), Y, tau).jumps == 0


@every_estimator
def test_watched_it_forgets_what_may_jump_and_starts_again(make: Factory) -> None:
    Y, tau, theta = problem(1, count=1500, m=5, p=6)
    estimator = feed(watched(make), Y, tau)
    assert np.all(np.diag(estimator.covariance())[:4] < 0.1)
    estimator.forget()
    assert estimator.noise_known
    np.testing.assert_allclose(np.diag(estimator.covariance())[:4], 4.0)
    feed(estimator, Y, tau)
    assert np.max(np.abs(estimator.theta - theta)) < 0.1
    estimator.reset()
    assert (estimator.noise_known, estimator.jumps) == (False, 0)
    np.testing.assert_array_equal(estimator.covariance(), 4.0 * np.eye(6))


@every_estimator
def test_watched_it_holds_and_lets_nothing_absurd_in(make: Factory) -> None:
    Y, tau, _ = problem(2, count=1000, m=5, p=6)
    estimator = feed(watched(make), Y, tau)
    theta = estimator.theta
    assert estimator.update(Y[0], tau[0], hold=True).status == "not_excited"
    assert estimator.update(Y[0], np.full(5, np.nan)).status == "not_finite"
    np.testing.assert_array_equal(estimator.theta, theta)


def test_estimators_are_made_by_their_names() -> None:
    rule = JumpRule(slice(0, 2), np.full(2, 0.1), 0.1)
    problem = Problem(np.ones(3), np.ones(2), PERIOD, 10.0, rule)
    for name in ESTIMATORS:
        estimator = make_estimator(name, problem)
        assert (estimator.p, estimator.m) == (3, 2)
        assert estimator.watches_itself
    with pytest.raises(SettingsError, match="registered already"):
        register("constant", VariableForgetting)


def largest_part_of_prior(covariance: FloatArray, prior_std: FloatArray) -> float:
    return float(np.linalg.eigvalsh(covariance / np.outer(prior_std, prior_std))[-1])


@pytest.mark.parametrize("rank", [0, 3])
def test_variable_forgetting_never_exceeds_its_prior(rank: int) -> None:
    """40 000 updates, eighty times the time of forgetting, with too little excitation, after some with enough."""
    rng = np.random.default_rng(8)
    prior_std = np.array([2.0, 0.3, 0.3, 0.3, 0.1, 0.1])
    Y, tau, theta = problem(count=1000, m=2, p=6)
    estimator: Any = feed(make_variable(prior_std, np.full(2, 1e-4), forgetting_time=5.0), Y, tau)
    basis = rng.normal(size=(rank, 6)) / prior_std
    noise = 0.1 * rng.normal(size=(40_000, 2))
    weights = rng.normal(size=(40_000, 2, rank))
    for k in range(40_000):
        row = weights[k] @ basis if rank else np.zeros((2, 6))
        estimator.update(row, row @ theta + noise[k])
        if k % 500 == 0:
            assert largest_part_of_prior(estimator.covariance(), prior_std) <= 1.0 + 1e-6
    covariance = estimator.covariance()
    assert_positive_definite(covariance)
    assert largest_part_of_prior(covariance, prior_std) > 0.99  # what nothing excites is forgotten, up to the prior
    assert estimator.jumps == 0


@pytest.mark.parametrize("floor", [1e-16, 1e-5, 1e-3])
@pytest.mark.parametrize("phi", [0.0, 0.9])
def test_the_bound_holds_while_the_noise_is_learned(floor: float, phi: float) -> None:
    """Also where the first weights were far too high, in every direction and not only along the axes."""
    prior_std = np.full(6, 0.3)
    for seed in range(3):
        Y, tau, _ = problem(seed, count=600, m=3, p=6, phi=phi, std=1.0)
        estimator = make_variable(prior_std, np.full(3, floor), forgetting_time=60.0)
        for k in range(len(tau)):
            estimator.update(Y[k], tau[k])
            if k % 10 == 0:
                covariance = estimator.covariance()
                assert_positive_definite(covariance)
                assert largest_part_of_prior(covariance, prior_std) <= 1.0 + 1e-6


def test_constant_forgetting_winds_up() -> None:
    """Why it is not the default: its covariance grows without bound where nothing excites the parameters."""
    prior_std = np.ones(3)
    estimator = make_constant(prior_std, np.array([0.01]), forgetting_time=1.0)
    for _ in range(2000):
        estimator.update(np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))
    assert largest_part_of_prior(estimator.covariance(), prior_std) > 1e8


def test_constant_forgetting_has_the_weights_of_its_factor() -> None:
    Y, tau, _ = problem(count=400)
    factor = 0.99
    estimator = feed(ConstantForgetting(np.full(5, 2.0), LARGE**2, factor), Y, tau)
    weight = factor ** np.arange(len(tau) - 1, -1, -1.0)
    information = factor ** len(tau) * np.eye(5) / 4.0 + np.einsum("t,tja,j,tjb->ab", weight, Y, 1.0 / LARGE**2, Y)
    score = np.einsum("t,tja,j,tj->a", weight, Y, 1.0 / LARGE**2, tau)
    np.testing.assert_allclose(estimator.theta, np.linalg.solve(information, score), rtol=1e-7)
    np.testing.assert_allclose(estimator.covariance(), np.linalg.inv(information), rtol=1e-6)


def test_constant_forgetting_starts_from_its_prior_mean() -> None:
    mean = np.array([1.0, -2.0])
    estimator = ConstantForgetting(np.ones(2), np.ones(1), prior_mean=mean)
    np.testing.assert_array_equal(estimator.theta, mean)
    estimator.update(np.array([[1.0, 0.0]]), np.array([5.0]))
    np.testing.assert_allclose(estimator.theta, [3.0, -2.0])
    estimator.reset()
    np.testing.assert_array_equal(estimator.theta, mean)


@pytest.mark.parametrize("phi", [0.0, 0.9])
@pytest.mark.parametrize("seed", range(4))
def test_a_jump_is_found_soon_and_measured(seed: int, phi: float) -> None:
    rng = np.random.default_rng(seed)
    Y, tau, theta = problem(seed, count=3000, m=5, p=6, phi=phi)
    change = np.zeros(6)
    change[:4] = rng.choice([-1.0, 1.0], 4)
    tau[1500:] += Y[1500:] @ change
    estimator = make_variable(np.full(6, 2.0), np.full(5, 0.1**2 * (1.0 - phi**2)), forgetting_time=60.0, block=slice(0, 4))
    found: list[int] = []
    for k in range(len(tau)):
        estimator.update(Y[k], tau[k])
        if estimator.jumps > len(found):
            found.append(k)
            assert estimator.last_jump @ change[:4] > 0.0
    assert len(found) == 1
    assert 0 <= found[0] - 1500 <= 30
    std = np.sqrt(np.diag(estimator.covariance()))
    assert np.all(np.abs(estimator.theta - theta - change) < 5.0 * std)
    assert np.all(std < 0.2)


def test_after_a_jump_only_the_block_is_forgotten() -> None:
    Y, tau, _ = problem(count=2000, m=5, p=6)
    tau[1500:] += Y[1500:, :, :4] @ np.ones(4)
    estimator = make_variable(np.full(6, 2.0), np.full(5, 0.1**2), block=slice(0, 4))
    feed(estimator, Y[:1500], tau[:1500])
    before = np.diag(estimator.covariance())
    for k in range(1500, 2000):
        estimator.update(Y[k], tau[k])
        if estimator.jumps:
            break
    after = np.diag(estimator.covariance())
    assert estimator.settling
    assert np.all(after[4:] <= 1.1 * before[4:])
    assert np.all(after[:4] > 10.0 * before[:4])


@pytest.mark.parametrize("seed", range(4))
def test_what_is_carried_may_bring_its_own_noise(seed: int) -> None:
    """The noise of the positions reaches the torques through the inertia that is carried: more of it is no second jump."""
    rng = np.random.default_rng(seed)
    Y = smooth_rows(rng, 3000, 4, 6)
    tau = coloured(rng, len(Y), 4, 0.05, 0.6)
    tau[1500:] += Y[1500:] @ np.array([2.0, -1.0, 1.0, 0.5, 0.0, 0.0]) + coloured(rng, len(Y), 4, 0.15, 0.6)[1500:]
    estimator = make_variable(np.full(6, 3.0), np.full(4, 0.01**2), block=slice(0, 4), forgetting_time=60.0)
    feed(estimator, Y, tau)
    assert estimator.jumps == 1


def no_jump(estimator: VariableForgetting, Y: FloatArray, tau: FloatArray) -> None:
    for k in range(len(tau)):
        estimator.update(Y[k], tau[k])
        assert estimator.jumps == 0, f"a jump of {estimator.last_jump} after {k * PERIOD:.2f} s"


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9, 0.98])
@pytest.mark.parametrize("floor", ["white part", "far below"])
def test_no_jump_is_found_in_noise(phi: float, floor: str) -> None:
    for seed in range(6):
        Y, tau, _ = problem(seed, count=3000, m=4, p=4, phi=phi)
        variance = 0.1**2 * (1.0 - phi**2) if floor == "white part" else 1e-5
        no_jump(make_variable(np.full(4, 3.0), np.full(4, variance), forgetting_time=60.0), Y, tau)


def test_no_jump_is_found_where_another_parameter_changes() -> None:
    Y, tau, _ = problem(count=3000, m=6, p=6)
    tau[1500:, 2] += 0.7  # the offset of one row, in no column
    no_jump(make_variable(np.full(6, 2.0), np.full(6, 0.1**2), block=slice(0, 2)), Y, tau)


def test_no_jump_is_found_in_outliers_and_they_weigh_little() -> None:
    Y, tau, theta = problem(count=3000, m=5, p=6)
    rng = np.random.default_rng(0)
    spikes = rng.choice(np.arange(300, 3000), 100, replace=False)
    tau[spikes] += rng.choice([-20.0, 20.0], (100, 5))
    estimator = make_variable(np.full(6, 2.0), np.full(5, 0.1**2))
    statuses = []
    for k in range(len(tau)):
        statuses.append(estimator.update(Y[k], tau[k]).status)
        assert estimator.jumps == 0
    assert np.mean([statuses[k] == "outlier" for k in spikes]) > 0.95
    assert np.max(np.abs(estimator.theta - theta)) < 0.05


def test_a_change_below_the_least_is_no_jump() -> None:
    Y, tau, _ = problem(count=3000, m=5, p=4)
    tau[1500:] += Y[1500:] @ np.full(4, 0.5)
    estimator = VariableForgetting(
        Problem(np.full(4, 2.0), np.full(5, 0.01), PERIOD, 60.0, JumpRule(slice(0, 4), np.full(4, 3.0), 0.1))
    )
    no_jump(estimator, Y, tau)


def coverage(make: Factory, variance: float, phi: float, runs: int, highest: float, seconds: float = 30.0) -> float:
    inside, total, count, m, p = 0, 0, round(seconds / PERIOD), 4, 4
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        Y, theta = smooth_rows(rng, count, m, p, highest), rng.normal(size=p)
        tau = Y @ theta + coloured(rng, count, m, 0.1, phi)
        estimator = feed(make(np.full(p, 3.0), np.full(m, variance), forgetting_time=60.0), Y, tau)
        inside += int(np.sum(np.abs(estimator.theta - theta) < 1.96 * np.sqrt(np.diag(estimator.covariance()))))
        total += p
    return inside / total


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("phi", "highest"), [pytest.param(0.0, 2.0, marks=SLOW), pytest.param(0.9, 0.4, marks=SLOW), (0.98, 0.2)]
)
def test_intervals_cover_the_truth_under_coloured_noise(phi: float, highest: float) -> None:
    """The rows move as slowly as the noise: here the plain variance of the residual makes intervals that are far too short."""
    assert 0.88 <= coverage(make_variable, 0.1**2 * (1.0 - phi**2), phi, 40, highest) <= 0.99


def test_the_plain_variance_would_make_intervals_far_too_short() -> None:
    """That the test above can tell: the estimator that is told the variance of the noise, but not its colour."""
    assert coverage(make_constant, 0.1**2, 0.98, 15, 0.2) < 0.6


@pytest.mark.parametrize("period", [0.01, 0.004])
@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9, 0.97])
def test_long_run_variance(period: float, phi: float) -> None:
    """The spectral density at zero frequency: s^2 dt for white noise, s^2 dt (1 + phi) / (1 - phi) for AR(1)."""
    noise = LongRunVariance(2, period, np.full(2, 1e-9), memory=1e9)
    std = np.array([1.0, 3.0])
    for row in coloured(np.random.default_rng(2), 60_000, 2, 1.0, phi) * std:
        noise.add(row, np.ones(row.size))
    assert noise.known
    expected = std**2 * period * (1.0 + phi) / (1.0 - phi)
    np.testing.assert_allclose(noise.variance * period, expected, rtol=0.3)


def test_long_run_variance_until_it_is_known() -> None:
    floor = np.array([0.1, 0.2])
    noise = LongRunVariance(2, PERIOD, floor)
    rng = np.random.default_rng(0)
    for _ in range(noise.fewest_updates - 1):
        noise.add(rng.normal(size=2), np.ones(2))
        assert not noise.known
        np.testing.assert_array_equal(noise.variance, noise.CAUTION * floor)
    noise.add(rng.normal(size=2), np.ones(2))
    assert noise.known


def test_long_run_variance_never_falls_below_the_floor() -> None:
    noise = LongRunVariance(2, PERIOD, np.array([4.0, 1e-6]), memory=1e9)
    for row in np.random.default_rng(0).normal(size=(5000, 2)):
        noise.add(row, np.ones(row.size))
    assert noise.variance[0] == 4.0
    assert 0.7 < noise.variance[1] < 1.5


def test_long_run_variance_follows_the_noise() -> None:
    noise = LongRunVariance(1, PERIOD, np.array([1e-6]), memory=20.0)
    rng = np.random.default_rng(0)
    for std in (1.0, 0.1):
        for row in std * rng.normal(size=(12_000, 1)):
            noise.add(row, np.ones(row.size))
    assert noise.variance[0] < 0.03


def test_interrupted_blocks_do_not_count() -> None:
    noise = LongRunVariance(1, PERIOD, np.array([1e-6]))
    for _ in range(500):
        for _ in range(20):
            noise.add(np.array([100.0]), np.ones(1))
        noise.interrupt()
    assert not noise.known


def test_a_row_that_tells_nothing_is_as_far_above_its_floor_as_the_others() -> None:
    noise = LongRunVariance(3, PERIOD, np.array([1e-2, 2e-2, 4e-2]), memory=1e9)
    part = np.array([1.0, 1.0, 1e-4])
    for row in np.random.default_rng(0).normal(size=(5000, 3)) * np.sqrt([0.5, 1.0, 1e-6]):
        noise.add(row, part)
    np.testing.assert_allclose(noise.variance, [0.5, 1.0, 2.0], rtol=0.3)


def test_what_may_hide_but_does_not_is_not_taken_for_the_noise() -> None:
    """Next to all that dry friction could hide before it is known, what is left of a row looks like nothing."""
    rng = np.random.default_rng(0)
    Y = smooth_rows(rng, 600, 3, 5, highest=2.0)
    tau = Y @ rng.normal(size=5) + coloured(rng, 600, 3, 0.1, 0.9)
    estimator, extra = make_variable(np.full(5, 3.0), np.full(3, 1e-3**2)), np.array([25.0, 0.0, 0.0])
    for rows, values in zip(Y, tau, strict=True):
        estimator.update(rows, values, extra_variance=extra)
    assert estimator.noise_known
    assert np.all(estimator.noise_variance > 0.25 * 0.1**2 * 19.0)  # (1 + 0.9) / (1 - 0.9)
    assert np.all(estimator.row_variance > 0.25 * 0.1**2)


@pytest.mark.parametrize("seed", range(20))
def test_rows_that_fit_are_told_from_those_that_do_not_by_the_normalised_innovation(seed: int) -> None:
    """Whether or not the short cut settles it."""
    rng = np.random.default_rng(seed)
    Y, root = rng.normal(size=(4, 6)), rng.normal(size=(6, 6))
    P, spread, extra = 0.3 * root @ root.T, rng.uniform(0.1, 1.0, 4), rng.uniform(0.0, 1.0, 4)
    innovation = rng.normal(size=4) * rng.choice([0.3, 1.0, 3.0, 10.0])
    S = Y @ P @ Y.T + np.diag(spread + extra)
    z = float(innovation @ np.linalg.solve(S, innovation)) / 4
    assert kernels.normalised_innovation(Y, P, spread, extra, innovation) == pytest.approx(z, rel=1e-9)
    for threshold in (0.5 * z, 0.99 * z, 1.01 * z, 2.0 * z, 100.0 * z):
        assert kernels.is_ordinary(Y, P, spread, extra, innovation, threshold) == (z <= threshold)


def test_rows_with_zeros_are_taken_in_as_any_other() -> None:
    """Columns of friction load one joint each: the loops leave out what is zero."""
    rng = np.random.default_rng(3)
    Y = np.concatenate([rng.normal(size=(5, 4, 3)), np.broadcast_to(np.eye(4), (5, 4, 4))], axis=2)
    tau, variance = rng.normal(size=(5, 4)), rng.uniform(0.1, 1.0, 4)
    theta, P = np.zeros(7), 4.0 * np.eye(7)
    for rows, values in zip(Y, tau, strict=True):
        joseph_update(theta, P, np.ascontiguousarray(rows), values, variance)
    expected, covariance = batch(Y, tau, np.full(7, 2.0), variance)
    np.testing.assert_allclose(theta, expected, atol=1e-12)
    np.testing.assert_allclose(P, covariance, atol=1e-12)
    np.testing.assert_array_equal(P, P.T)
