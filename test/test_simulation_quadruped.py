"""The simulated quadruped: what it tells fulfils the equations of motion, and it keeps its feet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="PyBullet is not installed (extra sim)")

from sysid_ros.exceptions import SettingsError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.simulation.description import FEET, TRUNK, quadruped_description
from sysid_ros.simulation.quadruped_record import QuadrupedRecord, simulate_quadruped
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario

BACK = 0.057
"""Height of the back above the trunk's origin [m]."""
QUIET: dict[str, Any] = {
    "encoder_noise": 0.0,
    "velocity_noise": 0.0,
    "torque_noise": 0.0,
    "gyro_noise": 0.0,
    "accelerometer_noise": 0.0,
}
LOAD: dict[str, Any] = {"payload_mass": 3.0, "payload_com": (0.06, -0.03, BACK + 0.06)}


def base() -> FloatingBase:
    return FloatingBase(RobotModel.from_urdf(quadruped_description()), FEET)


def residuals(record: QuadrupedRecord, normal: FloatArray) -> FloatArray:
    """Inverse dynamics of legs, trunk and load minus torques and the simulator's own contact forces, shape (N, 18)."""
    robot = base()
    truth = record.truth["payload"]
    theta = np.zeros(10) if truth is None else np.array(truth["theta"])
    frame = robot.robot.frame_id(TRUNK)
    states, h = record.exact, 1.0 / record.truth["rate"]
    out = []
    for before, now, after in zip(states, states[1:], states[2:], strict=False):
        a = (after.q - 2.0 * now.q + before.q) / h**2
        omega_dot = (after.omega - before.omega) / (2.0 * h)
        q, v, a = robot.state(now.q, now.v, a, now.omega, now.specific_force, omega_dot)
        wrench = robot.robot.rnea(q, v, a) + robot.robot.payload_regressor(q, v, a, frame) @ theta
        _, jacobians = robot.contacts.jacobians(q)
        up = _matrix(now.orientation).T @ normal
        for radius, jacobian, force in zip(robot.foot_radius, jacobians, now.forces, strict=True):
            point = -radius * up
            wrench = wrench - jacobian[:3].T @ force - jacobian[3:].T @ np.cross(point, force)
        wrench[FREE:] -= now.tau
        out.append(wrench)
    return np.array(out)


def _matrix(quaternion: FloatArray) -> FloatArray:
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.parametrize(("gait", "load", "slope"), [("sway", False, 0.0), ("sway", True, 8.0)], ids=lambda x: str(x))
def test_what_is_told_fulfils_the_equations_of_motion(gait: str, load: bool, slope: float) -> None:
    scenario = QuadrupedScenario(
        gait=gait, duration=1.0, rate=1000, slope=slope, slope_heading=40.0, **QUIET, **(LOAD if load else {})
    )
    record = simulate_quadruped(scenario)
    error = residuals(record, scenario.ground[:, 2])
    assert np.abs(error).max() < 0.05  # N and N m, of forces of some 120 N
    assert np.abs(error.mean(axis=0)).max() < 0.005


@pytest.mark.slow
def test_a_trot_fulfils_them_on_average_across_its_impacts() -> None:
    scenario = QuadrupedScenario(gait="trot", duration=2.0, rate=1000, **QUIET, **LOAD)
    error = residuals(simulate_quadruped(scenario), scenario.ground[:, 2])
    assert np.abs(error.mean(axis=0)).max() < 0.05
    assert np.sqrt((error**2).mean(axis=0)).max() < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("slope", [0.0, 10.0])
def test_a_trot_keeps_its_feet_and_gets_somewhere(slope: float) -> None:
    scenario = QuadrupedScenario(gait="trot", duration=3.0, slope=slope, slope_heading=70.0, seed=3, **LOAD)
    record = simulate_quadruped(scenario)
    contacts = np.array([state.contacts for state in record.exact[500:]])
    assert (contacts.sum(axis=1) >= 2).mean() > 0.95
    assert np.all((contacts.mean(axis=0) > 0.4) & (contacts.mean(axis=0) < 0.8))
    # each foot lifts about twice a second
    assert np.all(np.diff(contacts, axis=0).clip(min=0).sum(axis=0) >= 3)


@pytest.mark.slow
def test_noise_is_added_to_what_is_told_and_the_motion_does_not_depend_on_it() -> None:
    quiet = simulate_quadruped(QuadrupedScenario(duration=1.0, gait="sway", **QUIET))
    noisy = simulate_quadruped(QuadrupedScenario(duration=1.0, gait="sway", torque_noise=0.3, accelerometer_bias=(0.1, 0.0, 0.0)))
    assert np.array_equal([s.q for s in quiet.measured], [s.q for s in noisy.exact])
    assert np.array_equal([s.tau for s in quiet.measured], [s.tau for s in quiet.exact])
    tau = np.array([a.tau - b.tau for a, b in zip(noisy.measured, noisy.exact, strict=True)])
    assert tau.std() == pytest.approx(0.3, rel=0.05)
    force = np.array([a.specific_force - b.specific_force for a, b in zip(noisy.measured, noisy.exact, strict=True)])
    assert force.mean(axis=0) == pytest.approx([0.1, 0.0, 0.0], abs=0.01)


def test_the_box_is_put_on_and_taken_off_when_the_truth_says() -> None:
    record = simulate_quadruped(QuadrupedScenario(duration=2.0, pick_time=0.6, drop_time=1.4, **QUIET, **LOAD), start_time=100.0)
    assert [event["kind"] for event in record.truth["events"]] == ["pick", "drop"]
    assert record.truth["pick_time"] == pytest.approx(100.6)
    t = np.array([state.t for state in record.exact])
    weight = np.array([state.forces[:, 2].sum() for state in record.exact])
    empty, loaded = base().mass * 9.81, (base().mass + 3.0) * 9.81
    assert weight[t < 0.5].mean() == pytest.approx(empty, rel=1e-3)
    assert weight[(t > 1.2) & (t < 1.4)].mean() == pytest.approx(loaded, rel=0.01)
    assert weight[t > 1.9].mean() == pytest.approx(empty, rel=0.01)


def test_a_lifted_foot_stays_in_the_air() -> None:
    record = simulate_quadruped(QuadrupedScenario(duration=1.0, lifted_foot=FEET[1], **QUIET))
    contacts = np.array([state.contacts for state in record.exact])
    assert np.array_equal(contacts.mean(axis=0), [1.0, 0.0, 1.0, 1.0])


@pytest.mark.parametrize(
    "wrong",
    [
        {"gait": "gallop"},
        {"slope": 30.0},
        {"payload_mass": 3.0, "payload_com": (1.0, 0.0, 0.1)},
        {"pick_time": 3.0},
        {"rate": 30},
        {"lifted_foot": "nose"},
        {"payload_mass": float("nan")},
    ],
    ids=lambda x: ",".join(x),
)
def test_a_setting_that_is_not_allowed_is_named(wrong: dict[str, object]) -> None:
    with pytest.raises(SettingsError, match=next(reversed(wrong)) if "payload_com" in wrong else next(iter(wrong))):
        QuadrupedScenario(**wrong)  # type: ignore[arg-type]
