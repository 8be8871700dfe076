"""What a URDF, free bodies and no robot at all expect of torques, as Gaussian priors over the same few hundred instants."""

from __future__ import annotations

from copy import copy
from enum import Enum, auto
from typing import NamedTuple

import numpy as np
from scipy import linalg

from sysid_ros.diagnosis.whose.coarse_rows import CoarseRows
from sysid_ros.diagnosis.whose.payload_changes import changes_of_payload
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_MASS, _PLACE, _INERTIA = 0.15, 0.03, 0.3
"""Standard deviation of a URDF's masses (part), centres of mass [m] and inertias (part): what identified arms differ by."""
_KIND = 3.0
"""How many times further robots of one kind are from each other than each is from its URDF."""
_OFF = 1.0, 0.1, 1.0
"""The same of a link that is wrong: another link than was built, a part that is not mounted."""
_FINE = 0.1
"""Part of that which links are inexact by where a URDF is as the maker drew it, or that of a simulation."""
_GYRATION, _LEAST = 0.08, 0.02
"""Least radius of gyration [m] and least mass (of the heaviest link's) of a link where a URDF gives less."""
_BODY = np.array([1.0] + [0.3] * 3 + [0.1] * 6)
"""A body of any size, times the mass of all links: within 0.3 m of its frame."""
_CARRIED = np.array([1.0] + [0.15] * 3 + [0.03] * 6)
"""A payload, times its mass: within 0.15 m of the flange."""
_PAYLOAD, _WHOLE = 0.2, 0.5
"""What is carried: a part of the arm's mass, or what makes such a part of the usual torque, if that is more."""
_HEAVIER = np.log(3.0)
"""Standard deviation of the logarithm of that mass: efforts in kN m would be those of an arm that carries hundreds of its own."""
_REACH = 0.3
"""Height to which a force on the tool is that of a payload [g]."""
_TILT = 0.05
"""Tilt of a base [rad]."""
GAIN, _RUBS = 0.05, 0.1
"""Gain of an effort, as a part of it, and friction of a gear, as a part of its load."""
_OFFSET, _VISCOUS, _QUADRATIC, _ROTOR, _DRY = 0.3, 0.5, 0.2, 0.3, 0.5
"""What a joint has of its own, as a part of its usual torque, at its usual speed and acceleration."""
_SPRING, _RIPPLE = (0.3, 0.7), (0.05, 0.1)
"""Torques by the own position: size (part of the usual torque) and length over which they change [rad]."""
_DRIFTS, _SLOW = 0.2, 10.0
"""Part of the variance of all that which drifts, and the time over which it does [s]."""
_REST, _MEMORY = 0.5, 1.0
"""Times over which the friction of a joint at rest, and what any model leaves, stay alike [s]."""
_GRAVITY = 9.81
Prior = tuple[FloatArray, FloatArray]
"""Of one joint: columns times the standard deviations of their parameters, shape (N, p), and a covariance beside them, (N, N)."""


class Dissipated(NamedTuple):
    """The mean power that friction takes from a joint, before any data: its covariance with the joint's rows, shape (N,), and its
    variance; its mean is 0. Friction gives none, so that it is positive."""

    beside: FloatArray
    variance: float


class Carried(Enum):
    """What an arm carries, and is pushed and tilted by: nothing, always the same, or a load that is picked up or set down."""

    NOTHING = auto()
    SOMETHING = auto()
    CHANGING = auto()


