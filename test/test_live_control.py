"""The controller without ROS on a simulated arm: what it believes, and what it does where states or reason fail it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install '.[sim]'")

from sysid_ros.control import ArmTorque, ControlSettings, Reference, make_law
from sysid_ros.control.control_settings import SafetySettings
from sysid_ros.control.live_control import LiveControl
from sysid_ros.control.own_torque import OwnTorque
from sysid_ros.control.refined_payload import RefinedPayload
from sysid_ros.control.state_age import StateAge
from sysid_ros.control.unmodelled_torque import UnmodelledTorque
from sysid_ros.sample import FloatArray
from sysid_ros.simulation import ArmScenario, ArmSimulation

RATE = 500
STILL = np.zeros(7)


class Arm:
    """An arm at 500 Hz that LiveControl moves; its states can be kept from it."""

    def __init__(self, law: str = "certainty_equivalence", payload: float = 3.0, seed: int = 5, **safety: float) -> None:
        scenario = ArmScenario(seed=seed, duration=60.0, rate=RATE, payload_mass=payload, pick_time=np.inf)
        self.sim = ArmSimulation(scenario, self._command)
        self.model = ArmTorque(self.sim.robot, (), self.sim.frame)
        self.live = LiveControl(
            make_law(law, self.model, ControlSettings(loop_delay=1.0 / RATE)), self.model, SafetySettings(**safety)
        )
        self.effort: FloatArray | None = None
        self.centre = self.sim.trajectory.centre
        self.silent = 0.0
        self.sent: list[FloatArray] = []

    def _command(self, q: FloatArray, v: FloatArray, wanted: Reference) -> FloatArray:
        if self.effort is None:
            return self.sim.own_command(q, v, Reference(self.centre, STILL, STILL))
        return self.effort

    def run(self, seconds: float, deaf: bool = False) -> tuple[FloatArray, FloatArray]:
        """Positions and velocities on the way, shape (N, 7) each."""
        q, v = [], []
        for _ in range(round(seconds * RATE)):
            told = self.sim.noisy(self.sim.step())
            assert told.v is not None
            if deaf:
                self.silent += 1.0 / RATE
                tau = self.live.without_states(self.silent)
                if tau is None and self.silent > 0.1:
                    tau = self.live.torque_at_rest()
                self.effort = self.effort if tau is None else tau
            else:
                self.silent = 0.0
                self.effort = self.live.command(told.t, told.q, told.v)
                self.live.learn()
            assert self.effort is not None
            self.sent.append(self.effort)
            q.append(told.q)
            v.append(self.sim.world.v)
        return np.array(q), np.array(v)

    def refuses(self) -> bool:
        return self.live.told.refused

    def follow(self, t: float, by: FloatArray) -> None:
        self.live.follow(self.sim.robot.joint_names, np.array([t]), (self.centre + by)[None], None, None)


@pytest.fixture
def arm() -> Iterator[Callable[..., Arm]]:
    made: list[Arm] = []

    def make(*args: object, **options: object) -> Arm:
        made.append(Arm(*args, **options))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for one in made:
        one.sim.close()


def test_what_is_told_and_not_carried_is_not_believed(arm: Callable[..., Arm]) -> None:
    one = arm()
    one.run(0.5)
    body = one.sim.payload
    assert body is not None
    one.live.tell(body.theta)
    q, _ = one.run(1.0)
    assert one.refuses()
    assert one.live.told.mass == pytest.approx(3.0)
    assert one.live.law.payload == pytest.approx(np.zeros(10))
    assert np.abs(q - one.centre).max() < 5e-3
    one.sim.pick()
    q, _ = one.run(2.0)
    assert not one.refuses()
    assert one.live.law.payload == pytest.approx(body.theta)
    assert np.abs(q[-1] - one.centre).max() < 5e-3


def test_what_falls_is_let_go_of_before_anybody_says_so(arm: Callable[..., Arm]) -> None:
    one = arm()
    one.sim.pick()
    one.run(0.5)
    assert one.sim.payload is not None
    one.live.tell(one.sim.payload.theta)
    one.run(1.0)
    assert one.live.law.payload[0] == pytest.approx(3.0)
    one.sim.drop()
    q, _ = one.run(2.0)
    assert one.live.law.payload[0] == pytest.approx(0.0)
    assert np.abs(q[-1] - one.centre).max() < 5e-3
    assert np.abs(q - one.centre).max() < 0.15


def test_a_better_value_of_what_is_carried_is_taken_over(arm: Callable[..., Arm]) -> None:
    one = arm()
    one.sim.pick()
    one.run(0.3)
    assert one.sim.payload is not None
    theta = one.sim.payload.theta
    for told in (0.97 * theta, theta):
        one.live.tell(told)
        one.run(1.0)
        assert one.live.law.payload == pytest.approx(told)


@pytest.mark.parametrize("carries", [False, True])
@pytest.mark.parametrize("when", [0.3, 0.5, 0.8])
def test_without_states_a_moving_arm_comes_to_rest_near_by(arm: Callable[..., Arm], carries: bool, when: float) -> None:
    one = arm(payload=1.5)
    if carries:
        one.sim.pick()
    one.run(0.5)
    if carries:
        assert one.sim.payload is not None
        one.live.tell(one.sim.payload.theta)
        one.run(0.7)
    one.follow(1.0, np.array([0.5, -0.3, 0.4, 0.4, -0.5, 0.3, 0.6]))
    q0, v0 = one.run(when)
    q, v = one.run(0.6, deaf=True)
    assert np.abs(v0[-1]).max() > 0.3
    assert np.abs(q - q0[-1]).max() < 0.15
    assert np.abs(v[-1]).max() < 0.1
    q1, _ = one.run(0.8)
    assert "no joint state" in one.live.trouble
    assert np.abs(q1[-1] - q[-1]).max() < 0.05
    assert one.live.rests


def test_a_short_silence_does_not_end_a_motion(arm: Callable[..., Arm]) -> None:
    one = arm()
    one.run(0.5)
    by = np.array([0.3, -0.2, 0.2, 0.2, -0.3, 0.2, 0.3])
    one.follow(1.0, by)
    one.run(0.5)
    one.run(0.03, deaf=True)
    q, _ = one.run(0.8)
    assert not one.live.trouble
    assert np.abs(q[-1] - one.centre - by).max() < 2e-3


def test_an_arm_that_yields_stays_where_it_is_pushed_to(arm: Callable[..., Arm]) -> None:
    one = arm(error_limit=0.1)
    one.run(0.5)
    there = one.centre + np.array([0.2, -0.15, 0.2, 0.15, 0.2, 0.2, 0.2])
    one.sim.world.reset(there, np.zeros(7))
    q, _ = one.run(1.0)
    assert one.live.yields
    assert np.abs(q[-1] - there).max() < 0.02
    one.sim.pick()  # a weight that it does not know hangs on the arm now
    q, v = one.run(2.0)
    assert np.abs(v[-1]).max() < 0.3


def test_a_delay_that_is_known_costs_no_accuracy_along_a_motion(arm: Callable[..., Arm]) -> None:
    furthest = []
    for lead in (0.0, 1.5 / RATE):  # an answer acts from the next state to the one after it
        one = arm(payload=1.0)
        one.live.law.feedback.lead = lead
        one.run(0.3)
        goal, still = one.centre + np.array([0.6, -0.4, 0.6, 0.4, 0.6, 0.6, 0.6]), np.zeros((1, 7))
        one.live.follow(one.sim.robot.joint_names, np.array([1.0]), goal[None], still, still)  # no jump of the acceleration
        errors = []
        for _ in range(100):
            one.run(0.01)
            errors.append(np.abs(one.live.error))
        furthest.append(np.max(errors))
    assert furthest[1] < 0.4 * furthest[0]


def test_a_motion_that_begins_with_a_jump_of_the_acceleration_is_followed(arm: Callable[..., Arm]) -> None:
    one = arm(payload=1.0)
    one.live.law.feedback.lead = 1.25 / RATE  # PyBullet's step of 1 ms moves the middle of a torque that is held for two
    one.run(0.3)
    errors = []
    one.follow(1.0, np.full(7, 0.4))
    for _ in range(250):
        one.run(1.0 / RATE)
        errors.append(np.abs(one.live.error))
    assert np.max(errors) < 1e-4  # encoder noise is a part of it


def test_a_push_moves_the_arm_and_is_told(arm: Callable[..., Arm]) -> None:
    one = arm()
    one.run(1.0)
    assert one.live.unmodelled.strangest() is None
    one.sim.push = np.array([0.0, 40.0, 0.0])
    one.run(0.3)
    beyond = one.live.unmodelled.strangest()
    assert beyond is not None
    lever = one.sim.robot.frame_jacobian_along(one.sim.world.q[None], one.sim.robot.frame_id(one.sim.frame))[0, 1]
    assert beyond @ lever < 0.0
    one.sim.push = np.zeros(3)
    q, _ = one.run(2.0)
    assert np.abs(q[-1] - one.centre).max() < 5e-3
    one.live.unmodelled.strangest()
    one.run(0.5)
    assert one.live.unmodelled.strangest() is None


def test_a_force_is_not_kept_as_a_payload_when_the_arm_yields(arm: Callable[..., Arm]) -> None:
    one = arm(law="slotine_li", error_limit=0.1)
    one.run(1.0)
    one.sim.push = np.array([0.0, 150.0, -60.0])
    for _ in range(40):
        one.run(0.02)
        if one.live.yields:
            break
    assert one.live.yields
    assert one.live.law.payload[0] < 0.5
    one.sim.push = np.zeros(3)
    _, v = one.run(1.5)
    assert np.abs(v[-1]).max() < 0.05


def test_efforts_do_not_jump(arm: Callable[..., Arm]) -> None:
    one = arm(effort_rise_time=0.5)
    one.run(0.3)
    one.sim.world.reset(one.centre + 0.05, np.zeros(7))
    one.run(0.3)
    most = np.abs(np.diff(one.sent, axis=0)) / (one.sim.robot.effort_limit / RATE / 0.5)
    assert 0.9 < most.max() <= 1.0 + 1e-3


def test_a_state_is_as_old_as_it_is_later_than_the_fastest() -> None:
    age = StateAge()
    offset = 1.7e9
    assert [age.of(0.01 * k, offset + 0.01 * k + 0.002) for k in range(100)] == pytest.approx([0.0] * 100, abs=1e-6)
    assert age.of(1.0, offset + 1.3) == pytest.approx(0.298, abs=1e-3)
    assert age.of(1.31, offset + 1.312) == pytest.approx(0.0, abs=1e-3)
    age.forget()
    assert age.of(5.0, offset) == 0.0


@pytest.mark.parametrize("shift", [-3600.0, 1e6])
def test_one_stamp_that_fits_none_is_left_out_and_a_clock_that_was_set_is_followed(shift: float) -> None:
    age, offset = StateAge(), 1.7e9
    for k in range(100):
        assert age.of(0.01 * k, offset + 0.01 * k) == pytest.approx(0.0, abs=1e-6)
    assert age.of(1.0 + shift, offset + 1.0) == np.inf
    assert [age.of(0.01 * k, offset + 0.01 * k) for k in range(101, 110)] == pytest.approx([0.0] * 9, abs=1e-6)
    assert age.of(1.1 + shift, offset + 1.1) == np.inf
    assert [age.of(0.01 * k + shift, offset + 0.01 * k) for k in range(111, 120)] == pytest.approx([0.0] * 9, abs=1e-6)


def test_states_of_long_ago_stay_old() -> None:
    age = StateAge()
    assert age.of(0.0, 10.0) == 0.0
    assert min(age.of(0.01 * k, 13.0 + 0.01 * k) for k in range(1, 500)) > 2.9


def test_what_the_feedback_adds_speaks_for_what_is_carried_and_against_what_is_not() -> None:
    torque = UnmodelledTorque(np.array([100.0, 100.0]))
    rng = np.random.default_rng(0)
    for _ in range(500):
        torque.add(np.array([10.0, 0.0]) + rng.normal(0.0, 0.5, 2), 0.002)
    assert torque.mean == pytest.approx([10.0, 0.0], abs=0.3)
    assert torque.against(np.array([10.0, 0.0])) < -3.0
    assert torque.against(np.array([-10.0, 0.0])) > 3.0
    assert abs(torque.against(np.array([0.0, 0.3]))) < 3.0


def test_an_arm_that_gets_faster_while_it_should_yield_is_left_to_its_drives(arm: Callable[..., Arm]) -> None:
    one = arm()
    one.run(0.2)
    fast = 2.0 * one.sim.robot.velocity_limit
    for k in range(100):
        one.live.command(1.0 + 0.002 * k, one.centre, fast)
    assert (one.live.yields, one.live.given_up) == (True, True)
    assert "Nothing is sent" in one.live.trouble
    one.live.hold()
    assert (one.live.yields, one.live.given_up) == (False, False)


def test_what_is_told_is_refined_by_what_is_sent_and_let_go_of_when_it_falls(arm: Callable[..., Arm]) -> None:
    one = arm(payload=1.5)
    one.live.refinement = RefinedPayload(OwnTorque(one.sim.robot, one.sim.frame, None, one.live.law.feedback.delay))
    body = one.sim.payload
    assert body is not None
    std = np.array([0.05] + [4e-3] * 3 + [3e-3] * 6)
    told = body.theta + std * np.array([1.0, 0.5, -0.5, 0.5, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0])

    def move(times: int) -> None:
        for k in range(times):
            one.follow(0.8, np.where(np.arange(7) % 2, 0.3, -0.3) * (-1.0) ** k)
            one.run(0.8)

    one.run(0.3)
    move(4)
    one.sim.pick()
    one.run(0.5)
    one.live.tell(told, np.diag(std**2))
    move(4)
    assert not one.live.yields
    assert np.all(np.abs(one.live.law.payload - body.theta)[4:] < 0.1 * std[4:] + 1e-12)
    one.sim.drop()
    one.run(0.3)
    assert one.refuses()
    assert np.abs(one.live.law.payload[0]) < 0.5 * body.mass
