"""Identification: base parameters against an independent rank, and what a simulation hides is found within its intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from arm_recordings import hidden_parameters, recorded
from motions import Motion, measurements
from robots import ROBOTS, random_sample, robot, urdf

from sysid_ros.effects import CoulombFriction, Effect, LinkInertia, Payload, RotorInertia, TorqueOffset, ViscousFriction
from sysid_ros.exceptions import DataError
from sysid_ros.identification import (
    BagRows,
    BaseParameters,
    Choices,
    Identification,
    collect_rows,
    free_model,
    identify,
    identify_recordings,
)
from sysid_ros.identification.least_squares import fit, noise_density
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample

MODEL = robot("iiwa")
VISCOUS = np.array([2.0, 2.0, 1.5, 1.5, 0.8, 0.5, 0.3])
COULOMB = np.array([1.5, 1.5, 1.0, 1.0, 0.6, 0.4, 0.3])
ROTOR = np.array([0.5, 0.5, 0.3, 0.3, 0.1, 0.05, 0.02])
OFFSET = np.array([0.4, -0.3, 0.2, -0.2, 0.1, 0.0, 0.05])


def causes(model: RobotModel = MODEL) -> list[tuple[Effect, FloatArray]]:
    return [
        (ViscousFriction(model), VISCOUS),
        (CoulombFriction(model), COULOMB),
        (RotorInertia(model), ROTOR),
        (TorqueOffset(model), OFFSET),
    ]


def recording(seed: int, seconds: float = 30.0, still: Sequence[str] = (), rate: float = 250.0, **options: float) -> BagRows:
    noise = {"torque_noise": 0.1, "encoder_noise": 1e-5} | options
    stream = measurements(Motion(MODEL, seed, speed=0.8, still=still), seconds, rate, causes(), **noise, seed=seed)  # type: ignore[arg-type]
    return collect_rows(free_model(MODEL), stream, f"bag {seed}")


def information(columns: list[FloatArray]) -> FloatArray:
    return np.asarray(np.sum([Y.T @ Y for Y in columns], axis=0))


def link_columns(model: RobotModel, count: int = 400) -> list[FloatArray]:
    rng, links = np.random.default_rng(0), LinkInertia(model)
    return [links.columns(random_sample(model, rng)) for _ in range(count)]


def svd_rank(columns: list[FloatArray]) -> int:
    """Rank of all rows, each column scaled to unit length; columns that are zero up to rounding do not count."""
    Y = np.concatenate(columns)
    size = np.linalg.norm(Y, axis=0)
    Y = Y[:, size > 1e-9 * size.max()]
    values = np.linalg.svd(Y / np.linalg.norm(Y, axis=0), compute_uv=False)
    return int(np.sum(values > 1e-9 * values[0]))


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_number_of_base_parameters_against_the_singular_values(robot_name: str) -> None:
    columns = link_columns(robot(robot_name))
    assert BaseParameters(information(columns)).rank == svd_rank(columns)


def test_an_arm_of_the_kukas_kind_has_43() -> None:
    """Seven revolute joints, the first vertical, neighbours at right angles (Gautier, Khalil 1990)."""
    assert BaseParameters(information(link_columns(MODEL))).rank == 43


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_base_parameters_explain_the_torque_of_all(robot_name: str) -> None:
    model = robot(robot_name)
    columns = link_columns(model)
    base = BaseParameters(information(columns))
    assert sorted([*base.independent, *base.dependent]) == list(range(10 * model.n))
    assert base.combination.shape == (base.rank, 10 * model.n - base.rank)
    theta = np.random.default_rng(1).normal(size=10 * model.n)
    grouped = theta[base.independent] + base.combination @ theta[base.dependent]
    for Y in link_columns(model, 30):
        np.testing.assert_allclose(Y[:, base.independent] @ grouped, Y @ theta, atol=1e-4 * np.abs(Y @ theta).max() + 1e-5)
    assert base.condition_number >= 1.0
    assert base.singular_values.shape == (base.rank,)


def test_base_parameters_do_not_depend_on_units() -> None:
    columns = link_columns(robot("small_arm"))
    scale = 10.0 ** np.random.default_rng(0).uniform(-2, 2, 40)
    assert BaseParameters(information([Y * scale for Y in columns])).rank == svd_rank(columns)


@pytest.fixture(scope="module")
def bags() -> list[BagRows]:
    return [recording(1), recording(2)]


@pytest.fixture(scope="module")
def result(bags: list[BagRows]) -> Identification:
    return identify(free_model(MODEL), bags, [recording(3, 15.0)], {"bags": ["1", "2"], "command": "test", "version": "0"})


def test_friction_rotors_and_offsets_are_found_within_their_intervals(result: Identification) -> None:
    inside, total = 0, 0
    for block, (effect, truth) in zip(result.model.effects[1:], causes(), strict=True):
        assert block.effect == effect.id
        assert block.names == effect.parameter_names
        assert block.covariance is not None
        std = np.sqrt(np.diag(block.covariance))
        assert np.all(np.abs(block.theta - truth) < 5.0 * std + 0.01)
        if block.effect != "rotor_inertia":  # of the first joints the URDF's links share it
            inside += int(np.sum(np.abs(block.theta - truth) < 1.96 * std))
            total += 7
            assert np.all(std < 0.15)
    assert inside / total > 0.8


def test_the_identified_model_predicts_what_it_has_not_seen(result: Identification) -> None:
    assert len(result.errors) == 2
    (validation,) = result.validation
    for error in (*result.errors, validation):
        assert error.residual.shape == error.torque.shape == error.nominal.shape == (7,)
        assert np.all(error.residual < 0.5 * error.nominal)
        assert np.all(error.residual < 0.1 * error.torque + 0.1)
    assert np.all(validation.residual < 0.15)  # the filtered noise and what the smooth sign function leaves


def test_what_is_found_is_consistent(result: Identification) -> None:
    model = free_model(MODEL)
    assert result.names == model.parameter_names
    assert result.units == model.units
    assert result.theta.shape == (model.p,)
    assert result.covariance.shape == (model.p, model.p)
    np.testing.assert_allclose(result.covariance, result.covariance.T)
    assert np.linalg.eigvalsh(result.covariance)[0] > 0.0
    assert result.base.rank <= model.p
    np.testing.assert_array_equal(np.concatenate([b.theta for b in result.model.effects]), result.theta)
    assert np.all(result.model.torque_std > 0.0)
    assert np.all(result.model.correlation_time > 0.0)
    assert np.all(result.model.correlation_time < 5.0)
    assert result.model.joints == MODEL.joint_names


def test_the_model_file_explains_the_torque_of_the_robot(result: Identification) -> None:
    from sysid_ros.torque.torque_model import TorqueModel

    known = TorqueModel(MODEL, [Payload(MODEL)], result.model.known_effects(MODEL))
    motion = Motion(MODEL, 9, speed=0.8)
    for t in np.linspace(0.0, 20.0, 40):
        q, v, a = (x[0] for x in motion(np.array([t])))
        truth = MODEL.rnea(q, v, a)
        sample = Sample(t, q, v, a, truth)
        truth = truth + np.sum([e.torque(sample, theta) for e, theta in causes()], axis=0)
        np.testing.assert_allclose(known.known_torque(sample), truth, atol=0.03 * np.abs(truth).max() + 0.1)


@pytest.mark.slow
def test_one_bag_is_held_out_by_halves(bags: list[BagRows]) -> None:
    result = identify(free_model(MODEL), bags[:1], [], {})
    assert [e.name.split("(")[1] for e in result.errors] == ["first half)", "second half)"]
    assert np.all(result.errors[1].residual < 0.3)


@pytest.mark.slow
def test_the_order_of_the_bags_does_not_matter(bags: list[BagRows], result: Identification) -> None:
    other = identify(free_model(MODEL), bags[::-1], [], {})
    std = np.sqrt(np.diag(result.covariance))
    np.testing.assert_allclose(other.theta, result.theta, atol=1e-6 * np.max(std) + 1e-6)


@pytest.mark.parametrize("still", [("lbr_iiwa_joint_3",), ("lbr_iiwa_joint_1", "lbr_iiwa_joint_7")])
def test_a_joint_that_never_moves(still: tuple[str, ...]) -> None:
    with pytest.raises(DataError) as caught:
        identify(free_model(MODEL), [recording(1, 8.0, still)], [], {})
    for name in MODEL.joint_names:
        assert (name in str(caught.value)) == (name in still)
    assert "record" in str(caught.value)


def test_a_joint_that_moves_in_one_of_the_bags_only(bags: list[BagRows]) -> None:
    """It is identified from the bag in which it moves, and the other bag spoils nothing."""
    result = identify(free_model(MODEL), [bags[0], recording(4, 10.0, ("lbr_iiwa_joint_3",))], [], {})
    friction = {b.effect: b for b in result.model.effects}
    assert abs(friction["viscous_friction"].theta[2] - VISCOUS[2]) < 0.15
    assert abs(friction["coulomb_friction"].theta[2] - COULOMB[2]) < 0.15
    assert np.isfinite(result.model.torque_std).all()
    assert np.isfinite(result.model.correlation_time).all()


def test_a_joint_that_moves_for_a_short_time_gets_no_undue_weight(bags: list[BagRows]) -> None:
    """Two seconds of motion are too few to know a joint's noise; it must not count as noise-free."""
    bag = bags[0]
    moving = bag.moving.copy()
    first = np.flatnonzero(moving[:, 6])
    moving[first[round(1.8 / bag.period) :], 6] = False
    assert moving[:, 6].mean() > 0.05
    short = replace(bag, moving=moving)
    result = identify(free_model(MODEL), [short], [], {})
    for block, (_, truth) in zip(result.model.effects[1:], causes(), strict=True):
        if block.effect in ("viscous_friction", "coulomb_friction"):
            np.testing.assert_allclose(block.theta[:6], truth[:6], atol=0.15)
    assert block.covariance is not None
    assert np.sqrt(block.covariance[6, 6]) > 0.003


