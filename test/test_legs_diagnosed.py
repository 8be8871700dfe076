"""Diagnosis of robots on legs: what is hidden in one is named, a healthy one has nothing, and the rows are what is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sysid_ros.diagnosis.legs.corrected import Corrected, leg_model
from sysid_ros.diagnosis.legs.on_legs import diagnose_on_legs
from sysid_ros.diagnosis.result import Diagnosis
from sysid_ros.effects import EFFECTS, TRUNK_EFFECTS, LinkInertia
from sysid_ros.exceptions import DataError
from sysid_ros.floating.feet_along import balanced
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.trunk_channels import TrunkSetup

pytest.importorskip("pybullet_data", reason="PyBullet, which brings the quadruped, is not installed (extra sim)")

from test_legs_identified import BASE, LEGS, recording


def told(result: Diagnosis) -> list[str]:
    return [f.id for f in result.causes]


def noisy(run: Recording, seed: int) -> Recording:
    """With the noise of torques [0.05 N m]."""
    return replace(run, tau=run.tau + 0.05 * np.random.default_rng(seed).standard_normal(run.tau.shape))


def test_recordings_are_corrected_by_gain_and_delay() -> None:
    run = recording(3)
    late = np.stack([np.interp(run.t - 0.01, run.t, x) for x in run.tau.T], axis=1)
    gain = np.linspace(0.8, 1.3, LEGS.n)
    by = replace(Corrected.nothing(leg_model(BASE, None)), gain=gain, delay=0.01)
    again = by.of(replace(run, tau=late * gain))
    inside = slice(20, -20)
    assert np.abs(again.tau - run.tau)[inside].max() < 0.02 * np.abs(run.tau).max()


def test_the_balanced_torques_carry_the_robot_and_are_the_nearest() -> None:
    rng = np.random.default_rng(0)
    matrix: FloatArray = rng.normal(size=(5, FREE, LEGS.n))
    tau, rigid = np.hstack([np.zeros((5, FREE)), rng.normal(size=(5, LEGS.n))]), rng.normal(size=(5, FREE + LEGS.n))
    out = balanced(matrix, tau, rigid)
    left = np.einsum("mij,mj->mi", matrix, out[:, FREE:] - rigid[:, FREE:]) - rigid[:, :FREE]
    assert np.abs(left).max() < 1e-6
    for A, change in zip(matrix, out[:, FREE:] - tau[:, FREE:], strict=True):
        rest = change - np.linalg.pinv(A) @ (A @ change)
        assert np.abs(rest).max() < 1e-6  # nothing of it in the null space


def test_another_place_of_a_link_is_the_derivative_of_its_parameters() -> None:
    from sysid_ros.robot import inertial_parameters

    effect = LinkInertia(BASE.robot, [BASE.robot.joint_names[FREE - 1]])
    place = next(c for c in effect.candidates_on_legs() if c.form == "place")
    assert place.basis is not None
    mass, com, inertia = inertial_parameters.to_com(effect.nominal)
    step = np.array([1e-5, -2e-5, 3e-5])
    moved = (
        inertial_parameters.from_com(mass, com + step, inertia) - inertial_parameters.from_com(mass, com - step, inertia)
    ) / 2
    np.testing.assert_allclose(place.basis @ step, moved, rtol=1e-6, atol=1e-12)
    assert effect.prior_std("place").shape == (3,)


def test_every_candidate_on_legs_has_forms_with_priors() -> None:
    for kind in {**EFFECTS, **TRUNK_EFFECTS}.values():
        if not kind.on_legs:
            continue
        settings = kind.settings_on_legs(BASE.trunk, BASE.contact_frames)
        effect = kind.from_settings(BASE.robot, [BASE.robot.joint_names[FREE]], settings)
        size = np.asarray(effect.usual_on_legs(5.0))
        assert np.all(size >= 0.0)
        for candidate in effect.candidates_on_legs():
            columns = effect.p if candidate.basis is None else candidate.basis.shape[1]
            assert len(effect.prior_std(candidate.form)) >= columns


def test_a_recording_without_an_imu_is_refused() -> None:
    with pytest.raises(DataError, match="IMU"):
        diagnose_on_legs(BASE, [replace(recording(1), trunk=None)])
    with pytest.raises(DataError, match="no recording"):
        diagnose_on_legs(BASE, [])


@pytest.mark.slow
def test_a_tilted_imu_is_named_with_its_size_and_nothing_else() -> None:
    tilt = np.array([0.04, -0.03, 0.02])
    result = diagnose_on_legs(BASE, [noisy(recording(5, TrunkSetup(tilt=tilt)), 5)])
    assert told(result) == ["imu_tilt"]
    (cause,) = result.causes
    assert cause.probability is not None
    assert cause.probability > 0.9
    for p, value in zip(cause.parameters, tilt, strict=True):
        assert p.low <= value <= p.high
    assert result.torque is not None
    assert np.all(result.torque.after < 0.5 * result.torque.before)
    assert result.model is not None
    assert [b.effect for b in result.model.effects].count("imu_tilt") == 1
    assert result.as_dict()["torque_rmse"]["units"] == ["N"] * 3 + ["N m"] * 3


@pytest.mark.slow
def test_nothing_is_told_of_a_healthy_robot() -> None:
    result = diagnose_on_legs(BASE, [noisy(recording(6), 6)])
    assert result.verdict == "nothing_wrong"
    assert not result.causes
    assert result.model is not None
    (links,) = (b for b in result.model.effects if b.effect == "link_inertia")
    np.testing.assert_allclose(links.theta[::10], BASE.robot.pi[::10], rtol=2e-3)  # not what its IMU or feet are off by


@pytest.mark.slow
def test_two_causes_are_both_named() -> None:
    run = noisy(recording(7, TrunkSetup(lever=np.array([0.05, 0.04, -0.03]))), 7)
    assert run.v is not None
    result = diagnose_on_legs(BASE, [replace(run, tau=run.tau + 0.3 * run.v)])
    assert {"imu_lever", "viscous_friction"} <= set(told(result))
