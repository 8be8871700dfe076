"""The node without ROS: choice of joints, commits, and what happens when something breaks inside."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sysid_ros.exceptions import RobotModelError
from sysid_ros.online.live_estimation import CommitGate, LiveEstimation
from sysid_ros.online.warm_up import warm_up
from sysid_ros.online_settings import CommitSettings, OnlineSettings
from sysid_ros.robot.joint_choice import JointChoice
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.rotation import equivalent_box, quaternion
from sysid_ros.sample import JointStateRecord

URDF = (Path(__file__).parent / "data" / "small_arm.urdf").read_text()
ROBOT = RobotModel.from_urdf(URDF)
RATE = 250.0
START = 1000.0
PAYLOAD = np.array([1.5, 0.045, -0.03, 0.15, 0.03, 0.0, 0.03, 0.0, 0.0, 0.02])


def motion(robot: RobotModel, duration: float, start: float = START, mass: float = 1.0) -> list[JointStateRecord]:
    """Records of a moving arm that carries ``mass`` times PAYLOAD."""
    rng = np.random.default_rng(2)
    t = np.arange(round(duration * RATE)) / RATE
    w = np.linspace(2.1, 4.3, robot.n)
    low, high = np.clip(robot.position_lower, -1.0, 1.0), np.clip(robot.position_upper, -1.0, 1.0)
    swing = 0.4 * (high - low)
    frame = robot.frame_id(robot.default_frame)
    records = []
    for x in t:
        q = 0.5 * (low + high) + swing * np.sin(w * x)
        v, a = swing * w * np.cos(w * x), -swing * w * w * np.sin(w * x)
        tau = robot.rnea(q, v, a) + robot.payload_regressor(q, v, a, frame) @ (mass * PAYLOAD)
        # the URDF's <dynamics> is part of what the estimation takes for known
        tau += robot.damping * v + robot.friction * np.sign(v) + 0.05 * rng.standard_normal(robot.n)
        records.append(JointStateRecord(start + x, start + x, robot.joint_names, q, v, tau))
    return records


def live_of(**settings: object) -> LiveEstimation:
    return LiveEstimation(URDF, OnlineSettings(**settings), CommitGate(CommitSettings(dwell=0.5)))  # type: ignore[arg-type]


def run(live: LiveEstimation, records: list[JointStateRecord]) -> tuple[int, list[float]]:
    """How many estimates came out, and the masses that were committed."""
    count, committed = 0, []
    for k, record in enumerate(records):
        estimate = live.take(record)
        if k % 250 == 249:
            live.health(record.receive_time)
        if estimate is not None:
            count += 1
            if (passed := live.commit.offer(estimate)) is not None:
                committed.append(passed.mass)
    return count, committed


def test_estimates_and_commits() -> None:
    live = live_of()
    count, committed = run(live, motion(ROBOT, 12.0))
    assert count > 400
    assert live.status(0.0)[0] == "ok", live.status(0.0)
    assert live.estimation.latest is not None
    assert live.estimation.latest.mass == pytest.approx(1.5, abs=0.05)
    assert committed
    assert committed[-1] == pytest.approx(1.5, abs=0.08)


def test_is_stale_when_samples_stop() -> None:
    live = live_of(joint_names=ROBOT.joint_names)
    assert live.status(float("inf"))[0] == "stale"
    run(live, motion(ROBOT, 1.0))
    assert live.status(0.6)[0] == "stale"


def test_all_joints_in_one_message_are_chosen_at_once() -> None:
    live = live_of()
    live.take(motion(ROBOT, 0.01)[0])
    assert live.gate is not None
    assert live.robot.joint_names == ROBOT.joint_names


def test_unnamed_joints_are_locked_and_a_partial_message_does_not_decide() -> None:
    some = RobotModel.from_urdf(URDF, ROBOT.joint_names[:3])
    live = live_of()
    partial = JointStateRecord(START, START, (ROBOT.joint_names[3],), [0.1], [0.0], [1.0])
    live.take(partial)
    gate = live.gate
    assert gate is None
    assert live.status(0.0) == ("warming_up", live.status(0.0)[1])
    run(live, motion(some, 1.0))
    assert live.gate is not None
    assert live.robot.joint_names == some.joint_names
    assert any(ROBOT.joint_names[3] in note for note in live.robot.notes)


def test_joints_of_another_robot_are_said_by_name() -> None:
    choice = JointChoice(ROBOT.joint_names)
    assert choice.offer(JointStateRecord(START, START, ("wheel",), [0.0], [0.0], [0.0])) is None
    assert choice.offer(JointStateRecord(START, START + 9.0, ("wheel",), [0.0], [0.0], [0.0])) is None
    assert "wheel" in choice.text
    assert ROBOT.joint_names[0] in choice.text


def test_message_with_efforts_is_preferred() -> None:
    choice = JointChoice(("a", "b", "c"))
    assert choice.offer(JointStateRecord(0.0, 0.0, ("a", "b", "c"), [0.0] * 3, [], [])) is None
    assert choice.offer(JointStateRecord(0.6, 0.6, ("a", "b"), [0.0] * 2, [], [1.0] * 2)) == ("a", "b")


def test_unknown_frame_and_bad_urdf_are_refused() -> None:
    with pytest.raises(RobotModelError, match="nowhere"):
        live_of(frame_id="nowhere")
    with pytest.raises(RobotModelError):
        LiveEstimation("<robot", OnlineSettings(), CommitGate(CommitSettings()))


def test_fault_inside_sets_the_estimate_back_to_the_last_good_one(monkeypatch: pytest.MonkeyPatch) -> None:
    live = live_of()
    records = motion(ROBOT, 14.0)
    run(live, records[:3000])
    assert live.estimation.latest is not None
    good = live.estimation.latest.mass
    step = live.estimation.step

    def broken(measurement: object) -> None:
        live.estimation.estimator._theta[:] = np.nan  # type: ignore[union-attr]
        raise ZeroDivisionError("made up")

    monkeypatch.setattr(live.estimation, "step", broken)
    assert live.take(records[3000]) is None
    monkeypatch.setattr(live.estimation, "step", step)
    assert live.troubles == {"ZeroDivisionError": 1}
    assert "made up" in live.last_trouble
    run(live, records[3001:])
    assert live.estimation.latest.mass == pytest.approx(good, abs=0.05)
    assert live.status(0.0)[0] == "ok"


def test_nan_inside_sets_the_estimate_back_and_is_no_event() -> None:
    live = live_of()
    records = motion(ROBOT, 14.0)
    run(live, records[:3000])
    events = len(live.estimation.events)
    assert live.estimation.estimator is not None
    live.estimation.estimator.shift(slice(0, 1), np.array([np.nan]))
    live.health(records[2999].receive_time)  # such a one is not kept as a good one
    run(live, records[3000:])
    assert live.troubles == {"FloatingPointError": 1}
    assert "no longer finite" in live.last_trouble
    assert len(live.estimation.events) == events
    assert live.status(0.0)[0] == "ok"


def test_a_state_that_fails_again_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    live = live_of()
    records = motion(ROBOT, 14.0)
    run(live, records[:2000])
    for record in records[2000:2002]:
        with monkeypatch.context() as patch:
            patch.setattr(live.estimation, "step", lambda measurement: 1 / 0)
            live.take(record)
    assert live.estimation.estimator is None
    run(live, records[2002:])
    assert live.status(0.0)[0] == "ok"


@pytest.mark.parametrize(("factor", "word"), [([1.0, -1.0, 1.0, 1.0], "sign"), ([0.1] * 4, "effort_scale")])
def test_torques_that_do_not_fit_are_told_as_what_they_are(factor: list[float], word: str) -> None:
    live = live_of(link_mass_error=0.0, link_com_error=0.0, effort_gain_error=0.0)
    run(live, [replace(r, effort=np.asarray(r.effort) * factor) for r in motion(ROBOT, 14.0, mass=0.0)])
    status, reason = live.status(0.0)
    assert status == "inconsistent"
    assert word in reason


def test_jump_back_in_time_starts_again() -> None:
    live = live_of()
    run(live, motion(ROBOT, 6.0))
    run(live, motion(ROBOT, 0.5, mass=0.0))
    assert any("jumped back" in warning for warning in live.estimation.warnings)
    assert live.status(0.0)[0] == "warming_up"


def test_no_commit_while_the_input_is_in_error() -> None:
    live = live_of()
    records = motion(ROBOT, 12.0)
    run(live, records[:2000])
    live.health(records[1999].receive_time + 10.0)
    assert live.commit_now()[0] is False
    assert live.estimation.latest is not None
    assert live.commit.offer(live.estimation.latest) is None


def test_disabled_estimation_gives_nothing() -> None:
    live = live_of()
    live.set_enabled(False)
    assert run(live, motion(ROBOT, 2.0))[0] == 0
    live.set_enabled(True)
    assert run(live, motion(ROBOT, 2.0, start=START + 2.0))[0] > 0


def test_warm_up_gives_estimates() -> None:
    assert warm_up(ROBOT, OnlineSettings()) > 50


def test_equivalent_box_has_the_mass_distribution() -> None:
    edges, mass = np.array([0.1, 0.2, 0.4]), 3.0
    moments = mass / 12.0 * (np.sum(edges**2) - edges**2)
    rng = np.random.default_rng(3)
    rotation, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    size, axes = equivalent_box(mass, rotation @ np.diag(moments) @ rotation.T)
    assert sorted(size) == pytest.approx(sorted(edges))
    assert np.linalg.det(axes) == pytest.approx(1.0)
    x, y, z, w = quaternion(axes)
    assert np.hypot(np.hypot(x, y), np.hypot(z, w)) == pytest.approx(1.0)
    first = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
    assert first == pytest.approx(axes[:, 0].tolist())
