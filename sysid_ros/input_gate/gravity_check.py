"""Does the effort follow the model's gravity? Finds a wrong unit, a wrong sign, and effort without gravity in it."""

from __future__ import annotations

import numpy as np

from sysid_ros.input_gate.mapping import largest_gravity_torque
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

PERIOD = 0.05
"""Time between two samples that are looked at [s]."""

_MOVING = 0.02  # rad/s or m/s; standing, stiction can hide all of gravity
_NEEDED = 120  # samples of a moving joint: 6 s
_EVERY = 20  # samples from one verdict to the next
_REMEMBERED = 600  # above it the past is halved
_SHARE = 0.15  # of the arm's largest gravity torque; below it friction and inertia decide, not gravity
_STANDARD_ERRORS = 4.0
_LOWEST, _HIGHEST = 0.3, 4.0  # of the slope; a payload twice as heavy as the arm stays within
_WRONG_SIGN = -0.2


class GravityCheck:
    """Regression of each joint's torque on the model's gravity torque while the joint moves::

        tau = c + s g(q) + f sign(v) + b v

    The slope s is 1 for an unloaded arm in N m, more with a payload, the unit's factor in another unit, 0 where gravity is
    compensated, negative where the sign is wrong. Friction and offset have columns of their own, so that they do not count. Only
    joints are judged whose gravity torque has varied by a good part of the arm's largest one, and only a slope that is four
    standard errors away.

    Args:
        robot: gives g(q).
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._level = _SHARE * float(largest_gravity_torque(robot).max())
        self._moments = np.zeros((robot.n, 5, 5))  # of the columns 1, g, sign(v), v, tau
        self._last: tuple[float, FloatArray] | None = None
        self._since_verdict = 0
        self.warning = ""
        self.error = ""

    def restart(self) -> None:
        """After a gap, so that no velocity is taken across it."""
        self._last = None

    def add(self, t: float, q: FloatArray, tau: FloatArray) -> None:
        """Takes one sample; best every :data:`PERIOD`. Updates ``warning`` and ``error``."""
        last, self._last = self._last, (t, q)
        if last is None or self._level < 1e-6:
            return
        v = (q - last[1]) / (t - last[0])
        moving = np.abs(v) > _MOVING
        if not moving.any():
            return
        columns = np.stack([np.ones_like(v), self._robot.gravity_torque(q), np.sign(v), v, tau], axis=1) * moving[:, None]
        self._moments += columns[:, :, None] * columns[:, None, :]
        self._since_verdict += 1
        if self._since_verdict >= _EVERY:
            self._since_verdict = 0
            self._judge()
            self._moments[self._moments[:, 0, 0] > _REMEMBERED] *= 0.5

    def _judge(self) -> None:
        names = self._robot.joint_names
        low: list[str] = []
        high: list[str] = []
        flipped: list[str] = []
        for j, moments in enumerate(self._moments):
            slope, error = self._slope(moments)
            if slope + error < _WRONG_SIGN:
                flipped.append(f"{names[j]} ({slope:.2g})")
            elif slope + error < _LOWEST:
                low.append(f"{names[j]} ({slope:.2g})")
            elif slope - error > _HIGHEST:
                high.append(f"{names[j]} ({slope:.2g})")
        against = "(slope on the model's gravity torque, 1 expected)"
        self.error = self.warning = ""
        if flipped:
            self.error = (
                f"The effort runs against gravity on {', '.join(flipped)} {against}. Its sign is wrong: set effort_sign to -1 "
                "for these joints, or correct the joint axis in the URDF."
            )
        if low:
            self.warning = (
                f"The effort is much smaller than gravity asks for on {', '.join(low)} {against}. If it is a motor current or a "
                "percentage, set effort_scale; if gravity is already taken out of it, set effort_type to external."
            )
        elif high:
            self.warning = (
                f"The effort is much larger than gravity asks for on {', '.join(high)} {against}. If it is in another unit such "
                "as mA, set effort_scale; else check the masses in the URDF."
            )

    def _slope(self, moments: FloatArray) -> tuple[float, float]:
        """Slope and four standard errors of it; NaN where this joint can't be judged."""
        count = moments[0, 0]
        if count < _NEEDED or moments[1, 1] / count - (moments[0, 1] / count) ** 2 < self._level**2:
            return np.nan, np.nan
        A, b = moments[:4, :4], moments[:4, 4]
        inverse = np.linalg.pinv(A, hermitian=True)
        x = inverse @ b
        variance = max(float(moments[4, 4] - x @ b), 0.0) / (count - 4.0)
        return float(x[1]), _STANDARD_ERRORS * float(np.sqrt(variance * max(inverse[1, 1], 0.0)))
