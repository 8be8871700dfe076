"""Whether a URDF is that of the recorded robot: how likely it makes data that were not fitted, beside models that know less.

Three Gaussian models of the same rows, each joint by itself, each with the noise that its own left-out error shows:

    U   the URDF's bodies, known as well as a URDF is, a payload that the arm may carry, and the joint's own torques
    F   the same kinematics with bodies of any size
    B   no robot: sines and cosines of the joints, their products, accelerations, products of speeds

The right URDF, wrong as it may be in the things that a diagnosis finds, predicts better than F, which must learn all of it, and
than B. What is left out is a *region of the joint space*: a model that only remembers the path would otherwise have seen it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.recording import Recording

_CUTOFF, _RATE = 8.0, 40.0
_FOLDS = 10
_MASS, _PLACE = 0.15, 0.03
_GYRATION = 0.08
_OWN_WIDTHS = (0.02, 0.15)


@dataclass(frozen=True)
class Evidence:
    """Mean left-out log-likelihood of a row of each joint, shape (n,): of the URDF, of free bodies, of no robot."""

    urdf: FloatArray
    free: FloatArray
    black_box: FloatArray
    rows: int


def robot_likelihood(robot: RobotModel, recordings: Sequence[Recording]) -> Evidence | None:
    """The evidence of some recordings; None where nothing of them can be used."""
    parts = [_rows(robot, m) for r in recordings for m in motions(robot, r)]
    if not parts:
        return None
    q, Y, own, black, nominal, payload, tau = (np.concatenate(x) for x in zip(*parts, strict=True))
    folds = _regions(robot, q)
    pi = robot.pi
    spread = _inexactness(robot)
    carried = _carried(robot)
    U, F, B = (np.full(robot.n, np.nan) for _ in range(3))
    for j in range(robot.n):
        X = np.concatenate([Y[:, j], payload[:, j], own[:, j]], axis=1)
        limit = _size(tau[:, j])
        vmax=float(np.abs(own[:,j,1]).max()); amax=float(np.abs(own[:,j,3]).max())
        o = 0.3*limit*np.array([1.0, 1/vmax, 1/vmax**2, 1/amax, 1.0, 1.0, 1.0/limit, 1.0/limit, 3.0/limit])
        U[j] = _left_out(X, tau[:, j] - Y[:, j] @ pi, np.concatenate([spread, carried, o]), folds)
        X = np.concatenate([Y[:, j], own[:, j]], axis=1)
        F[j] = _left_out(X, tau[:, j], np.concatenate([_free(robot), o]), folds)
        X = np.concatenate([black, own[:, j, :6]], axis=1)
        B[j] = _left_out(X, tau[:, j], np.concatenate([_black(black,limit), o[:6]]), folds)
    return Evidence(U, F, B, len(tau))


def _rows(robot: RobotModel, m: Motion) -> tuple[FloatArray, ...]:
    from scipy import signal

    rate = 1.0 / m.period
    sections = signal.butter(4, min(_CUTOFF, 0.4 * rate), fs=rate, output="sos")
    every = max(1, int(rate / _RATE))

    def low(x: FloatArray) -> FloatArray:
        return np.ascontiguousarray(signal.sosfiltfilt(sections, x, axis=0)[::every])

    q, v, a = m.q, m.v, m.a
    nominal = m.rigid_torque
    own = np.stack(
        [np.ones_like(v), v, v * np.abs(v), a]
        + [np.tanh(v / w) for w in _OWN_WIDTHS]
        + [np.abs(nominal) * np.tanh(v / _OWN_WIDTHS[0]), nominal, m.gravity_torque],
        axis=-1,
    )
    s, c = np.sin(q), np.cos(q)
    waves = np.concatenate([s, c], axis=1)
    pairs = np.triu_indices(waves.shape[1], 1)
    speeds = np.triu_indices(robot.n)
    black = np.concatenate([waves, waves[:, pairs[0]] * waves[:, pairs[1]], a, v[:, speeds[0]] * v[:, speeds[1]]], axis=1)
    return m.q[::every], low(m.regressor), low(own), low(black), low(nominal), low(m.payload_regressor(robot.default_frame)), low(m.tau)


def _inexactness(robot: RobotModel) -> FloatArray:
    """Standard deviation of what a URDF says of its links, shape (10 n,)."""
    out = np.zeros((robot.n, 10))
    for j, body in enumerate(robot.pi.reshape(-1, 10)):
        m = max(body[0], 0.02 * float(robot.pi[::10].max()))
        first = np.linalg.norm(body[1:4]) / m
        moment = max(float(body[[4, 6, 9]].max()), m * _GYRATION**2)
        out[j] = [_MASS * m] + [m * np.hypot(_PLACE, _MASS * first)] * 3 + [0.3 * moment] * 6
    return out.ravel()


def _black(black: FloatArray, limit: float) -> FloatArray:
    return limit / np.maximum(np.sqrt(np.mean(black**2, axis=0)), 1e-9)


def _free(robot: RobotModel) -> FloatArray:
    most = float(robot.pi[::10].sum())
    return np.tile(np.array([most] + [most * 0.3] * 3 + [most * 0.1] * 6),robot.n)


def _carried(robot: RobotModel) -> FloatArray:
    most = 0.5 * float(robot.pi[::10].sum())
    return np.array([most] + [most * 0.15] * 3 + [most * 0.03] * 6)


def _size(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(x**2))) or 1.0


def _regions(robot: RobotModel, q: FloatArray) -> NDArray[np.intp]:
    """Region of the joint space of each row, shape (N,): neighbours in it are left out together."""
    from scipy.cluster.vq import kmeans2

    scale = np.maximum(q.std(axis=0), 1e-6)
    _, label = kmeans2(q / scale, _FOLDS, seed=0, minit="++")
    return np.asarray(label, dtype=np.intp)


def _left_out(X: FloatArray, y: FloatArray, std: FloatArray, folds: NDArray[np.intp]) -> float:
    """Mean log-likelihood of a row of the regions left out in turn, under the noise that they show."""
    X = X * std
    labels = np.unique(folds)
    sums = [(X[folds == f].T @ X[folds == f], X[folds == f].T @ y[folds == f]) for f in labels]
    A, b = sum(s[0] for s in sums), sum(s[1] for s in sums)
    noise = float(np.var(y)) * 0.1
    for _ in range(4):
        error = np.empty(len(y))
        for f, (Af, bf) in zip(labels, sums, strict=True):
            theta = np.linalg.solve((A - Af) / noise + np.eye(len(b)), (b - bf) / noise)
            at = folds == f
            error[at] = y[at] - X[at] @ theta
        noise = max(float(np.mean(error**2)), 1e-12)
    return -0.5 * float(np.log(2.0 * np.pi * noise) + 1.0)