def test_rows_of_a_recording(bags: list[BagRows]) -> None:
    bag = bags[0]
    count = len(bag.t)
    assert bag.Y.shape == (count, 7, free_model(MODEL).p)
    assert bag.y.shape == bag.tau.shape == bag.moving.shape == (count, 7)
    assert bag.moving.dtype == bool
    assert len(bag.t) * bag.period == pytest.approx(30.0, rel=0.03)
    np.testing.assert_allclose(np.diff(bag.t), bag.period, rtol=1e-3)


def test_rows_are_not_taken_across_gaps_and_jumps_of_time() -> None:
    stream = measurements(Motion(MODEL, 1), 12.0, 250.0, causes())
    whole = collect_rows(free_model(MODEL), stream, "whole")
    cut = [m for m in stream if not 105.0 < m.t < 106.0]
    rows = collect_rows(free_model(MODEL), cut, "cut")
    assert not np.any((rows.t > 105.0) & (rows.t < 106.1))
    assert len(rows.t) < len(whole.t)
    theta = np.concatenate([LinkInertia(MODEL).nominal, *(t for _, t in causes())])
    for bag in (whole, rows):
        assert np.abs(bag.y - bag.Y @ theta)[bag.moving].max() < 0.2


def test_a_recording_that_is_too_short() -> None:
    for seconds in (0.05, 0.2, 1.0):
        with pytest.raises(DataError, match=r"short\.mcap.*Record at least 10 s"):
            collect_rows(free_model(MODEL), measurements(Motion(MODEL, 1), seconds, 250.0, []), "short.mcap")
    with pytest.raises(DataError, match=r"empty\.mcap"):
        collect_rows(free_model(MODEL), [], "empty.mcap")


