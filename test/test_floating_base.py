"""A floating base: the model of the trunk's six joints, the projection onto the null space of the contacts, and the gate."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from robots import urdf

from sysid_ros.effects import AccelerometerBias
from sysid_ros.exceptions import RobotModelError
from sysid_ros.floating.contact_projection import ContactProjection
from sysid_ros.floating.floating_base import FloatingBase, floating_base_of, is_legged
from sysid_ros.floating.trunk_rows import StandingColumns
from sysid_ros.input_gate import FloatingGate
from sysid_ros.input_gate.health import Level
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, ContactRecord, FloatArray, ImuRecord, JointStateRecord, Measurement, Sample, TrunkReading
from sysid_ros.signals.floating_derivative import FloatingDerivative

pytest.importorskip("pybullet_data", reason="PyBullet, which brings the quadruped, is not installed (extra sim)")

from sysid_ros.simulation.description import quadruped_description

QUADRUPED_URDF = quadruped_description()
LEGS = RobotModel.from_urdf(QUADRUPED_URDF)
BASE = FloatingBase(LEGS)
UP = np.array([0.0, 0.0, 9.81])


def random_state(rng: np.random.Generator) -> dict[str, FloatArray]:
    n = LEGS.n
    low, high = np.clip(LEGS.position_lower, -1.5, 1.5), np.clip(LEGS.position_upper, -1.5, 1.5)
    return {
        "q": low + (high - low) * rng.uniform(0.2, 0.8, n),
        "v": rng.normal(0.0, 1.0, n),
        "a": rng.normal(0.0, 5.0, n),
        "omega": rng.normal(0.0, 1.0, 3),
        "force": UP + rng.normal(0.0, 2.0, 3),
        "omega_dot": rng.normal(0.0, 3.0, 3),
    }


@pytest.mark.parametrize("seed", range(5))
def test_six_joints_give_the_inverse_dynamics_of_a_free_flyer_whatever_its_velocity_place_and_heading(seed: int) -> None:
    rng = np.random.default_rng(seed)
    s = random_state(rng)
    model = pin.buildModelFromXML(QUADRUPED_URDF, pin.JointModelFreeFlyer())
    rotation, velocity = pin.exp3(rng.normal(0.0, 1.0, 3)), rng.normal(0.0, 2.0, 3)
    q = np.concatenate([rng.normal(0.0, 3.0, 3), pin.Quaternion(rotation).coeffs(), s["q"]])
    v = np.concatenate([velocity, s["omega"], s["v"]])
    acceleration = s["force"] + rotation.T @ model.gravity.linear  # of the origin, in the trunk's axes
    spatial = acceleration - np.cross(s["omega"], velocity)
    expected = pin.rnea(model, model.createData(), q, v, np.concatenate([spatial, s["omega_dot"], s["a"]]))
    assert BASE.robot.rnea(*BASE.state(**s)) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_basis_removes_any_force_on_the_feet_and_the_forces_are_read_from_the_torques(seed: int) -> None:
    rng = np.random.default_rng(seed)
    s = random_state(rng)
    q, v, a = BASE.state(**s)
    projection = ContactProjection(BASE)
    forces = np.column_stack([rng.normal(0.0, 10.0, (4, 2)), rng.uniform(20.0, 60.0, 4)])
    sample = Sample(1.0, q, v, a, np.zeros(BASE.robot.n))
    normal = projection.update(sample, np.zeros(BASE.robot.n), None).normal.copy()
    _, jacobians = BASE.contacts.jacobians(q)
    external = np.zeros(BASE.robot.n)
    for radius, jacobian, force in zip(BASE.foot_radius, jacobians, forces, strict=True):
        external += jacobian[:3].T @ force + jacobian[3:].T @ np.cross(-radius * normal, force)
    out = np.zeros((FREE, 1))
    projection.apply(external[:, None], out)
    assert np.abs(out).max() < 1e-2 * np.abs(external).max()  # what the damping of stretched legs leaves
    # tau = rnea - J' f, so what is left of the torques of the legs is -J' f
    read = projection.update(sample, -external, None).forces
    assert read == pytest.approx(forces, rel=0.05, abs=1.0)


def test_rows_that_are_weighed_have_noise_that_is_not_correlated() -> None:
    rng = np.random.default_rng(0)
    q, v, a = BASE.state(**random_state(rng))
    sample = Sample(1.0, q, v, a, np.zeros(BASE.robot.n))
    joint, beside = rng.uniform(0.5, 2.0, LEGS.n), np.array([0.3, 0.4, 0.5, 0.0, 0.0, 0.0])
    plain, weighed = ContactProjection(BASE), ContactProjection(BASE)
    weighed.weigh(joint, beside)
    plain.update(sample, np.zeros(BASE.robot.n), None)
    weighed.update(sample, np.zeros(BASE.robot.n), None)
    rows = rng.normal(size=(BASE.robot.n, 5))
    one, other = np.zeros((FREE, 5)), np.zeros((FREE, 5))
    plain.apply(rows, one)
    weighed.apply(rows, other)
    assert weighed.wrench(other[:, 0]) == pytest.approx(one[:, 0])
    whitening = np.zeros((FREE, FREE))
    weighed.apply(np.vstack([np.eye(FREE), np.zeros((LEGS.n, FREE))]), whitening)
    noise = weighed.matrix * joint @ weighed.matrix.T + np.diag(beside)
    covariance = whitening @ noise @ whitening.T
    scale = np.sqrt(covariance.diagonal())
    assert covariance / np.outer(scale, scale) == pytest.approx(np.eye(FREE), abs=1e-6)
    assert np.diag(whitening) == pytest.approx(1.0)


@pytest.mark.parametrize("frame", [BASE.trunk, "FL_toe"])
def test_a_bias_of_the_accelerometer_costs_what_the_inverse_dynamics_say(frame: str) -> None:
    rng = np.random.default_rng(1)
    q, v, a = BASE.state(**random_state(rng))
    theta, bias, robot = rng.normal(size=10), rng.normal(size=3), BASE.robot
    told = a.copy()
    told[:3] += bias
    effect = AccelerometerBias(robot, frame=frame)
    effect.load = theta
    index = robot.frame_id(frame)

    def torque(acceleration: FloatArray) -> FloatArray:
        return robot.rnea(q, v, acceleration) + robot.payload_regressor(q, v, acceleration, index) @ theta

    expected = torque(a) - torque(told)
    assert effect.torque(Sample(0.0, q, v, told, expected), bias) == pytest.approx(expected, abs=1e-9)


def test_the_specific_force_is_moved_from_the_imu_to_the_trunk() -> None:
    """A trunk that turns about its origin at a growing rate: the IMU beside it feels the lever, the origin only gravity."""
    place, h = np.array([0.1, -0.05, 0.03]), 0.002
    derivative = FloatingDerivative(BASE.robot.n, h, 5)
    samples: list[Sample] = []
    q = np.zeros(LEGS.n) + 0.5 * (np.clip(LEGS.position_lower, -1, 1) + np.clip(LEGS.position_upper, -1, 1))
    for k in range(60):
        t = k * h
        omega, omega_dot = np.array([0.3, 4.0 * t, -2.0 * t]), np.array([0.0, 4.0, -2.0])
        felt = UP + np.cross(omega_dot, place) + np.cross(omega, np.cross(omega, place))
        samples += derivative.push(Measurement(t, q.copy(), None, np.zeros(LEGS.n), TrunkReading(omega, felt, place)))
    last = samples[-1]
    assert last.a[:3] == pytest.approx(UP, abs=1e-6)
    assert last.v[3:FREE] == pytest.approx([0.3, 4.0 * last.t, -2.0 * last.t], abs=1e-6)
    x, y, z = last.v[3:FREE]
    assert last.a[3:FREE] == pytest.approx(np.array([0.0, 4.0, -2.0]) - [y * z, -x * z, x * y], abs=1e-4)
    assert not last.q[:FREE].any()
    assert not last.tau[:FREE].any()


def test_noise_at_rest_adds_no_information() -> None:
    rng = np.random.default_rng(0)
    true = np.column_stack([UP, np.zeros(3)])
    standing = StandingColumns(0.01, 0.05)
    information = np.zeros((2, 2))
    for _ in range(3000):
        columns = standing.push(true + 0.1 * rng.standard_normal((3, 2)), np.full(18, 0.01))
        information += columns.T @ columns
    assert information[0, 0] == pytest.approx(3000 * 9.81**2, rel=0.01)
    assert information[1, 1] < 3000 * 0.1**2 * 3 / 20  # what single rows of noise would pretend is 3000 * 0.03


def test_columns_of_a_robot_that_was_not_on_its_feet_are_not_averaged() -> None:
    standing, still = StandingColumns(0.01, 0.05), np.zeros(3)
    for _ in range(100):
        assert not standing.push(np.zeros((3, 2)), still, whole=False).any()
    for _ in range(100):
        assert standing.push(np.ones((3, 2)), still) == pytest.approx(1.0)


def test_a_robot_on_legs_is_told_from_an_arm() -> None:
    assert is_legged(LEGS)
    assert not is_legged(RobotModel.from_urdf(urdf("small_arm")))
    assert floating_base_of(LEGS, OnlineSettings()) is not None
    assert floating_base_of(LEGS, OnlineSettings(base="fixed")) is None
    assert floating_base_of(RobotModel.from_urdf(urdf("small_arm")), OnlineSettings()) is None


def test_a_foot_that_the_urdf_lacks_and_one_that_no_leg_carries_are_named() -> None:
    with pytest.raises(RobotModelError, match=r"paw.*Correct contact_frames"):
        FloatingBase(LEGS, ["paw"])
    with pytest.raises(RobotModelError, match=rf"{BASE.trunk}.*0 joints"):
        FloatingBase(LEGS, [BASE.trunk])


class Stream:
    """Messages of a robot that stands still, at 200 Hz."""

    def __init__(self, **settings: object) -> None:
        self.gate = FloatingGate(BASE, OnlineSettings(**settings))  # type: ignore[arg-type]
        self.measurements: list[Measurement] = []

    def run(
        self, count: int = 100, imu: bool = True, offset: float = 0.0, frame: str = "", force: FloatArray = UP, late: bool = False
    ) -> None:
        q = 0.5 * (np.clip(LEGS.position_lower, -1, 1) + np.clip(LEGS.position_upper, -1, 1))
        for k in range(count):
            t = 100.0 + 0.005 * k
            tau = 0.1 * np.sin(np.arange(LEGS.n) + k)
            joints = JointStateRecord(t, t, LEGS.joint_names, q, (), tau)
            trunk = ImuRecord(t + offset, t, frame or BASE.trunk, (0, 0, 0, 1), (0.01 * k, 0.0, 0.0), force)
            order: list[JointStateRecord | ImuRecord] = [joints, trunk] if late else [trunk, joints]
            for record in order if imu else [joints]:
                self.measurements += self.gate.take(record)


def test_a_measurement_finds_the_imu_of_its_stamp_and_waits_for_it() -> None:
    for late in (False, True):
        stream = Stream()
        stream.run(late=late)
        assert len(stream.measurements) == 100
        assert not stream.gate.counts
        for k, m in enumerate(stream.measurements):
            assert m.trunk is not None
            assert m.trunk.omega[0] == pytest.approx(0.01 * k)


def test_between_two_imu_messages_the_values_are_interpolated() -> None:
    stream = Stream()
    stream.run(offset=0.002)
    assert len(stream.measurements) >= 98
    found = [m.trunk.omega[0] for m in stream.measurements if m.trunk]
    expected = [0.01 * ((m.t - 100.0) / 0.005 - 0.4) for m in stream.measurements]
    assert found == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "reason", "cure"),
    [
        ({"imu": False}, "imu_missing", "--imu-topic"),
        ({"offset": 1.0}, "imu_stamps", "Synchronise the clocks"),
        ({"offset": -1.0}, "imu_stamps", "Synchronise the clocks"),
        ({"frame": "camera"}, "imu_frame", "Set imu_frame"),
        ({"force": np.full(3, np.nan)}, "imu_range", "publish rad/s"),
    ],
    ids=["none", "ahead", "behind", "frame", "nan"],
)
def test_an_imu_that_can_not_be_used_is_named_with_the_cure(arguments: dict[str, object], reason: str, cure: str) -> None:
    stream = Stream()
    stream.run(count=400, **arguments)  # type: ignore[arg-type]
    assert not stream.measurements
    assert stream.gate.counts[reason] > 100
    assert cure in stream.gate.last_texts[reason]
    health = stream.gate.health(102.0)
    assert health.level == Level.ERROR
    assert stream.gate.last_texts[max(stream.gate.counts, key=stream.gate.counts.__getitem__)] in health.text


def moving(gate: FloatingGate, repeats: int, frozen: float, seconds: float = 2.0) -> list[Measurement]:
    """Joints at 200 Hz that move at 0.5 rad/s, and an IMU that shows the time, each value so many times until ``frozen``."""
    found, omega = [], np.zeros(3)
    for k in range(round(200 * seconds)):
        t = 100.0 + 0.005 * k
        if k % repeats == 0 and t < 100.0 + frozen:
            omega = np.array([0.005 * k, 0.0, 0.0])
        tau = 0.1 * np.sin(np.arange(LEGS.n) + k)
        found += gate.take(ImuRecord(t, t, BASE.trunk, (0, 0, 0, 1), omega, UP))
        q = 0.5 * (np.clip(LEGS.position_lower, -1, 1) + np.clip(LEGS.position_upper, -1, 1)) + 0.5 * 0.005 * k - 0.5
        found += gate.take(JointStateRecord(t, t, LEGS.joint_names, q, (), tau))
    return found


def test_a_slower_imu_that_is_polled_is_interpolated_between_its_own_values() -> None:
    gate = FloatingGate(BASE, OnlineSettings())
    found = moving(gate, 5, 2.0)
    assert len(found) > 380
    assert [m.trunk.omega[0] for m in found if m.trunk] == pytest.approx([m.t - 100.0 for m in found], abs=1e-9)
    assert not gate.counts


def test_an_imu_that_is_frozen_while_the_legs_move_is_named_and_its_values_are_not_used() -> None:
    gate = FloatingGate(BASE, OnlineSettings())
    found = moving(gate, 1, 1.0)
    assert all(m.trunk is not None and m.trunk.omega[0] == pytest.approx(m.t - 100.0, abs=1e-9) for m in found)
    assert found[-1].t == pytest.approx(101.0, abs=0.011)
    assert gate.counts["imu_frozen"] > 150
    assert "repeats old ones" in gate.last_texts["imu_frozen"]
    assert gate.health(102.5).level == Level.ERROR


def test_an_imu_that_stands_still_on_a_robot_that_does_is_believed() -> None:
    stream = Stream()
    q, tau = 0.5 * (np.clip(LEGS.position_lower, -1, 1) + np.clip(LEGS.position_upper, -1, 1)), np.ones(LEGS.n)
    for k in range(400):
        t = 100.0 + 0.005 * k
        stream.measurements += stream.gate.take(ImuRecord(t, t, BASE.trunk, (0, 0, 0, 1), np.zeros(3), UP))
        stream.measurements += stream.gate.take(JointStateRecord(t, t, LEGS.joint_names, q, (), tau + 0.01 * k))
    assert len(stream.measurements) == 400
    assert not stream.gate.counts


def test_an_imu_that_has_paused_is_not_said_to_have_wrong_stamps() -> None:
    gate = FloatingGate(BASE, OnlineSettings())
    q = 0.5 * (np.clip(LEGS.position_lower, -1, 1) + np.clip(LEGS.position_upper, -1, 1))
    for k in range(200):
        t = 100.0 + 0.005 * k
        if not 50 <= k < 80:
            gate.take(ImuRecord(t, t, BASE.trunk, (0, 0, 0, 1), np.array([0.01 * k, 0.0, 0.0]), UP))
        gate.take(JointStateRecord(t, t, LEGS.joint_names, q, (), 0.1 * np.sin(np.arange(LEGS.n) + k)))
    assert gate.counts["imu_gap"] > 0


def test_an_imu_without_gravity_and_one_in_units_of_it_are_doubted() -> None:
    for force, word in ((0.01 * UP, "takes gravity out"), (UP / 9.81, "units of gravity")):
        stream = Stream()
        stream.run(count=400, force=force)
        assert any(word in sentence for sentence in stream.gate.warnings)
        assert stream.gate.health(102.0).level == Level.WARN


def test_where_the_imu_sits_may_be_set() -> None:
    stream = Stream(imu_xyz=(0.1, 0.0, 0.0), imu_rpy=(0.0, 0.0, np.pi / 2))
    stream.run(frame="camera")
    assert len(stream.measurements) == 100
    trunk = stream.measurements[50].trunk
    assert trunk is not None
    assert trunk.omega == pytest.approx([0.0, 0.5, 0.0], abs=1e-12)
    assert trunk.place == pytest.approx([0.1, 0.0, 0.0])


def test_contacts_of_the_wrong_length_are_named() -> None:
    gate = FloatingGate(BASE, OnlineSettings())
    gate.take(ContactRecord(1.0, (1.0, 0.0)))
    assert "contact_frames" in gate.last_texts["contacts_length"]
