"""Do the efforts follow the model? Finds a wrong unit, wrong signs, and efforts without gravity in them."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sysid_ros.input_gate.mapping import largest_gravity_torque
from sysid_ros.robot.effort_presets import offer
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

Joints = NDArray[np.intp]
"""Indices of joints."""

PERIOD: Final = 0.05
"""Time between two samples that are looked at [s]."""

_MOVING = 0.02  # rad/s or m/s; standing, stiction can hide all of gravity
_NEEDED = 120  # samples of a moving joint: 6 s
_EVERY = 20  # samples from one verdict to the next
_REMEMBERED = 240  # above it the past is halved
_ALIKE = 5.0  # samples of which one is new: what a model does not explain lasts a quarter of a second
_SHARE = 0.15  # of the arm's largest gravity torque; below it friction and inertia decide, not gravity
_LOWEST, _HIGHEST = 0.3, 4.0  # of a unit's factor; a payload twice as heavy as the arm stays within
_ONE, _GRAVITY, _SIGN, _SPEED, _INERTIA, _TAU = 0, 1, 2, 3, 4, 15
_OWN = [_ONE, _SIGN, _SPEED]
_REST = [_GRAVITY, _INERTIA, *range(5, 15), _TAU]


class GravityCheck:
    """Compares, by likelihood, what the efforts of moving joints may be::

        tau_j = s_j g_j(q) + k_j (rnea_j(q, v, a) - g_j(q)) + Y_j(q, v, a) theta + c_j + f_j sign(v_j) + b_j v_j

    With s = k = 1 they are the arm's torques in N m; with s = k = -1 in some joints their sign is wrong; with s = 0 gravity is
    taken out of them; with s = k of any other size they are in another unit. What is carried, with its prior, offset and friction
    are free in each, so that they decide nothing.

    Args:
        robot: gives g(q). frame: that the payload is fixed to. prior_std: of its ten parameters, shape (10,).

    Attributes:
        error, warning: what is wrong with the effort; empty: nothing. Only joints count whose gravity torque has varied by a good
            part of the arm's largest one: else it may be the model that is wrong.
    """

    def __init__(self, robot: RobotModel, frame: str, prior_std: FloatArray) -> None:
        self._robot, self._frame = robot, robot.frame_id(frame or robot.flange)
        self._prior = np.diag(prior_std**-2.0)
        largest = float(largest_gravity_torque(robot).max())
        self._weightless, self._large = 0.01 * largest, _SHARE * largest
        self._moments = np.zeros((robot.n, 16, 16))  # of the columns 1, g, sign(v), v, inertia, Y, tau
        self._last: list[tuple[float, FloatArray, FloatArray]] = []
        self._since_verdict = 0
        self.error = self.warning = ""

    def restart(self) -> None:
        """After a gap, so that no velocity is taken across it."""
        self._last.clear()

    def add(self, t: float, q: FloatArray, tau: FloatArray) -> None:
        """Takes one sample; best every :data:`PERIOD`. Updates ``error`` and ``warning``."""
        self._last.append((t, q, tau))
        if len(self._last) < 3 or self._weightless < 1e-8:
            return
        (t0, before, _), (t1, q, tau), (t2, after, _) = self._last
        del self._last[0]
        coming, going = (after - q) / (t2 - t1), (q - before) / (t1 - t0)
        v, a = 0.5 * (coming + going), (coming - going) / (0.5 * (t2 - t0))
        moving = np.abs(v) > _MOVING
        if not moving.any():
            return
        carried = self._robot.payload_regressor(q, v, a, self._frame)
        gravity = self._robot.gravity_torque(q)
        inertia = self._robot.rnea(q, v, a) - gravity
        columns = np.column_stack([np.ones_like(v), gravity, np.sign(v), v, inertia, carried, tau]) * moving[:, None]
        self._moments += columns[:, :, None] * columns[:, None, :]
        self._since_verdict += 1
        if self._since_verdict >= _EVERY:
            self._since_verdict = 0
            self._judge()
            self._moments[self._moments[:, 0, 0] > _REMEMBERED] *= 0.5

    def _judge(self) -> None:
        self.error, self.warning = self._said(self._joints(self._large))

    def suspicion(self) -> str:
        """The same of all joints, for when it is known otherwise that model and torques do not fit."""
        return " ".join(filter(None, self._said(self._joints(self._weightless))))

    def _joints(self, varied: float) -> Joints:
        """Joints that have moved for long enough, and whose gravity torque has varied by more than that [N m]."""
        count = np.maximum(self._moments[:, 0, 0], 1.0)
        variance = self._moments[:, _GRAVITY, _GRAVITY] / count - (self._moments[:, _ONE, _GRAVITY] / count) ** 2
        return np.flatnonzero((count >= _NEEDED) & (variance > varied**2))

    def _said(self, joints: Joints) -> tuple[str, str]:
        """An error and a warning about some of the joints, each empty where there is none."""
        if joints.size == 0:
            return "", ""
        rest, n = self._without_friction(joints), joints.size
        one = np.ones(n)
        sound = self._misfit(rest, one, one)
        signs, flipped = self._signs(rest, sound)
        fixed = _price(rest) + min(self._misfit(rest, 0.0 * one, one), self._misfit(rest, 0.0 * one, 0.0 * one))
        factors, scaled = self._factors(rest)
        best = min(sound, flipped, fixed, scaled)
        if best == sound:
            return "", ""
        if best == scaled:
            signs = np.sign(factors)
        wrong = signs < 0.0
        if best != fixed and wrong.any():
            listed = self._listed(joints[wrong])
            return (
                f"The effort runs against the model's torque on {listed}. Its sign is wrong: set effort_sign to -1 for these "
                "joints, or correct the joint axis in the URDF."
            ), ""
        if best == fixed or np.median(factors) < _LOWEST:
            return "", (
                f"The effort is much smaller than gravity asks for on {self._listed(joints)}. If it is a motor current or a "
                "percentage, set effort_scale; if gravity is already taken out of it, set effort_type to external."
                f"{offer(self._robot.joint_names)}"
            )
        if np.median(factors) > _HIGHEST:
            return "", (
                f"The effort is much larger than gravity asks for on {self._listed(joints)}. If it is in another unit such as "
                "mA, set effort_scale; else check the masses in the URDF."
            )
        return "", ""

    def _listed(self, joints: Joints) -> str:
        return ", ".join(self._robot.joint_names[j] for j in joints)

    def _without_friction(self, joints: Joints) -> FloatArray:
        """Moments of g, inertia, Y and tau without what offset and friction explain, over the variance of the rest, shape
        (k, 13, 13)."""
        rest = np.empty((joints.size, 13, 13))
        for i, j in enumerate(joints):
            moments = self._moments[j]
            own = np.linalg.pinv(moments[np.ix_(_OWN, _OWN)], hermitian=True)
            across = moments[np.ix_(_REST, _OWN)]
            left = moments[np.ix_(_REST, _REST)] - across @ own @ across.T
            free = np.linalg.pinv(left[:-1, :-1], hermitian=True) @ left[:-1, -1]
            variance = max(float(left[-1, -1] - free @ left[:-1, -1]) / (moments[0, 0] - 15.0), self._weightless**2)
            rest[i] = left / (_ALIKE * variance)
        return rest

    def _misfit(self, rest: FloatArray, s: FloatArray, k: FloatArray) -> float:
        """-2 log likelihood of given s and k, shape (n,) each, but for a constant, where the payload is what fits best."""
        w = np.zeros((len(rest), 13))
        w[:, 0], w[:, 1], w[:, 12] = -s, -k, 1.0
        target = np.einsum("jab,jb->ja", rest, w)
        score = target[:, 2:12].sum(axis=0)
        information = rest[:, 2:12, 2:12].sum(axis=0) + self._prior
        return float(np.einsum("ja,ja->", w, target) - score @ np.linalg.solve(information, score))

    def _signs(self, rest: FloatArray, sound: float) -> tuple[FloatArray, float]:
        """The signs that fit best, from all right and from all wrong on; each wrong one costs what a parameter costs."""
        price = _price(rest)
        found = np.ones(len(rest)), sound
        for start in (1.0, -1.0):
            signs = np.full(len(rest), start)
            misfit = self._misfit(rest, signs, signs) + (price if start < 0.0 else 0.0)
            better = True
            while better:
                better = False
                for j in range(len(rest)):
                    other = signs.copy()
                    other[j] *= -1.0
                    tried = self._misfit(rest, other, other) + price * min(
                        float(np.sum(other != 1.0)), 1.0 + np.sum(other != -1.0)
                    )
                    if tried < misfit:
                        signs, misfit, better = other, tried, True
            if misfit < found[1]:
                found = signs, misfit
        return found

    def _factors(self, rest: FloatArray) -> tuple[FloatArray, float]:
        """A factor a joint that fits best, and the misfit with what so many parameters cost."""
        n = len(rest)
        information, score = np.zeros((n + 10, n + 10)), np.zeros(n + 10)
        information[n:, n:] = self._prior
        whole = np.zeros(13)
        whole[:2] = 1.0
        total = 0.0
        for j, moments in enumerate(rest):
            along = moments @ whole
            information[j, j], score[j] = whole @ along, along[12]
            information[j, n:] = information[n:, j] = along[2:12]
            information[n:, n:] += moments[2:12, 2:12]
            score[n:] += moments[2:12, 12]
            total += moments[12, 12]
        x = np.linalg.pinv(information, hermitian=True) @ score
        return x[:n], float(total - x @ score) + n * _price(rest)


def _price(rest: FloatArray) -> float:
    """What a parameter costs: the logarithm of how much there is to explain, over its noise."""
    return float(np.log(max(rest[:, 12, 12].sum(), 3.0)))