def plain_bag(seed: int, std: FloatArray, count: int = 4000) -> BagRows:
    rng = np.random.default_rng(seed)
    Y = rng.normal(size=(count, 2, 3))
    y = Y @ np.array([1.0, -2.0, 0.5]) + std * rng.normal(size=(count, 2))
    still = np.zeros((count, 2))
    return BagRows(
        "plain", 0.01 * np.arange(float(count)), 0.01, Y, y, y, np.ones((count, 2), dtype=bool), still, still, still, 25.0
    )


def test_weighted_least_squares_weighs_each_joint_by_its_noise() -> None:
    bag, std = plain_bag(0, np.array([0.1, 5.0])), np.full(3, 10.0)
    found = fit([bag], np.zeros(3), std)
    np.testing.assert_allclose(found.density[0], np.array([0.1, 5.0]) ** 2 * 0.01, rtol=0.4)
    quiet = np.linalg.lstsq(bag.Y[:, 0], bag.y[:, 0], rcond=None)[0]
    np.testing.assert_allclose(found.theta, quiet, atol=1e-3)
    assert np.all(np.sqrt(np.diag(found.covariance)) < 0.1 / np.sqrt(4000) * 1.6)


def test_rows_of_joints_that_stand_are_left_out() -> None:
    bag = plain_bag(0, np.array([0.1, 0.1]))
    spoilt = bag.y.copy()
    spoilt[1000:2000, 1] += 100.0
    moving = bag.moving.copy()
    moving[1000:2000, 1] = False
    other = replace(bag, y=spoilt, moving=moving)
    found = fit([other], np.zeros(3), np.full(3, 10.0))
    np.testing.assert_allclose(found.theta, [1.0, -2.0, 0.5], atol=0.02)
    assert np.all(noise_density(other, found.theta) < 1e-3)


