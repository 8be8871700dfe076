"""Intervals of the identified parameters: they must hold the truth as often as they say, also where the noise is coloured."""

from __future__ import annotations

import numpy as np
import pytest
from arm_recordings import hidden_parameters, recorded
from robots import robot, urdf

from sysid_ros.identification import collect_rows, free_model, identify_recordings
from sysid_ros.identification.base_groups import base_of_range, group_matrix
from sysid_ros.identification.coloured_noise import root_of_covariance, whiteness
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import METHODS, fit
from sysid_ros.identification.spectrum import choose_cutoff
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

MODEL = robot("iiwa")


def normalised_errors(seeds: range, colour: float, method: str = "irls", **options: float) -> tuple[FloatArray, FloatArray]:
    """Error over standard deviation of base parameters, and the ratio of the standard deviation to the Cramér-Rao bound."""
    model = free_model(MODEL)
    prior, T = Prior.of(model), group_matrix(base_of_range(model))
    errors, ratios = [], []
    for seed in seeds:
        truth = hidden_parameters(MODEL, seed)
        recording = recorded(MODEL, truth, seed, colour=colour, **options)  # type: ignore[arg-type]
        rows = collect_rows(model, recording, "", choose_cutoff([recording], MODEL.joint_names).hz)
        found = fit([rows], prior.mean, prior.std, method)
        std = np.sqrt(np.diag(T @ found.covariance @ T.T))
        errors.append(T @ (found.theta - truth) / std)
        ratios.append(std / np.sqrt(np.diag(T @ found.bound @ T.T)))
    return np.array(errors), np.array(ratios)


@pytest.mark.slow
@pytest.mark.parametrize("colour", [0.0, 0.98])
@pytest.mark.parametrize("rate", [250.0])
def test_intervals_hold_the_truth_as_often_as_they_say(colour: float, rate: float) -> None:
    """100 seeds, base parameters of links, friction, rotors and offsets."""
    errors, _ = normalised_errors(range(1000, 1100), colour, rate=rate)
    inside = np.abs(errors) < 1.96
    assert 0.90 < inside.mean() < 0.98
    friction = base_of_range(free_model(MODEL)).independent >= 10 * MODEL.n
    assert friction.sum() > 20
    assert 0.90 < inside[:, friction].mean() < 0.98
    assert inside.mean(axis=0).min() > 0.8


@pytest.mark.parametrize("colour", [0.0, 0.98])
def test_a_few_seeds_of_the_intervals(colour: float) -> None:
    errors, ratios = normalised_errors(range(4), colour, seconds=20.0)
    inside = np.mean(np.abs(errors) < 1.96)
    assert 0.85 < inside <= 1.0
    assert 0.7 < np.sqrt(np.mean(errors**2)) < 1.3
    if colour:
        assert np.median(ratios) > 1.3  # white residuals of this power would have told more
    else:
        assert np.all(ratios > 0.75)
        assert np.median(ratios) < 1.25


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_the_parameters(method: str) -> None:
    errors, _ = normalised_errors(range(7, 8), 0.0, method, seconds=15.0)
    assert np.sqrt(np.mean(errors**2)) < 1.6


def test_a_robust_loss_is_not_moved_by_outliers() -> None:
    from dataclasses import replace

    model = free_model(MODEL)
    prior = Prior.of(model)
    truth = hidden_parameters(MODEL, 3)
    rows = collect_rows(model, recorded(MODEL, truth, 3, seconds=15.0, torque_noise=0.05), "")
    rng = np.random.default_rng(0)
    spoilt = rows.y + np.where(rng.random(rows.y.shape) < 0.05, 20.0 * rng.normal(size=rows.y.shape), 0.0)
    friction = slice(70, 84)
    worst = {}
    for method in ("irls", "robust"):
        found = fit([replace(rows, y=spoilt)], prior.mean, prior.std, method)
        worst[method] = float(np.abs(found.theta - truth)[friction].max())
    assert worst["robust"] < 0.3 * worst["irls"]
    assert worst["robust"] < 0.15


