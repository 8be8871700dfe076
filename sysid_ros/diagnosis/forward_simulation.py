"""Forward simulation under the measured torques, over short windows, with and without the effects that were found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.joint_side import JointSide
from sysid_ros.diagnosis.result import SimulationError
from sysid_ros.effects import Motion
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

HORIZON = 0.5
"""Length of a window [s]."""
_WINDOWS = 20
_STEP = 2.5e-3
_DIVERGED = 10.0


def forward_simulation(
    robot: RobotModel,
    motions: Sequence[Motion],
    nominal: Sequence[FloatArray],
    extended: Sequence[FloatArray],
    sides: tuple[JointSide, JointSide],
) -> SimulationError:
    """Error at the end of windows that start from measured states.

    The arm is driven by the measured torque, less what the model says beside links, friction and rotors:
    ``M(q) a + C v + g + J a + b v + f = tau - (model torque - ID - J a - b v - f)``, where the right side is taken along the
    measured motion and the left at the simulated state, with joints that can stick.

    Args:
        nominal, extended: torque of both models along the motions, shape (N, n) each [N m]. sides: friction and rotors of both.
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
            for name, model, side in (("0", before, sides[0]), ("1", after, sides[1])):
                q, v = _run(robot, motion, window, model[window], side)
                errors[f"q{name}"].append(q)
                errors[f"v{name}"].append(v)
    q0, q1, v0, v1 = (float(np.sqrt(np.mean(np.square(errors[k])))) if errors[k] else 0.0 for k in ("q0", "q1", "v0", "v1"))
    return SimulationError(HORIZON, q0, q1, v0, v1)


def _run(robot: RobotModel, motion: Motion, window: slice, model: FloatArray, side: JointSide) -> tuple[FloatArray, FloatArray]:
    """Position and velocity error at the end of one window, shape (n,) each."""
    t = motion.t[window] - motion.t[window][0]
    beside = model - motion.link_torque[window] - side.torque(motion.v[window], motion.a[window])
    torque = motion.tau[window] - beside
    q, v = motion.q[window][0].copy(), motion.v[window][0].copy()
    steps = max(1, round(float(t[-1]) / _STEP))
    h = float(t[-1]) / steps
    drive = side.drive(h)
    at = np.stack([np.interp((np.arange(steps) + 0.5) * h, t, torque[:, j]) for j in range(robot.n)], axis=1)
    for tau in at:
        # forces at the middle of the step, friction at its end
        middle = q + 0.5 * h * v
        a = drive.acceleration(robot, middle, v, tau)
        q, v = q + h * v + 0.5 * h * h * a, v + h * a
        if not np.all(np.abs(q - motion.q[window][0]) < _DIVERGED):
            break
    # a URDF with hardly any inertia in a link ends at infinity
    errors = (np.nan_to_num(x, nan=np.inf) for x in (q - motion.q[window][-1], v - motion.v[window][-1]))
    position, velocity = (np.clip(x, -_DIVERGED, _DIVERGED) for x in errors)
    return position, velocity