class RobotKernels:
    """Priors of the torques of each joint.

    All hypotheses have the same of each joint's own: what one joint's torque says of its own friction, spring or ripple decides
    nothing between robots. They also have the same discrepancy, what any model leaves: a smooth function of the posture, of the
    state, and of time, of a size that the data tell.

    Attributes:
        mean, gravity: torque of the URDF's links and of their weight, shape (N, n). falls: the latter for gravity along each axis
            of the base, shape (N, n, 3) [N m s^2/m]. pattern: covariance of the discrepancy, of unit variance, shape (N, N).
    """

    def __init__(self, robot: RobotModel, rows: CoarseRows) -> None:
        self.robot, self.rows, self._carried = robot, rows, Carried.SOMETHING
        q, v, a = rows.q, rows.v, rows.a
        self._links = robot.regressor_along(q, v, a)
        self.mean: FloatArray = self._links @ robot.pi
        self.gravity = robot.rnea_along(q, np.zeros_like(q), np.zeros_like(q))
        frame = robot.frame_id(robot.default_frame)
        self._payload = np.stack([robot.payload_regressor(*state, frame) for state in zip(q, v, a, strict=True)])
        self._weight = float(np.sqrt(np.max(np.mean(np.sum((self._payload * _CARRIED) ** 2, axis=2), axis=0))))  # of one kg
        self._force = robot.frame_jacobian_along(q, frame).swapaxes(1, 2)
        self.falls: FloatArray = -np.stack([robot.base_acceleration_columns(x) for x in q])
        self._tilt = self.falls @ linalg.null_space(robot.gravity[None])
        self._total = float(robot.pi[::10].sum())
        self._later: list[FloatArray] = []
        self._inexact = _inexactness(robot)
        apart = np.where(rows.stretch[:, None] == rows.stretch, np.abs(rows.t[:, None] - rows.t), np.inf)
        self._slow = 1.0 - _DRIFTS + _DRIFTS * np.exp(-0.5 * (apart / _SLOW) ** 2)
        self._rest = np.exp(-0.5 * (apart / _REST) ** 2)
        self.pattern = (_waves(q, v, a) + _matern(_distance(q, v)) + _matern(np.minimum(apart, 1e3) / _MEMORY)) / 3.0

    def carrying(self, carried: Carried, rows: CoarseRows) -> RobotKernels:
        """The same with something else beside the links; ``rows``: with the efforts by which its changes are found."""
        other = copy(self)
        other._carried, residual = carried, rows.tau - self.mean
        other._later = changes_of_payload(rows, residual, self._payload) if carried is Carried.CHANGING else []
        return other

    def level(self) -> RobotKernels:
        """The same on a base that stands as gravity is set."""
        other = copy(self)
        other._tilt = np.zeros_like(self._tilt)
        return other

    def exact(self, wrong: int | None = None) -> RobotKernels:
        """The same with the URDF's links much more exact than is usual, but for one that is far off if it is given."""
        other = copy(self)
        other._inexact = _FINE * _inexactness(self.robot)
        if wrong is not None:
            of_it = slice(10 * wrong, 10 * wrong + 10)
            other._inexact[of_it] = _inexactness(self.robot, *_OFF)[of_it]
        return other

    def own(self, joint: int) -> FloatArray:
        """Covariance of what a joint has of its own, over the square of its usual torque, shape (N, N)."""
        r = self.rows
        q, a = r.q[:, joint], r.a[:, joint]
        X = np.column_stack([np.full_like(q, _OFFSET), _ROTOR * a / max(float(a.std()), 1e-9), self._friction(joint)])
        out = X @ X.T * self._slow
        for size, length in (_SPRING, _RIPPLE):
            out += size**2 * np.exp(-0.5 * ((q[:, None] - q) / length) ** 2)
        stands = _DRY * r.stands[:, joint]
        out += stands[:, None] * stands * self._rest
        return np.asarray(out)

    def _friction(self, joint: int) -> FloatArray:
        """Columns of a joint's own friction, shape (N, f)."""
        r, v = self.rows, self.rows.v[:, joint]
        v = v / max(float(v.std()), 1e-9)
        return np.column_stack([_VISCOUS * v, _QUADRATIC * v * np.abs(v), _DRY * r.sign[:, joint], _DRY * r.dry[:, joint]])

    def dissipated(self, joint: int, usual: float, by_load: bool) -> Dissipated:
        """What a joint's friction takes, its own and, if asked, that of its load; ``usual``: the joint's usual torque [N m]."""
        X, w = self._friction(joint), self.rows.v[:, joint] / len(self.rows.t)
        F = usual**2 * (X @ X.T) * self._slow + (self.by_load(joint, 0.0) if by_load else 0.0)
        return Dissipated(F @ w, float(w @ F @ w))

    def urdf(self, joint: int, usual: float) -> Prior:
        """The URDF's bodies, as exact as a URDF is, what the whole arm may have beside them, a gain and friction by the load.

        Args:
            usual: largest usual torque of any joint [N m].
        """
        columns = [self._links[:, joint] * self._inexact, self.whole_arm(joint, usual)]
        return np.concatenate(columns, axis=1), self.by_load(joint, GAIN)

    def alike(self, joint: int, usual: float) -> Prior:
        """Another robot of the URDF's kind, and the same beside its bodies."""
        columns = [self._links[:, joint] * (_KIND * self._inexact), self.whole_arm(joint, usual)]
        return np.concatenate(columns, axis=1), self.by_load(joint, GAIN)

    def free(self, joint: int, usual: float) -> Prior:
        """The same kinematics with bodies of any size, and the same beside them."""
        columns = [self._links[:, joint] * np.tile(self._total * _BODY, self.robot.n), self.whole_arm(joint, usual)]
        return np.concatenate(columns, axis=1), self.by_load(joint, GAIN)

    def by_load(self, joint: int, gain: float) -> FloatArray:
        """Covariance of a gain on the URDF's torque, and of friction in proportion to it, shape (N, N)."""
        load = self.mean[:, joint]
        rubs = _RUBS * np.abs(load) * self.rows.sign[:, joint]
        return np.asarray(gain**2 * np.outer(load, load) + np.outer(rubs, rubs))

    def whole_arm(self, joint: int, usual: float) -> FloatArray:
        """Columns of a payload with its changes, of a force on the tool and a tilt of the base, shape (N, 15 + 10 c)."""
        carried = self._mass(usual)
        force, tilt = _GRAVITY * _REACH * carried, _GRAVITY * _TILT
        payload = self._payload[:, joint] * carried * _CARRIED
        parts = [payload, self._force[:, joint] * force, self._tilt[:, joint] * tilt]
        columns = np.concatenate([*parts, *(payload * later[:, None] for later in self._later)], axis=1)
        return np.zeros_like(columns) if self._carried is Carried.NOTHING else columns

    def _mass(self, usual: float) -> float:
        """Of a usual payload [kg]."""
        return max(_PAYLOAD * self._total, _WHOLE * usual / max(self._weight, 1e-9))

    def heaviness(self, usual: float) -> float:
        """Log-probability of so heavy a payload, less that of a usual one."""
        if self._carried is Carried.NOTHING:
            return 0.0
        return -0.5 * float(np.log(self._mass(usual) / max(_PAYLOAD * self._total, 1e-9)) / _HEAVIER) ** 2


