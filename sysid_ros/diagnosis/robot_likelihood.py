"""Whether a URDF is that of the recorded robot: how likely it makes data that were not fitted, beside models that know less.

Three Gaussian models of the same rows, each joint by itself, with the noise that its own left-out error shows::

    U   the URDF's bodies, as exact as a URDF is, a payload, and what every joint may have of its own
    F   the same kinematics with bodies of any size, and the same of each joint
    B   no robot: sines and cosines of the joints, their products, accelerations, products of speeds

The right URDF, wrong as it may be in what a diagnosis finds, predicts better than F, which must learn all of it, and than B.
What is left out is a *region of the joint space*: a model that remembers the path would else have seen it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.recording import Recording

_CUTOFF, _RATE = 8.0, 40.0
"""Band that is judged, and rows a second of it [Hz]: a controlled arm moves below; gears and noise are above."""
_REGIONS = 10
_MASS, _PLACE, _INERTIA = 0.15, 0.03, 0.3
"""Standard deviation of a URDF's masses (part), centres of mass [m] and inertias (part): what identified arms differ by."""
_GYRATION = 0.08
"""Least radius of gyration of a link [m], for a prior where a URDF gives it no inertia."""
_BODY = np.array([1.0] + [0.3] * 3 + [0.1] * 6)
"""A body of any size, times its mass: within 0.3 m of its frame."""
_CARRIED = np.array([1.0] + [0.15] * 3 + [0.03] * 6)
"""A payload, times its mass: within 0.15 m of the flange."""
_SLOW = 0.15
"""Second width of the sign of a velocity [rad/s], for friction that falls with the speed."""
_GRAVITY = (0.0, -1.0, 1.0)
"""Gravity as it is, taken out of the efforts, counted twice."""
_OWN = 0.3
"""Standard deviation of a friction, an offset, a rotor's torque, as a part of the usual torque; of a gain, as a part of it."""


_USUALLY_RIGHT = 0.99
"""Probability that a URDF that somebody gives is the robot's, before any data."""


@dataclass(frozen=True)
class Likelihoods:
    """Mean log-likelihood of a left-out row of each joint, shape (n,): with the URDF, with free bodies, with no robot; and how
    many rows are independent of one another."""

    urdf: FloatArray
    free: FloatArray
    no_robot: FloatArray
    rows: float

    @property
    def gain(self) -> float:
        """Log-likelihood of the URDF over the better one of the others, a row of all joints."""
        return float(self.urdf.sum() - max(self.free.sum(), self.no_robot.sum()))

    @property
    def probability(self) -> float:
        """That the URDF is the robot's rather than that one of the others holds."""
        odds = np.log(_USUALLY_RIGHT / (1.0 - _USUALLY_RIGHT)) + self.gain * self.rows
        return float(1.0 / (1.0 + np.exp(-np.clip(odds, -700.0, 700.0))))


