"""The physical body nearest to an estimate, against the semidefinite programme solved by cvxpy."""

from __future__ import annotations

import cvxpy as cp
import numpy as np
import pytest
from robots import random_body

from sysid_ros.robot import inertial_parameters as ip
from sysid_ros.robot.inertial_parameters import project
from sysid_ros.sample import FloatArray

SCALE = np.array([1.0] + [0.1] * 3 + [0.02] * 6)


def random_covariance(rng: np.random.Generator, size: float) -> FloatArray:
    root = rng.normal(size=(10, 14)) / np.sqrt(14)
    spread = size * SCALE
    return np.asarray(spread[:, None] * (root @ root.T + 0.05 * np.eye(10)) * spread)


def optimum(theta: FloatArray, covariance: FloatArray) -> float:
    """Least squared Mahalanobis distance to a positive semidefinite pseudo-inertia."""
    x = cp.Variable(10)
    xx, xy, yy, xz, yz, zz = (x[i] for i in range(4, 10))
    half = (xx + yy + zz) / 2
    pseudo = cp.bmat(
        [
            [half - xx, -xy, -xz, x[1]],
            [-xy, half - yy, -yz, x[2]],
            [-xz, -yz, half - zz, x[3]],
            [x[1], x[2], x[3], x[0]],
        ]
    )
    root = np.linalg.cholesky(np.linalg.inv(covariance)).T
    problem = cp.Problem(cp.Minimize(cp.sum_squares(root @ (x - theta))), [(pseudo + pseudo.T) / 2 >> 0])
    problem.solve(solver=cp.CLARABEL)
    return float(problem.value)


def distance(theta: FloatArray, other: FloatArray, covariance: FloatArray) -> float:
    return float((theta - other) @ np.linalg.solve(covariance, theta - other))


@pytest.mark.parametrize("size", [0.02, 0.2, 1.0])
@pytest.mark.parametrize("seed", range(12))
def test_result_is_physical_and_as_near_as_the_optimum(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    covariance = random_covariance(rng, size)
    theta = ip.from_com(*random_body(rng)) + np.linalg.cholesky(covariance) @ rng.normal(size=10)
    projected, squared = project(theta, covariance)
    assert ip.is_physical(projected)
    assert squared == pytest.approx(distance(theta, projected, covariance), rel=1e-6, abs=1e-9)
    best = optimum(theta, covariance)
    assert squared >= best - 1e-4 * (1.0 + best)
    assert np.sqrt(squared) <= 1.15 * np.sqrt(best) + 0.05


def test_a_physical_body_is_left_as_it_is() -> None:
    rng = np.random.default_rng(0)
    theta = ip.from_com(*random_body(rng))
    projected, squared = project(theta, random_covariance(rng, 1.0))
    np.testing.assert_array_equal(projected, theta)
    assert squared == 0.0


@pytest.mark.parametrize(
    "theta",
    [
        np.zeros(10),
        -ip.from_com(3.0, np.array([0.1, 0.0, 0.2]), 0.01 * np.eye(3)),
        np.array([1e-6, 5.0, -5.0, 5.0, 1.0, 1.0, -1.0, 0.0, 0.0, 0.0]),
        1e3 * np.ones(10),
    ],
    ids=["nothing", "negative", "centre far away", "absurd"],
)
@pytest.mark.parametrize("size", [1e-3, 1.0])
def test_far_from_any_body(theta: FloatArray, size: float) -> None:
    covariance = random_covariance(np.random.default_rng(1), size)
    projected, squared = project(theta, covariance)
    assert ip.is_physical(projected)
    assert np.isfinite(squared)
    assert np.sqrt(squared) <= 1.3 * np.sqrt(optimum(theta, covariance)) + 0.05


def test_inputs_are_not_changed() -> None:
    theta, covariance = -np.ones(10), np.diag(SCALE**2)
    project(theta, covariance)
    np.testing.assert_array_equal(theta, -np.ones(10))
    np.testing.assert_array_equal(covariance, np.diag(SCALE**2))


@pytest.mark.parametrize(
    "covariance", [np.zeros((10, 10)), -np.eye(10), np.full((10, 10), np.nan)], ids=["zero", "negative", "not finite"]
)
def test_without_a_metric_there_is_no_nearest_body(covariance: FloatArray) -> None:
    theta, squared = project(-np.ones(10), covariance)
    np.testing.assert_array_equal(theta, -np.ones(10))
    assert np.isnan(squared)
