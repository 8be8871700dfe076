"""What is called right is right, of arms whose model is wrong: links that all weigh otherwise, and rotors that nobody knows."""

from __future__ import annotations

import re

import numpy as np
import pytest
from motions import Motion, measurements
from robots import robot, urdf

from sysid_ros.effects import CoulombFriction, Payload, RotorInertia, TorqueOffset, ViscousFriction
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

MODEL = robot("iiwa")
BODY = inertial_parameters.from_com(1.5, np.array([0.03, -0.02, 0.08]), np.diag([0.004, 0.006, 0.005]))
ROTORS = np.array([0.8, 0.8, 0.5, 0.5, 0.3, 0.1, 0.1])
DRY = np.array([1.5, 1.5, 1.0, 1.0, 0.6, 0.4, 0.3])
VISCOUS = np.array([2.0, 2.0, 1.5, 1.5, 0.8, 0.5, 0.3])
OFFSET = np.array([0.4, -0.3, 0.2, -0.2, 0.1, 0.0, 0.05])
LENGTH = 4.0


class OneByOne(Motion):
    """Each joint in its turn goes to and fro, for four seconds, while the others rest."""

    def __init__(self, model: RobotModel, seed: int = 0) -> None:
        super().__init__(model, seed=seed)
        self.reach = 1.3 * np.random.default_rng(seed).choice([-1.0, 1.0], model.n)

    def __call__(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        s = (t - 100.0)[:, None] / LENGTH - np.arange(self.model.n)
        w, inside = 2.0 * np.pi, (s > 0.0) & (s < 1.0)
        # (1 - cos w s)^2 sin w s, by parts: twice differentiable where it begins and ends
        x, dx, ddx = np.sin(w * s), np.cos(w * s), -np.sin(w * s)
        p, dp = (1.0 - dx) ** 2, 2.0 * (1.0 - dx) * x
        ddp = 2.0 * x**2 + 2.0 * (1.0 - dx) * dx
        size, rate = self.reach * inside / 2.6, w / LENGTH
        q = self.centre + size * p * x
        return q, size * rate * (dp * x + p * dx), size * rate**2 * (ddp * x + 2.0 * dp * dx + p * ddx)


def sure(
    model: RobotModel, motion: Motion, seconds: float, rotors: FloatArray, pick: float = 0.0, times: float = 1.0
) -> list[PayloadEstimate]:
    """What is called right of an arm with so many ``times`` the usual friction, and rotors, that picks up 1.5 kg, if ``model`` is
    known of it alone."""
    friction = [(CoulombFriction(MODEL), DRY), (ViscousFriction(MODEL), VISCOUS), (TorqueOffset(MODEL), OFFSET)]
    own = [(effect, times * theta) for effect, theta in friction]
    effects = [(Payload(MODEL), BODY, pick, np.inf), *own, (RotorInertia(MODEL), rotors)]
    online = OnlineEstimation(model, OnlineSettings())
    recording = measurements(motion, seconds, 250.0, effects, 0.1, 1e-5, velocity=False)  # type: ignore[arg-type]
    return [e for e in map(online.step, recording) if e is not None and e.status in ("ok", "no_payload")]


def wrong(estimates: list[PayloadEstimate], mass: float = 1.5) -> list[PayloadEstimate]:
    return [e for e in estimates if abs(e.theta[0] - mass) > 3.0 * e.mass_std]


@pytest.mark.parametrize("factor", [0.7, 1.15, 1.4])
@pytest.mark.parametrize("seed", [1, 7, *(pytest.param(k, marks=pytest.mark.slow) for k in (4, 12, 14))])
def test_links_that_all_weigh_otherwise(factor: float, seed: int) -> None:
    """A payload and friction explain them for a while, and the recursion is sure of it."""
    text = re.sub(r'<mass value="([^"]+)"', lambda m: f'<mass value="{factor * float(m[1])}"', urdf("iiwa"))
    other = RobotModel.from_urdf(text)
    assert not wrong(sure(other, Motion(MODEL, seed=seed), 14.0, 0.0 * ROTORS, times=6.0))


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_rotors_where_joints_move_one_at_a_time(seed: int) -> None:
    """Their torque is that of a mass far out, as long as nothing else moves."""
    assert not wrong(sure(MODEL, OneByOne(MODEL, seed), 7.0 * LENGTH, ROTORS))


def test_what_is_right_is_called_so_as_soon_after_a_pick_as_before() -> None:
    found = [e for e in sure(MODEL, Motion(MODEL, seed=3), 14.0, 0.0 * ROTORS, pick=9.0) if e.t > 109.3]
    assert found[0].t < 110.0
    assert not wrong(found)
