"""Contacts that stand out before anything is fitted, and what looks like them: a body that is picked up or set down."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sysid_ros.diagnosis.contacts import SMEARED, Contact, find_contacts, is_change
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.effects import Motion
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray

_RATE = 50.0
"""Rate at which strong contacts are looked for [Hz]."""
_OWN = 7
"""Columns a joint."""
_FAR, _ROUNDS = 4.7, 5
"""Tukey's bisquare: residual, in robust standard deviations, from which a row has no weight; how often it is fitted."""
_RIDGE = 1e-9
"""Decides what the motion does not show."""
_STEPS = 20
"""Times in a recording at which the payload is let change."""
_PAYS = 0.8
"""A change of the payload must lower the robust cost to less than this part."""


@dataclass(frozen=True, eq=False)
class _Rows:
    """What a payload, friction, rotors, offsets and their drifts would do, and what the nominal model leaves.

    Attributes:
        X: columns, shape (N, n, p). y: torque that is left, shape (N, n) [N m]. moving: where each joint moves, shape (N, n).
        payload: columns of a payload, shape (N, n, 10). owner: recording of each instant. t: time in it [s], shape (N,).
    """

    X: FloatArray
    y: FloatArray
    moving: NDArray[np.bool_]
    payload: FloatArray
    owner: NDArray[np.int_]
    t: FloatArray

    def with_change(self, recording: int, t0: float) -> _Rows:
        """The rows with a payload that one recording carries from a time on."""
        later = ((self.owner == recording) & (self.t > t0)).astype(float)
        return replace(self, X=np.concatenate([self.X, self.payload * later[:, None, None]], axis=2))


@dataclass(frozen=True, eq=False)
class _RobustFit:
    """Residual, shape (N, n), its robust standard deviation, shape (n,), and Tukey's cost of it."""

    left: FloatArray
    scale: FloatArray
    cost: float


def strong_contacts(robot: RobotModel, train: Prepared) -> list[Contact]:
    """Contacts that stand out in what a payload, friction, rotors, offsets and their drifts leave.

    The parameters are found by least squares with the weights of Tukey's bisquare, which windows far off do not pull. A payload
    that is picked up or set down once leaves windows too in which a force of one direction explains all: before a contact is
    claimed, the payload of each recording is let change once.
    """
    every = [slice(None, None, max(1, int(1.0 / (_RATE * m.period)))) for m in train.motions]
    motions = [Motion(robot, *(x[s] for x in (m.t, m.q, m.v, m.a, m.tau))) for m, s in zip(train.motions, every, strict=True)]
    moves = [x[s] for x, s in zip(train.band.moving, every, strict=True)]
    nominal = [x[s] for x, s in zip(train.nominal, every, strict=True)]
    rows = _rows(robot, motions, nominal, moves)

    def found(fit: _RobustFit) -> list[Contact]:
        parts = np.split(fit.left, np.cumsum([len(m.t) for m in motions])[:-1])
        return find_contacts(robot, train.names, motions, parts, nominal, moves)

    fit = _fit(rows)
    contacts = found(fit)
    for recording, motion in enumerate(motions):
        if not contacts:
            break
        t0 = _change(rows, recording, motion.t, fit)
        if t0 is not None:
            rows = rows.with_change(recording, t0)
            fit = _fit(rows)
            contacts = [c for c in found(fit) if c.recording != train.names[recording] or not is_change(c, t0)]
    return contacts


def _change(rows: _Rows, recording: int, t: FloatArray, fit: _RobustFit) -> float | None:
    """When the payload of a recording changed [s], by the least robust cost; None where a change does not pay."""

    def cost(t0: float) -> float:
        return _fit(rows.with_change(recording, t0), fit.scale).cost

    times, step = np.linspace(t[0], t[-1], _STEPS + 2, retstep=True)
    best = float(min(times[1:-1], key=cost))
    if cost(best) > _PAYS * fit.cost:
        return None
    return float(min(np.arange(best - step, best + step, SMEARED / 3.0), key=cost))


def _rows(robot: RobotModel, motions: list[Motion], nominal: list[FloatArray], moves: list[NDArray[np.bool_]]) -> _Rows:
    columns, payloads = [], []
    for motion in motions:
        count, n = motion.q.shape
        X = np.zeros((count, n, 10 + _OWN * n))
        late = motion.t / max(float(motion.t[-1]), 1e-9)
        X[:, :, :10] = motion.payload_regressor(robot.default_frame)
        payloads.append(X[:, :, :10])
        for j in range(n):
            v = motion.v[:, j]
            s, own = smoothed_sign(v), slice(10 + _OWN * j, 10 + _OWN * (j + 1))
            X[:, j, own] = np.stack([s, v, np.ones(count), motion.a[:, j], s * late, v * late, late], axis=1)
        columns.append(X)
    return _Rows(
        np.concatenate(columns),
        np.concatenate([m.tau - x for m, x in zip(motions, nominal, strict=True)]),
        np.concatenate(moves),
        np.concatenate(payloads),
        np.concatenate([np.full(len(m.t), k) for k, m in enumerate(motions)]),
        np.concatenate([m.t for m in motions]),
    )


def _fit(rows: _Rows, judged_by: FloatArray | None = None) -> _RobustFit:
    """The robust fit; its cost is in units of ``judged_by``, the standard deviations of another one, shape (n,)."""
    weight = rows.moving.astype(float)
    theta = np.zeros(rows.X.shape[2])
    for _ in range(_ROUNDS):
        left = rows.y - rows.X @ theta
        scale = _scale(left, rows.moving)
        if theta.any():
            weight = rows.moving * (1.0 - _far(left, scale)) ** 2
        root = np.sqrt(weight) / scale
        theta = _least_squares((rows.X * root[:, :, None]).reshape(-1, len(theta)), (rows.y * root).ravel())
    left = rows.y - rows.X @ theta
    far = _far(left, _scale(left, rows.moving) if judged_by is None else judged_by)
    return _RobustFit(left, _scale(left, rows.moving), float(np.sum(1.0 - (1.0 - far) ** 3)))


def _scale(left: FloatArray, moving: NDArray[np.bool_]) -> FloatArray:
    values = [np.median(np.abs(left[m, j])) if m.any() else 1.0 for j, m in enumerate(moving.T)]
    return np.maximum(1.4826 * np.array(values), 1e-12)


def _far(left: FloatArray, scale: FloatArray) -> FloatArray:
    """Mean square of each instant over that at which it has no weight, at most 1, shape (N, 1)."""
    return np.asarray(np.minimum(np.mean((left / scale) ** 2, axis=1, keepdims=True) / _FAR**2, 1.0))


def _least_squares(X: FloatArray, y: FloatArray) -> FloatArray:
    """Parameters by the normal equations of columns of length 1, which are many times faster here than by singular values."""
    length = np.maximum(np.sqrt(np.sum(X**2, axis=0)), 1e-12)
    columns = X / length
    theta: FloatArray = np.linalg.solve(columns.T @ columns + _RIDGE * np.eye(X.shape[1]), columns.T @ y) / length
    return theta