def test_the_prior_decides_what_the_data_leave_open() -> None:
    bag = plain_bag(0, np.array([0.1, 0.1]))
    blind = bag.Y.copy()
    blind[:, :, 2] = 0.0
    y = blind @ np.array([1.0, -2.0, 0.5])
    other = replace(bag, Y=blind, y=y + 1e-3)
    found = fit([other], np.array([0.0, 0.0, 7.0]), np.array([10.0, 10.0, 0.3]))
    assert found.theta[2] == pytest.approx(7.0)
    assert np.sqrt(found.covariance[2, 2]) == pytest.approx(0.3)


def test_free_model_has_links_friction_rotors_and_offsets() -> None:
    model = free_model(RobotModel.from_urdf(urdf("small_arm")))
    assert [e.id for e in model.free] == [
        "link_inertia",
        "viscous_friction",
        "coulomb_friction",
        "rotor_inertia",
        "torque_offset",
    ]
    assert model.p == 14 * 4


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_links_that_the_urdf_states_right_are_kept(seed: int) -> None:
    """Ten seconds can't improve on the truth; what they seem to is chance."""
    model = robot("small_arm")
    right = recorded(model, hidden_parameters(model, seed, links=0.0), seed, seconds=10.0, torque_noise=0.1)
    elsewhere = recorded(model, hidden_parameters(model, seed, links=0.0), seed + 50, seconds=10.0, torque_noise=0.1)
    result = identify_recordings(model, [right], [elsewhere], {}, Choices(friction="coulomb"))
    (error,) = result.validation
    assert np.all(error.residual <= 1.02 * error.urdf_friction)
    assert result.prior.links == model.body_names
    assert min(result.prior.link_weights) == result.prior.weight
    assert sum(np.isinf(result.prior.link_weights)) >= model.n - 1


@pytest.mark.slow
def test_links_that_the_urdf_states_wrong_are_found() -> None:
    """On every joint that they load at all, and worse on none."""
    model = robot("small_arm")
    truth = hidden_parameters(model, 5, links=0.3)
    bags = [recorded(model, truth, seed, seconds=20.0, torque_noise=0.05) for seed in (5, 6)]
    result = identify_recordings(model, bags[:1], bags[1:], {}, Choices(friction="coulomb"))
    (error,) = result.validation
    assert np.all(error.residual <= 1.02 * error.urdf_friction)
    assert np.sum(error.residual < 0.5 * error.urdf_friction) >= 2