def test_two_bags_with_different_noise_weigh_differently() -> None:
    model = free_model(MODEL)
    prior, truth = Prior.of(model), hidden_parameters(MODEL, 5)
    quiet = collect_rows(model, recorded(MODEL, truth, 5, seconds=15.0, torque_noise=0.05), "quiet")
    loud = collect_rows(model, recorded(MODEL, truth, 6, seconds=15.0, torque_noise=2.0), "loud")
    both, alone = fit([quiet, loud], prior.mean, prior.std), fit([quiet], prior.mean, prior.std)
    assert np.all(both.weight[0] > 100.0 * both.weight[1])
    std = np.sqrt(np.diag(alone.covariance))
    assert np.all(np.abs(both.theta - alone.theta) < 3.0 * std + 1e-9)


@pytest.mark.parametrize("colour", [0.0, 0.7])
def test_the_whiteness_test_is_right_as_often_as_it_says(colour: float) -> None:
    from scipy import signal

    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(200):
        noise = signal.lfilter([1.0], [1.0, -colour], rng.normal(size=500))
        _, p_value, first = whiteness(noise, 20)
        refused += p_value < 0.05
        assert abs(first - colour) < 0.25
    if colour:
        assert refused == 200
    else:
        assert 1 <= refused <= 25


def test_the_whiteness_test_skips_what_is_missing() -> None:
    rng = np.random.default_rng(1)
    noise = rng.normal(size=2000)
    noise[rng.random(2000) < 0.4] = np.nan
    assert whiteness(noise, 20)[1] > 0.001
    assert np.isnan(whiteness(np.full(100, np.nan), 20)[1])


@pytest.mark.slow
@pytest.mark.parametrize("robot_name", ["small_arm", "tree_robot"])
def test_groups_of_sliding_and_branched_arms_hold_the_truth(robot_name: str) -> None:
    """The whole way from recordings: checks, cut-off, two bags, groups with their intervals."""
    whole = robot(robot_name)
    model = RobotModel.from_urdf(urdf(robot_name), [j for j in whole.joint_names if j != "grip"])  # too slow for its friction
    truth = hidden_parameters(model, 3)
    bags = [recorded(model, truth, k, seconds=25.0, torque_noise=0.1) for k in (1, 2)]
    result = identify_recordings(model, bags, [], {})
    value = dict(zip(result.names, truth, strict=True))
    errors = np.array([(g.value - value[g.name] - sum(c * value[n] for c, n in g.terms)) / g.std for g in result.groups])
    assert np.mean(np.abs(errors) < 1.96) > 0.85
    assert np.abs(errors).max() < 4.5
    assert result.problems == ()
    assert {r.name for r in result.repeatability} <= {g.words for g in result.groups}
    assert len(result.repeatability) > 20
    for r in result.repeatability:
        assert r.between < 6.0 * r.within


def test_root_of_a_covariance_of_parameters_in_units_of_any_size() -> None:
    """A direction that no row shows is as sure as before the data, whatever rounding makes of the information."""
    random = np.random.default_rng(0)
    units = 10.0 ** random.uniform(-6.0, 6.0, 12)
    rows = random.normal(size=(400, 8)) @ random.normal(size=(8, 12)) * 1e4 / units
    information = rows.T @ rows
    prior = np.diag(1.0 / units**2)
    root = root_of_covariance(prior, information)
    scaled = root / units[:, None]
    covariance = scaled @ scaled.T
    exact = np.linalg.svd(rows * units, full_matrices=True)
    variances = 1.0 / (1.0 + np.concatenate([exact[1], np.zeros(4)])[:12] ** 2)
    np.testing.assert_allclose(np.linalg.eigvalsh(covariance)[-4:], 1.0, rtol=1e-3)  # rounding of an information of 1e12
    np.testing.assert_allclose(covariance, (exact[2].T * variances) @ exact[2], atol=1e-3)
