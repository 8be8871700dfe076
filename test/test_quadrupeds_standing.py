"""Quadrupeds of other makers that stand on a slope: feet, joint order, names and size are the URDF's, and so is the answer."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.input_gate import gate_for
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.replay import Replay, replay
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, ContactRecord, FloatArray, ImuRecord, JointStateRecord

DESCRIPTIONS = [p / "share/example-robot-data/robots" for p in Path(pinocchio.__file__).parents]
# where its URDF is; angles of the hip, the thigh and the knee of a front leg [rad]; whether hind legs bend the other way
ROBOTS = {
    "go1": ("go1_description/urdf/go1.urdf", (0.05, 0.8, -1.6), False),
    "go2": ("go2_description/urdf/go2.urdf", (0.05, 0.8, -1.6), False),
    "b1": ("b1_description/urdf/b1.urdf", (0.05, 0.7, -1.5), False),
    "anymal": ("anymal_c_simple_description/urdf/anymal.urdf", (0.05, 0.6, -1.2), True),
    "solo": ("solo_description/robots/solo12.urdf", (0.05, 0.7, -1.4), True),
    "hyq": ("hyq_description/robots/hyq_no_sensors.urdf", (-0.05, 0.6, -1.2), True),
}
RATE = 200.0


def path_of(name: str) -> Path | None:
    return next((p for folder in DESCRIPTIONS if (p := folder / ROBOTS[name][0]).exists()), None)


def description(name: str) -> str:
    """The URDF without friction in its joints."""
    path = path_of(name)
    assert path is not None
    root = ElementTree.parse(path).getroot()
    for joint in root.findall("joint"):
        for element in joint.findall("dynamics"):
            joint.remove(element)
    return ElementTree.tostring(root, encoding="unicode")


every_robot = pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.skipif(path_of(n) is None, reason="pip install example-robot-data")) for n in ROBOTS],
)


@dataclass
class Standing:
    """A robot at rest on feet that are spheres, with a body on its trunk from ``pick`` on."""

    base: FloatingBase
    q: FloatArray
    up: FloatArray
    theta: FloatArray

    def torques(self, loaded: bool) -> FloatArray:
        """Least forces on the feet that hold robot and load, and the torques of the legs beneath them, (n - 6,) [N m]."""
        base, zero, still = self.base, np.zeros(3), np.zeros(self.q.size)
        state = base.state(self.q, still, still, zero, 9.81 * self.up, zero)
        wrench = base.robot.rnea(*state)
        if loaded:
            wrench = wrench + base.robot.payload_regressor(*state, base.robot.frame_id(base.trunk)) @ self.theta
        _, jacobians = base.contacts.jacobians(state[0])
        centres, _ = base.contacts.origins(state[0])
        normal = np.linalg.svd(centres - centres.mean(axis=0))[2][2]
        levers = -base.foot_radius[:, None] * normal * np.sign(normal[2]) + centres - base.contacts.jacobians(state[0])[0]
        points = [j[:3] + np.cross(j[3:].T, lever).T for j, lever in zip(jacobians, levers, strict=True)]
        J = np.concatenate(points)
        forces = np.linalg.lstsq(J[:, :FREE].T, wrench[:FREE], rcond=None)[0]
        return np.asarray(wrench[FREE:] - J[:, FREE:].T @ forces)

    def records(
        self,
        seconds: float = 9.0,
        pick: float = 6.0,
        bias: tuple[float, ...] = (0.0, 0.0, 0.0),
        seed: int = 0,
        noise: float = 1.0,
    ) -> list[ContactRecord | ImuRecord | JointStateRecord]:
        rng = np.random.default_rng(seed)
        out: list[ContactRecord | ImuRecord | JointStateRecord] = []
        torques = {loaded: self.torques(loaded) for loaded in (False, True)}
        names, feet = self.base.legs.joint_names, len(self.base.contact_frames)
        for k in range(round(seconds * RATE)):
            t = 10.0 + k / RATE
            tau = torques[t >= 10.0 + pick] + noise * 0.1 * rng.standard_normal(len(names))
            gyro, felt = 0.002 * rng.standard_normal(3), 9.81 * self.up + np.array(bias) + 0.02 * rng.standard_normal(3)
            out += [
                ContactRecord(t, np.ones(feet)),
                ImuRecord(t, t, self.base.trunk, (0.0, 0.0, 0.0, 1.0), gyro, felt),
                JointStateRecord(t, t, names, self.q + 1e-5 * rng.standard_normal(self.q.size), (), tau),
            ]
        return out


def standing(name: str, radius: float = 0.0) -> Standing:
    _, (hip, thigh, knee), mirrored = ROBOTS[name]
    base = FloatingBase(RobotModel.from_urdf(description(name)), foot_radius=radius)
    q = np.zeros(base.legs.n)
    for j, joint in enumerate(base.legs.joint_names):
        word = joint.lower()
        hind = "h" in word[:2]
        sign = -1.0 if mirrored and hind else 1.0
        q[j] = hip if "haa" in word or "hip" in word else sign * (thigh if "hfe" in word or "thigh" in word else knee)
    up = np.array([0.08, -0.05, 1.0])
    mass = 0.15 * base.mass
    size = 0.05 * base.mass ** (1.0 / 3.0)
    theta = inertial_parameters.from_com(mass, np.array([0.4, -0.2, 0.8]) * size, mass * size**2 * np.diag([0.3, 0.4, 0.5]))
    return Standing(base, q, up / np.linalg.norm(up), theta)


EXACT: dict[str, object] = {"estimate_friction": False, "link_mass_error": 0.0, "link_com_error": 0.0, "effort_gain_error": 0.0}
"""These legs have no friction, and descriptions and efforts are exact."""


def estimated(robot: Standing, records: list[ContactRecord | ImuRecord | JointStateRecord], **settings: object) -> Replay:
    chosen = OnlineSettings(**{**EXACT, **settings})  # type: ignore[arg-type]
    legs = RobotModel.from_urdf(robot.base.legs.urdf)
    estimation = OnlineEstimation(legs, chosen)
    return replay(records, gate_for(legs, estimation.base, chosen), estimation)


@every_robot
def test_standing_tells_the_mass_whatever_the_robot(name: str) -> None:
    robot = standing(name)
    result = estimated(robot, robot.records())
    final = result.final
    assert final.frame == robot.base.trunk
    assert final.mass == pytest.approx(robot.theta[0], rel=0.03)
    assert np.all(np.abs(final.theta - robot.theta)[:4] < 4.0 * final.std[:4])
    assert result.status == "ok"
    assert [event.kind for event in result.events] == ["pick"]
    before = [e for e in result.series if e.t < 15.9][-1]
    assert before.status == "no_payload"
    assert abs(before.mass) < 1.96 * before.mass_std
    assert not final.observable[4:].any()


@every_robot
def test_what_all_efforts_are_wrong_by_is_in_the_interval_of_the_mass(name: str) -> None:
    robot, gain = standing(name), 1.015
    records = [
        JointStateRecord(r.stamp, r.receive_time, r.names, r.position, (), gain * np.asarray(r.effort))
        if isinstance(r, JointStateRecord)
        else r
        for r in robot.records(seconds=5.0, pick=0.0)
    ]
    exact, usual = (estimated(robot, records, effort_gain_error=error).final for error in (0.0, 0.01))
    heavier = (gain - 1.0) * (robot.base.mass + robot.theta[0])
    assert exact.mass - robot.theta[0] == pytest.approx(heavier, rel=0.3)
    if robot.base.radius_told.all():
        assert abs(exact.mass - robot.theta[0]) > 3.0 * exact.mass_std
    assert usual.mass == pytest.approx(exact.mass, rel=1e-9)
    assert abs(usual.mass - robot.theta[0]) < 1.96 * usual.mass_std
    # what all gains have in common, and each of them by itself
    assert usual.mass_std > 0.01 * (robot.base.mass + robot.theta[0])


@pytest.mark.skipif(path_of("go1") is None, reason="pip install example-robot-data")
@pytest.mark.parametrize(("turned", "sign", "words"), [(True, 1.0, "imu_rpy"), (False, -1.0, "effort_scale")])
def test_feet_that_carry_the_robot_the_other_way_round_are_explained(turned: bool, sign: float, words: str) -> None:
    robot = standing("go1")
    records: list[ContactRecord | ImuRecord | JointStateRecord] = []
    for r in robot.records(seconds=4.0):
        if isinstance(r, ImuRecord) and turned:
            over = np.array([1.0, -1.0, -1.0])
            r = ImuRecord(r.stamp, r.receive_time, r.frame_id, r.orientation, over * r.omega, over * r.specific_force)
        elif isinstance(r, JointStateRecord):
            r = JointStateRecord(r.stamp, r.receive_time, r.names, r.position, (), sign * np.asarray(r.effort))
        records.append(r)
    result = estimated(robot, records)
    assert result.status == "stale"
    assert words in result.final.reason


@pytest.mark.skipif(path_of("go1") is None, reason="pip install example-robot-data")
def test_a_leg_that_is_stretched_tells_nothing_and_nothing_is_claimed() -> None:
    robot = standing("go1")
    for j, joint in enumerate(robot.base.legs.joint_names):
        if joint.startswith("FL") and "hip" not in joint:
            robot.q[j] = -0.05 if "calf" in joint else 0.025
    result = estimated(robot, robot.records())
    assert result.status == "stale"
    assert result.final.mass == 0.0
    assert not result.events
    assert result.feet["leg_stretched"] > 1000
    assert any("stretched" in sentence for sentence in result.warnings)


@every_robot
def test_feet_without_a_sphere_are_named_and_their_radius_may_be_set(name: str) -> None:
    bare = FloatingBase(RobotModel.from_urdf(description(name)))
    assert bool(bare.notes) == (name in ("go2", "solo"))
    assert all("foot_radius" in sentence for sentence in bare.notes)
    given = FloatingBase(RobotModel.from_urdf(description(name)), foot_radius=0.03)
    assert not given.notes
    assert given.foot_radius.tolist() == [0.03] * 4


@pytest.mark.skipif(path_of("go1") is None, reason="pip install example-robot-data")
def test_an_accelerometer_with_a_bias_is_doubted_and_the_interval_says_so() -> None:
    robot, bias = standing("go1"), (0.05, -0.04, 0.08)
    result = estimated(robot, robot.records(bias=bias))
    assert any("accelerometer_bias_std" in sentence for sentence in result.warnings)
    error = abs(result.final.mass - robot.theta[0])
    assert 0.05 < error < 1.96 * result.final.mass_std
    honest = estimated(robot, robot.records())
    assert not any("accelerometer_bias_std" in sentence for sentence in honest.warnings)
    assert honest.final.mass_std < 0.032  # 0.02 m/s^2 of bias are not noticed


@pytest.mark.skipif(path_of("go1") is None, reason="pip install example-robot-data")
@pytest.mark.parametrize("bias", [(0.0, 0.0, 0.0), (0.05, -0.04, 0.08), (-0.1, 0.1, -0.1)], ids=["none", "some", "much"])
def test_a_bias_that_is_free_is_found_and_the_mass_is_right(bias: tuple[float, ...]) -> None:
    robot = standing("go1")
    chosen = OnlineSettings(accelerometer_bias_std=0.1, imu_tilt_std=0.0, imu_lever_std=0.0, **EXACT)  # type: ignore[arg-type]
    legs = RobotModel.from_urdf(robot.base.legs.urdf)
    estimation = OnlineEstimation(legs, chosen)
    result = replay(robot.records(bias=bias), gate_for(legs, estimation.base, chosen), estimation)
    assert np.all(np.abs(result.final.theta - robot.theta)[:4] < 4.0 * result.final.std[:4])
    assert result.final.mass == pytest.approx(robot.theta[0], rel=0.03)
    assert result.final.mass_std < 0.04
    assert estimation.estimator is not None
    assert estimation.estimator.theta[-3:] == pytest.approx(bias, abs=0.015)
    assert not any("accelerometer_bias_std" in sentence for sentence in result.warnings)
    assert [event.kind for event in result.events] == ["pick"]
