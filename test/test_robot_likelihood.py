"""The URDF of the robot is likelier than none; that of another robot is not, and the right one outranks it."""

from __future__ import annotations

import numpy as np
import pytest
from motions import Motion
from robots import robot

from sysid_ros.diagnosis.robot_likelihood import Likelihoods, _independent, robot_likelihood, wrong_robot
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

ARM = "small_arm"


def recording(seed: int = 1, seconds: float = 14.0, extra: float = 0.0) -> Recording:
    """A motion of the arm with noise and friction; ``extra`` of its torque is that of no robot."""
    model, rng = robot(ARM), np.random.default_rng(seed)
    t = np.asarray(np.arange(0.0, seconds, 0.005))
    q, v, a = Motion(model, seed)(t)
    own: FloatArray = model.rnea_along(q, v, a)
    tau = own + 0.1 * np.tanh(v / 0.02) + 0.05 * v + 0.02 * rng.normal(size=q.shape)
    tau = (1.0 - extra) * tau + extra * 5.0 * np.sin(3.0 * q[:, ::-1])
    return Recording(f"seed {seed}", t, q, None, tau)


def with_bodies(factor: float) -> RobotModel:
    model = robot(ARM)
    change = np.zeros_like(model.pi).reshape(-1, 10)
    change[::2] = (factor - 1.0) * model.pi.reshape(-1, 10)[::2]
    return model.with_links(change.ravel())


def test_the_right_urdf_is_likelier_and_outranks_others() -> None:
    right = robot_likelihood(robot(ARM), [recording()])
    assert right is not None
    assert right.gain > 0.0
    assert right.probability > 0.99
    other = robot_likelihood(with_bodies(6.0), [recording()])
    assert other is not None
    assert other.gain < right.gain
    assert other.urdf.sum() < right.urdf.sum()
    assert wrong_robot(robot(ARM), [recording()]) is None


def test_torques_of_no_robot_are_refused_with_a_reason() -> None:
    reason = wrong_robot(robot(ARM), [recording(extra=1.0)])
    assert reason is not None
    assert "does not explain these torques" in reason
    assert "--urdf" in reason


@pytest.mark.parametrize("rows", [1.0, 10.0, 100.0])
def test_little_data_do_not_outweigh_that_a_given_urdf_is_usually_right(rows: float) -> None:
    zero = np.zeros(3)
    found = Likelihoods(zero - 0.1, zero, zero - 1.0, rows)
    assert found.gain == pytest.approx(-0.3)
    assert (found.probability > 0.5) == (rows < np.log(99.0) / 0.3)
    assert Likelihoods(zero, zero, zero, rows).probability == pytest.approx(0.99)


def test_rows_that_follow_one_another_count_as_fewer() -> None:
    rng = np.random.default_rng(0)
    white = rng.normal(size=4000)
    assert _independent(white) == pytest.approx(4000, rel=0.15)
    slow = np.convolve(white, np.ones(20), "valid")
    assert _independent(slow) == pytest.approx(len(slow) / 20, rel=0.4)


def test_nothing_is_said_of_too_little() -> None:
    short = recording(seconds=1.0)
    assert robot_likelihood(robot(ARM), [short]) is None
    assert wrong_robot(robot(ARM), [short]) is None
