"""The weight of the prior and the error expected on other motions follow from what the recordings hold."""

from __future__ import annotations

import math

import numpy as np
import pytest
from arm_recordings import exact_torque, hidden_parameters, recorded
from motions import Motion
from robots import robot

from sysid_ros.identification.expected_error import ExpectedError
from sysid_ros.identification.free_effects import free_model
from sysid_ros.identification.held_out import Prior, Solvers
from sysid_ros.identification.least_squares import Fit
from sysid_ros.identification.link_posterior import LinkPosterior, link_posterior
from sysid_ros.identification.prior_weight import choose_weights, fitted
from sysid_ros.identification.rows import BagRows, collect_rows
from sysid_ros.sample import FloatArray

ARM = robot("small_arm")


def told_by(theta: FloatArray, seed: int, seconds: float = 12.0) -> tuple[list[BagRows], Fit, Solvers, LinkPosterior]:
    """One recording of the arm with these parameters, and what follows from it."""
    model = free_model(ARM)
    recording = recorded(ARM, theta, seed, seconds=seconds, torque_noise=0.1, colour=0.98)
    bags = [collect_rows(model, recording, recording.name, 8.0)]
    prior = Prior.of(model)
    prior, found = fitted(model, bags, prior, "irls")
    solvers = Solvers.of(model, prior, found, False)
    return bags, found, solvers, link_posterior(bags, found, solvers)


@pytest.mark.parametrize("seed", [3, 4])
def test_links_far_from_the_urdf_lower_the_weight(seed: int) -> None:
    exact = told_by(hidden_parameters(ARM, seed, 0.0), seed)[3]
    far = told_by(hidden_parameters(ARM, seed, 0.4), seed)[3]
    assert far.weight < 0.1 * exact.weight
    assert exact.weight > 100.0


def test_links_that_only_hold_a_place_in_the_urdf_are_given_up() -> None:
    """A robot whose links weigh fifty times what its URDF says, as one whose load or whose links nobody entered."""
    theta = hidden_parameters(ARM, 3, 0.0)
    theta[: 10 * ARM.n] *= 50.0
    bags, found, solvers, posterior = told_by(theta, 3)
    assert posterior.weight < 0.1
    expected = ExpectedError(bags, found, solvers, posterior)
    weights = choose_weights(expected.compare, ARM.n)
    assert weights.min() < 0.1
    q, v, a = Motion(ARM, 77, speed=0.8)(np.arange(2000) / 100.0)
    truth = exact_torque(ARM, theta, q, v, a)
    error = exact_torque(ARM, solvers.approximate(found.information, found.score, weights), q, v, a) - truth
    assert np.linalg.norm(error) < 0.01 * np.linalg.norm(truth)


def test_the_posterior_is_a_covariance_and_no_wider_than_the_prior() -> None:
    _, _, solvers, posterior = told_by(hidden_parameters(ARM, 5, 0.2), 5)
    values = np.linalg.eigvalsh(posterior.covariance)
    assert values[0] > -1e-9 * values[-1]
    rest = ~solvers.prior.is_link
    assert np.all(np.sqrt(np.diag(posterior.covariance))[rest] <= solvers.prior.std[rest] * (1.0 + 1e-9))


def test_what_is_expected_elsewhere_comes_about() -> None:
    """Links off by up to 60 %: the URDF's are expected to be far worse on other motions than what was identified, and are."""
    theta = hidden_parameters(ARM, 6, 0.4)
    bags, found, solvers, posterior = told_by(theta, 6, 20.0)
    expected = ExpectedError(bags, found, solvers, posterior)
    ratio, worst = expected.compare(np.full(ARM.n, posterior.weight))
    np.testing.assert_array_equal(np.stack(expected.compare(np.full(ARM.n, math.inf))), np.ones((2, ARM.n)))
    assert np.all(worst >= ratio)
    q, v, a = Motion(ARM, 77, speed=0.8)(np.arange(2000) / 100.0)
    moving = np.abs(v).min(axis=1) > 0.05
    truth = exact_torque(ARM, theta, q[moving], v[moving], a[moving])
    errors = [
        np.mean(
            (exact_torque(ARM, solvers.approximate(found.information, found.score, w), q[moving], v[moving], a[moving]) - truth)
            ** 2,
            axis=0,
        )
        for w in (posterior.weight, math.inf)
    ]
    gains = ratio < 0.5
    assert gains.any()
    assert np.all(errors[0][gains] < errors[1][gains])
