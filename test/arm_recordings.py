"""Recordings of test arms for identification: exact inverse dynamics of links that differ from the URDF's, plus noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from motions import Motion
from scipy import signal

from sysid_ros.effects import LinkInertia
from sysid_ros.exceptions import DataError
from sysid_ros.identification import Recording
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel

START = 100.0


def hidden_parameters(model: RobotModel, seed: int, links: float = 0.1) -> FloatArray:
    """Links (each body scaled, so it stays one), viscous, Coulomb, rotors, offsets: in the order of ``free_model``."""
    rng = np.random.default_rng(seed)
    n = model.n
    scale = 1.0 + links * rng.uniform(-1.5, 1.5, (n, 1))
    return np.concatenate(
        [
            (LinkInertia(model).nominal.reshape(-1, 10) * scale).ravel(),
            rng.uniform(0.3, 2.0, n),
            rng.uniform(0.3, 1.5, n),
            rng.uniform(0.02, 0.5, n),
            rng.normal(0.0, 0.3, n),
        ]
    )


def exact_torque(model: RobotModel, theta: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Torque of the hidden parameters along a motion, shape (N, n)."""
    n = model.n
    b, Fc, J, offset = theta[10 * n :].reshape(4, n)
    torque: FloatArray = model.regressor_along(q, v, a) @ theta[: 10 * n] + b * v + Fc * np.tanh(v / 0.02) + J * a + offset
    return torque


def recorded(
    model: RobotModel,
    theta: FloatArray,
    seed: int,
    seconds: float = 30.0,
    rate: float = 250.0,
    torque_noise: float = 0.3,
    colour: float = 0.0,
    encoder_noise: float = 1e-5,
    still: Sequence[str] = (),
    name: str = "",
) -> Recording:
    """What the sensors measure; ``colour`` is the coefficient of the torque noise's AR(1), from sample to sample."""
    rng = np.random.default_rng([seed, 1])
    t = np.arange(round(seconds * rate)) / rate
    q, v, a = Motion(model, seed, speed=0.8, still=still)(t)
    settle = round(20.0 / (1.0 - colour))
    noise = signal.lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], rng.normal(size=(len(t) + settle, model.n)), axis=0)
    tau = exact_torque(model, theta, q, v, a) + torque_noise * noise[settle:]
    measured = q + encoder_noise * rng.normal(size=q.shape)
    return Recording(name or f"bag {seed}", START + t, measured, None, tau)


def require_physical(model: TorqueModel, theta: FloatArray) -> None:
    """Check that every link is a body of positive density, and that friction and rotors are not negative.

    Args:
        model: whose free effects theta belongs to. theta: shape (p,).

    Raises:
        DataError: naming all that is not.
    """
    wrong = []
    for effect, where in zip(model.free, model.slices, strict=True):
        values = theta[where]
        if effect.replaces_links:
            wrong += [
                f"the inertials of link {model.robot.body_names[int(j)]}"
                for j, body in zip(effect.joints, values.reshape(-1, 10), strict=True)
                if not inertial_parameters.is_physical(body)
            ]
        elif effect.nonnegative:
            wrong += [f"{name} = {x:.3g}" for name, x in zip(effect.parameter_names, values, strict=True) if x < 0.0]
    if wrong:
        raise DataError(f"no robot has these parameters: {', '.join(wrong)}. Identify with physical consistency.")
