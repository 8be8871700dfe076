"""What a controller learns of its payload, and of when its torques act, from the torques that it sends."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from sysid_ros.control.own_torque import OwnTorque
from sysid_ros.control.refined_payload import RefinedPayload, refined
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.inertial_parameters import from_com, is_physical
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

RATE, DELAY = 500, 0.004
PRIOR = np.diag(OnlineSettings().payload_prior ** 2)
BODY = from_com(1.5, np.array([0.02, -0.03, 0.08]), np.diag([4e-3, 5e-3, 3e-3]))
TOLD = BODY + np.array([0.02, 2e-3, -2e-3, 2e-3, 3e-3, 0.0, 3e-3, 0.0, 0.0, 2e-3])
TOLD_COVARIANCE = np.diag(np.array([0.05] + [4e-3] * 3 + [4e-3] * 6) ** 2)


def _arm() -> RobotModel:
    pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install '.[sim]'")
    from sysid_ros.simulation.description import arm_description

    return RobotModel.from_urdf(arm_description())


class Moving:
    """An arm on sines, whose exact torques are what a controller sent ``acts_after`` ago [s]."""

    def __init__(self, acts_after: float) -> None:
        self.robot = _arm()
        self.frame = self.robot.flange
        self.own = OwnTorque(self.robot, self.frame, None, DELAY)
        self._acts_after, self._noise, self._k = acts_after, np.random.default_rng(3), 0
        self._w = np.linspace(2.0, 4.5, self.robot.n)

    def _state(self, t: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        w = self._w
        return 0.3 + 0.4 * np.sin(w * t), 0.4 * w * np.cos(w * t), -0.4 * w**2 * np.sin(w * t)

    def run(self, seconds: float, body: FloatArray, force: float = 0.0) -> None:
        for _ in range(round(seconds * RATE)):
            t = self._k / RATE
            q, v, _ = self._state(t)
            then = self._state(t + self._acts_after)
            sent = self.robot.rnea(*then) + self.robot.payload_regressor(*then, self.robot.frame_id(self.frame)) @ body
            sent = sent + force * np.ones(self.robot.n)
            self.own.add(t, q + 1e-5 * self._noise.standard_normal(len(q)), v, sent)
            self._k += 1


@pytest.mark.parametrize("acts_after", [1.2e-3, 2.7e-3])
def test_what_is_sent_tells_the_payload_and_when_it_acts(acts_after: float) -> None:
    arm = Moving(acts_after)
    arm.run(3.0, np.zeros(10))
    arm.run(3.0, BODY)
    assert arm.own.payload is not None
    theta, covariance = arm.own.payload
    std = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(theta - BODY) < 3.0 * std)
    assert np.all(std[4:] < 1e-3)
    assert arm.own.lead == pytest.approx(acts_after, abs=1e-4)


def test_a_change_is_learned_anew_and_an_interruption_keeps_what_is_known() -> None:
    arm = Moving(2e-3)
    arm.run(3.0, np.zeros(10))
    for body in (BODY, np.zeros(10), 0.5 * BODY):
        arm.run(2.0, body)
        assert arm.own.payload is not None
        assert arm.own.payload[0][0] == pytest.approx(body[0], abs=0.02)
    assert arm.own.payload is not None
    known = arm.own.payload[1]
    arm.own.interrupt()
    assert arm.own.payload is not None
    assert np.array_equal(arm.own.payload[1], known)
    arm.own.forget()
    assert arm.own.payload[1][0, 0] == pytest.approx(PRIOR[0, 0])


def test_the_lead_stays_between_none_and_the_delay() -> None:
    arm = Moving(3.0 * DELAY)
    seen: deque[float] = deque()
    for _ in range(50):
        arm.run(0.1, np.zeros(10))
        seen.append(arm.own.lead)
    assert min(seen) >= 0.0
    assert max(seen) <= DELAY


def test_both_are_weighed_by_their_covariance_where_they_are_of_one_thing() -> None:
    mean = refined(TOLD, TOLD_COVARIANCE, BODY, 1e-4 * TOLD_COVARIANCE)
    assert mean == pytest.approx(BODY, abs=1e-4)
    assert refined(TOLD, TOLD_COVARIANCE, BODY, PRIOR) == pytest.approx(TOLD, abs=2e-3)
    between = refined(TOLD, TOLD_COVARIANCE, BODY, TOLD_COVARIANCE)
    assert between == pytest.approx(0.5 * (TOLD + BODY), abs=1e-4)


@pytest.mark.parametrize("own", [np.zeros(10), 3.0 * BODY, -BODY])
def test_what_was_told_is_believed_where_they_are_not_of_one_thing(own: FloatArray) -> None:
    assert refined(TOLD, TOLD_COVARIANCE, own, 1e-4 * TOLD_COVARIANCE) == pytest.approx(TOLD)


def test_what_is_believed_is_a_body() -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        own = BODY + 1.5 * np.sqrt(np.diag(TOLD_COVARIANCE)) * rng.standard_normal(10)
        assert is_physical(refined(BODY, TOLD_COVARIANCE, own, 0.01 * TOLD_COVARIANCE))


@pytest.mark.parametrize("covariance", [None, np.full((10, 10), np.nan), np.zeros((10, 10))])
def test_what_cannot_be_weighed_is_not_refined(covariance: FloatArray | None) -> None:
    class Known(OwnTorque):
        def __init__(self) -> None:
            pass

        @property
        def payload(self) -> tuple[FloatArray, FloatArray] | None:
            return BODY, np.zeros((10, 10))

    refinement = RefinedPayload(Known())
    refinement.covariance = covariance
    assert refinement.of(TOLD) is None
    refinement.covariance = TOLD_COVARIANCE
    assert refinement.of(np.zeros(10)) is None
    assert refinement.of(TOLD) == pytest.approx(BODY)
