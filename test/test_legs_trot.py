"""Diagnosis of recordings of a trot, in both simulators: a healthy robot, one hidden cause, and torques that chatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sysid_ros.diagnosis.legs.on_legs import diagnose_on_legs
from sysid_ros.diagnosis.result import Diagnosis
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.input_gate import gate_for
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording

pytest.importorskip("pybullet_data", reason="PyBullet, which brings the quadruped, is not installed (extra sim)")
pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra sim)")

from sysid_ros.simulation import legged_gait
from sysid_ros.simulation.hidden_on_legs import Wish, hide_on_legs
from sysid_ros.simulation.legged_record import LeggedRecord, simulate_legged
from sysid_ros.simulation.legged_scenario import LeggedScenario
from sysid_ros.simulation.quadruped_record import QuadrupedRecord, simulate_quadruped
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario

pytestmark = pytest.mark.slow


def in_mujoco(seed: int) -> LeggedRecord:
    scenario = LeggedScenario(
        robot="go2", gait="trot", seed=seed, duration=20.0, encoder_step=1e-4, imu_rate=250, mass_error=0.02
    )
    return simulate_legged(scenario, start_time=1000.0)


def in_pybullet(seed: int) -> QuadrupedRecord:
    return simulate_quadruped(QuadrupedScenario(gait="trot", seed=seed, duration=20.0, encoder_noise=1e-4), start_time=1000.0)


def diagnosed(record: LeggedRecord | QuadrupedRecord, joint: int = 0, gain: float = 1.0) -> Diagnosis:
    """With the torque of a joint times a gain."""
    base = FloatingBase(RobotModel.from_urdf(record.urdf))
    gate = gate_for(base.legs, base, OnlineSettings())
    run = Recording.from_measurements("trot", (m for x in record.records() for m in gate.take(x)))
    tau = run.tau.copy()
    tau[:, joint] *= gain
    return diagnose_on_legs(base, [replace(run, tau=tau)])


@pytest.mark.parametrize("simulate", [in_mujoco, in_pybullet])
def test_nothing_is_told_of_a_healthy_trot(simulate: object) -> None:
    assert callable(simulate)
    assert not diagnosed(simulate(506)).causes


@pytest.mark.parametrize("simulate", [in_mujoco, in_pybullet])
def test_a_wrong_gain_is_told_first_from_a_trot(simulate: object) -> None:
    assert callable(simulate)
    record = simulate(507)
    causes, joint = diagnosed(record, joint=4, gain=1.25).causes, RobotModel.from_urdf(record.urdf).joint_names[4]
    assert causes[0].id == "torque_scale"
    assert causes[0].joints == (joint,)


def test_a_bias_of_the_accelerometer_makes_no_trunk_of_another_inertia() -> None:
    """While the trunk stays level a bias and a tilt are alike, and a first correction by both is taken back for the one that is
    told: by what was recorded, not by its slope."""
    for seed in (700, 709):
        found = diagnosed(hide_on_legs(in_pybullet(seed), [Wish("accelerometer_bias", size=0.5)]))
        assert [cause.id for cause in found.causes] == ["accelerometer_bias"]


def test_torques_that_chatter_make_no_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    """A controller that answers the forces of its own step chatters at half of its rate, which messages at that rate show as
    torques that do not act: much is left that nothing explains, and no foot has another radius."""
    monkeypatch.setattr(legged_gait, "_FELT", 1e-9)
    for seed in (501, 500):
        record = in_mujoco(seed)
        tau = np.stack([x.tau for x in record.measured])
        found = diagnosed(record)
        assert np.abs(np.diff(tau, axis=0)).max() > 20.0
        assert not found.causes
    assert "not those that act" in (found.refusal or "")