def _inexactness(robot: RobotModel, of_mass: float = _MASS, place: float = _PLACE, of_inertia: float = _INERTIA) -> FloatArray:
    """Standard deviation of what a URDF says of its links, shape (10 n,)."""
    out = np.zeros((robot.n, 10))
    least = max(_LEAST * float(robot.pi[::10].max()), 1e-6)
    for row, body in zip(out, robot.pi.reshape(-1, 10), strict=True):
        mass = max(float(body[0]), least)
        first = float(np.linalg.norm(body[1:4])) / mass
        moment = max(float(body[[4, 6, 9]].max()), mass * _GYRATION**2)
        lever = float(np.hypot(place, of_mass * first))
        row[:] = [of_mass * mass] + [mass * lever] * 3 + [of_inertia * moment] * 6
    return out.ravel()


def _waves(q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Covariance of unit size of sines and cosines of the joints, their products, accelerations and products of speeds."""
    circle = np.concatenate([np.sin(q), np.cos(q)], axis=1)
    (i, k), (s, t) = np.triu_indices(circle.shape[1], 1), np.triu_indices(q.shape[1])
    X = np.concatenate([np.ones((len(q), 1)), circle, circle[:, i] * circle[:, k], a, v[:, s] * v[:, t]], axis=1)
    X /= np.maximum(np.sqrt(np.mean(X**2, axis=0)), 1e-9)
    return np.asarray(X @ X.T / X.shape[1])


def _distance(q: FloatArray, v: FloatArray) -> FloatArray:
    """Between states, over their usual spread, shape (N, N)."""
    X = np.concatenate([(x - x.mean(axis=0)) / np.maximum(x.std(axis=0), 1e-9) for x in (q, v)], axis=1)
    size = np.sum(X**2, axis=1)
    return np.asarray(np.sqrt(np.maximum(size[:, None] + size - 2.0 * X @ X.T, 0.0) / X.shape[1]))


def _matern(d: FloatArray) -> FloatArray:
    """Matern's covariance of functions with one derivative (Rasmussen, Williams 2006, section 4.2)."""
    return np.asarray((1.0 + np.sqrt(3.0) * d) * np.exp(-np.sqrt(3.0) * d))
