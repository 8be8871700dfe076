"""Forward simulation under the measured torques, over short windows, with and without the effects that were found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.result import SimulationError
from sysid_ros.effects import Motion
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray

HORIZON = 0.5
"""Length of a window [s]."""
_WINDOWS = 30
_STEP = 2.5e-3
_DIVERGED = 10.0


def forward_simulation(
    robot: RobotModel,
    motions: Sequence[Motion],
    nominal: Sequence[FloatArray],
    extended: Sequence[FloatArray],
    rotor_inertia: FloatArray,
) -> SimulationError:
    """Error at the end of windows that start from measured states.

    The arm is driven by the measured torque, less what the model says beside the links: ``M(q) a = tau - (model torque - ID) -
    C v - g``, where the model's torque beside the links' is taken along the measured motion and the links' own torque along the
    simulated one. With rotors of inertia J the mass matrix is M + diag(J).

    Args:
        nominal, extended: torque of both models along the motions, shape (N, n) each [N m].
        rotor_inertia: that the extended model adds, shape (n,) [kg m^2].
    """
    errors: dict[str, list[FloatArray]] = {"q0": [], "q1": [], "v0": [], "v1": []}
    count = max(1, _WINDOWS // len(motions))
    for motion, before, after in zip(motions, nominal, extended, strict=True):
        last = len(motion.t) - 1 - int(np.ceil(HORIZON / motion.period))
        if last <= 0:
            continue
        ends = round(HORIZON / motion.period)
        for start in np.unique(np.linspace(0, last, count).astype(int)):
            window = slice(int(start), int(start) + ends + 1)
            for name, model, rotor in (("0", before, np.zeros(robot.n)), ("1", after, rotor_inertia)):
                q, v = _run(robot, motion, window, model[window], rotor)
                errors[f"q{name}"].append(q)
                errors[f"v{name}"].append(v)
    q0, q1, v0, v1 = (float(np.sqrt(np.mean(np.square(errors[k])))) if errors[k] else 0.0 for k in ("q0", "q1", "v0", "v1"))
    return SimulationError(HORIZON, q0, q1, v0, v1)


def _run(robot: RobotModel, motion: Motion, window: slice, model: FloatArray, rotor: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Position and velocity error at the end of one window, shape (n,) each."""
    t = motion.t[window] - motion.t[window][0]
    beside = model - motion.link_torque[window] - rotor * motion.a[window]
    drive = motion.tau[window] - beside
    q, v = motion.q[window][0].copy(), motion.v[window][0].copy()
    steps = max(1, round(float(t[-1]) / _STEP))
    h = t[-1] / steps
    at = np.stack([np.interp(np.arange(2 * steps + 1) * 0.5 * h, t, drive[:, j]) for j in range(robot.n)], axis=1)
    for i in range(steps):
        # the midpoint rule: second order, two evaluations
        a = _acceleration(robot, q, v, at[2 * i], rotor)
        a = _acceleration(robot, q + 0.5 * h * v, v + 0.5 * h * a, at[2 * i + 1], rotor)
        q, v = q + h * v + 0.5 * h * h * a, v + h * a
        if not np.all(np.abs(q - motion.q[window][0]) < _DIVERGED):
            break
    limit = _DIVERGED
    return np.clip(q - motion.q[window][-1], -limit, limit), np.clip(v - motion.v[window][-1], -limit, limit)


def _acceleration(robot: RobotModel, q: FloatArray, v: FloatArray, tau: FloatArray, rotor: FloatArray) -> FloatArray:
    return robot.forward_dynamics(q, v, tau, rotor)