def wrong_robot(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    """Why the URDF can't be that of the robot, with the cure; None where it can.

    Args:
        recordings: after the faults of units, signs and order were undone.
    """
    found = robot_likelihood(robot, recordings)
    if found is None or found.probability > 0.5:
        return None
    no_robot = found.no_robot.sum() >= found.free.sum()
    other = "functions of the joint angles that know no robot" if no_robot else "the same joints with any other bodies on them"
    return (
        f"The URDF '{robot.name}' does not explain these torques: on left-out motion {other} predict them better (by a factor of "
        f"{np.exp(-found.gain):.3g} in the likelihood of each instant), whatever friction, offset and payload are "
        "added to it. It is another robot's URDF, or the efforts are no joint torques; give the URDF of the robot that was "
        "recorded (--urdf)."
    )


def robot_likelihood(robot: RobotModel, recordings: Sequence[Recording]) -> Likelihoods | None:
    """What the recordings say of a URDF; None where nothing of them can be used."""
    parts = [_rows(robot, m) for r in recordings for m in motions(robot, r)]
    if not parts:
        return None
    q, links, payload, own, waves, gravity, tau = (np.concatenate(x) for x in zip(*parts, strict=True))
    regions = _regions(q)
    usual = np.maximum(np.sqrt(np.mean(tau**2, axis=0)), 1e-9)
    total = float(robot.pi[::10].sum())
    most = max(0.5 * total, float(usual.max()) / (9.81 * 0.3))
    U, F, B, rows = (np.zeros(robot.n) for _ in range(4))
    for j in range(robot.n):
        of_joint = _OWN * usual[j] / np.maximum(np.abs(own[:, j]).max(axis=0), 1e-9)
        of_joint[-1] = _OWN  # a gain
        known = np.concatenate([_inexactness(robot), most * _CARRIED, of_joint])
        columns = np.concatenate([links[:, j], payload[:, j], own[:, j]], axis=1)
        known_torque = links[:, j] @ robot.pi
        tried = [_left_out(columns * known, tau[:, j] - known_torque - c * gravity[:, j], regions) for c in _GRAVITY]
        U[j], left = max(tried, key=lambda found: found[0])
        rows[j] = _independent(left)
        free = np.concatenate([np.tile(max(total, most) * _BODY, robot.n), of_joint])
        F[j], _ = _left_out(np.concatenate([links[:, j], own[:, j]], axis=1) * free, tau[:, j], regions)
        size = usual[j] / np.maximum(np.sqrt(np.mean(waves**2, axis=0)), 1e-9)
        none = np.concatenate([waves * size, own[:, j, :6] * of_joint[:6]], axis=1)
        B[j], _ = _left_out(none, tau[:, j], regions)
    return Likelihoods(U, F, B, float(np.median(rows)))


def _rows(robot: RobotModel, m: Motion) -> tuple[FloatArray, ...]:
    """Positions and, through one low-pass, the columns of links (N, n, 10 n), payload (N, n, 10), what a joint has of its own
    (N, n, 9), of no robot (N, w), and the torque (N, n)."""
    from scipy import signal  # takes longer to load than the rest of the package

    rate = 1.0 / m.period
    sections = signal.butter(4, min(_CUTOFF, 0.4 * rate), fs=rate, output="sos")
    every = max(1, int(rate / _RATE))

    def low(x: FloatArray) -> FloatArray:
        return np.ascontiguousarray(signal.sosfiltfilt(sections, x, axis=0)[::every])

    q, v, a, rigid = m.q, m.v, m.a, m.rigid_torque
    sign = smoothed_sign(v)
    friction = [np.ones_like(v), v, v * np.abs(v), a, sign, np.tanh(v / _SLOW)]
    turns = [np.sin(q), np.cos(q), np.sin(2.0 * q), np.cos(2.0 * q)]
    own = np.stack([*friction, *turns, np.abs(rigid) * sign, rigid], axis=-1)
    circle = np.concatenate([np.sin(q), np.cos(q)], axis=1)
    (i, k), (s, t) = np.triu_indices(circle.shape[1], 1), np.triu_indices(robot.n)
    waves = np.concatenate([circle, circle[:, i] * circle[:, k], a, v[:, s] * v[:, t]], axis=1)
    return (
        q[::every],
        low(m.regressor),
        low(m.payload_regressor(robot.default_frame)),
        low(own),
        low(waves),
        low(m.gravity_torque),
        low(m.tau),
    )


def _inexactness(robot: RobotModel) -> FloatArray:
    """Standard deviation of what a URDF says of its links, shape (10 n,)."""
    out = np.zeros((robot.n, 10))
    least = 0.02 * float(robot.pi[::10].max())
    for row, body in zip(out, robot.pi.reshape(-1, 10), strict=True):
        mass = max(float(body[0]), least)
        first = float(np.linalg.norm(body[1:4])) / mass
        moment = max(float(body[[4, 6, 9]].max()), mass * _GYRATION**2)
        row[:] = [_MASS * mass] + [mass * float(np.hypot(_PLACE, _MASS * first))] * 3 + [_INERTIA * moment] * 6
    return out.ravel()


def _regions(q: FloatArray) -> NDArray[np.intp]:
    """Region of the joint space of each row, shape (N,), by k-means."""
    from scipy.cluster.vq import kmeans2

    scale = np.maximum(q.std(axis=0), 1e-6)
    return np.asarray(kmeans2(q / scale, _REGIONS, seed=0, minit="++")[1], dtype=np.intp)


def _left_out(X: FloatArray, y: FloatArray, regions: NDArray[np.intp]) -> tuple[float, FloatArray]:
    """Mean log-likelihood of a row of the regions left out in turn, under the noise that they show, and their errors, shape (N,).

    Args:
        X: columns times the standard deviation of their parameters. y: shape (N,).
    """
    labels = np.unique(regions)
    sums = [(X[regions == r].T @ X[regions == r], X[regions == r].T @ y[regions == r]) for r in labels]
    A, b = sum(s[0] for s in sums), sum(s[1] for s in sums)
    noise, error = 0.1 * max(float(np.var(y)), 1e-12), np.empty(len(y))
    for _ in range(4):  # the noise that the prior is weighed with is the one that is shown
        for r, (own, side) in zip(labels, sums, strict=True):
            at = regions == r
            error[at] = y[at] - X[at] @ np.linalg.solve((A - own) / noise + np.eye(X.shape[1]), (b - side) / noise)
        noise = max(float(np.mean(error**2)), 1e-12)
    return -0.5 * float(np.log(2.0 * np.pi * noise) + 1.0), error


def _independent(error: FloatArray) -> float:
    """How many rows of a series count: N over the sum of its autocorrelation up to where that is first lost in the noise
    (Geyer 1992)."""
    power = np.abs(np.fft.rfft(error - error.mean(), 2 * len(error))) ** 2
    correlation = np.fft.irfft(power)[: len(error)]
    correlation = correlation / max(float(correlation[0]), 1e-300)
    lost = np.flatnonzero(correlation <= 0.0)
    return float(len(error) / (2.0 * np.sum(correlation[: int(lost[0]) if lost.size else len(error)]) - 1.0))
