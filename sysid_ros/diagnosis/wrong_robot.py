"""Whether the URDF can be that of the robot that was recorded, by whether it explains anything that no URDF would explain."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.recording import Recording

_ROWS = 500
_NEAR = 0.1
"""Part of the torque, or of what friction, rotors and offsets alone leave of it, that a right URDF leaves (median)."""
_MOST = 0.05
"""The same of the squared torque of all joints together, in (N m)^2: a robot whose large ones are explained is no other one."""
_HELPS, _HELPS_ALL = 0.6, 0.7
"""A right URDF lowers what is left to less than this part: in the median of the joints, or in their mean of logarithms."""
_EXPLAINED, _LOADED = 0.2, 0.25
_CAUSES = (slice(0, 0), slice(0, 10), slice(10, 13), slice(13, 14))
"""Columns of none, a payload, a force and gravity among those of the whole arm."""
_TIMES = 8
"""Times in a recording at which a payload is assumed to be picked up or set down."""
_CURRENT = 3.3
"""Factor from which efforts can be currents."""
_FITS = 0.05
_OWN = 4
_BLOCKS, _FOLDS, _CUT = 12, 4, 1e-3
_BODIES = 0.5
"""Part of the torque beyond friction, rotor and offset that is left where no bodies on the links explain it."""
_MEANT = 0.02
"""Part of that torque's power that the URDF's own has at least on a joint whose torque is not noise alone."""


def wrong_robot(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    """Why the URDF can't be that of the robot, with the cure; None where it can.

    A payload, a force on the tool, gravity that is missing or doubled, and friction, rotor and offset of each joint are fitted
    twice: to what the URDF leaves of the torque, and to the torque itself. The right URDF, wrong as it may be, leaves much less;
    that of another robot leaves as much as none at all. A joint whose torque is mostly noise is not asked: it is far more
    than the URDF's own, and no bodies on this robot's links explain it, whatever they weigh.

    Where friction is most of the torque, both leave the same of a right one too; but then a payload, one that is picked up or set
    down, a force or gravity alone bring the joints that bear a load down to their friction.

    Args:
        recordings: after the faults of units, signs and order were undone.
    """
    parts = [m for r in recordings for m in motions(robot, r)]
    if not parts:
        return None
    count = sum(len(m.t) for m in parts)
    every = slice(None, None, max(1, count // _ROWS))
    q, v, a, tau = (np.concatenate([getattr(m, name)[every] for m in parts]) for name in ("q", "v", "a", "tau"))
    nominal = robot.rnea_along(q, v, a)
    size = np.maximum(np.mean(tau**2, axis=0), 1e-12)
    own = _own(v, a)
    left, alone = (np.array([_left(own[:, j], y[:, j]) for j in range(robot.n)]) / size for y in (tau - nominal, tau))
    asked = _by_bodies(robot.regressor_along(q, v, a), tau, own) < _BODIES * alone * size
    asked |= np.array([_left(own[:, j], nominal[:, j]) for j in range(robot.n)]) > _MEANT * alone * size
    if not asked.any():
        asked[:] = True
    loaded = (alone > _LOADED) & asked
    if _without_gravity(robot, q, tau, nominal, own):
        return None
    if float(left @ size) < _MOST * float(alone @ size):
        return None
    if not loaded.any() or np.median(left) < _NEAR or np.median((left / alone)[loaded]) < _NEAR:
        return None
    arm = _whole_arm(robot, q, v, a, own)
    if _one_cause(arm, tau, nominal, alone, loaded) < _EXPLAINED or _helps(arm[:, asked], tau[:, asked], nominal[:, asked]):
        return None
    late = np.concatenate([m.t[every] / max(float(m.t[-1]), 1e-9) for m in parts])
    owner = np.concatenate([np.full(len(m.t[every]), i) for i, m in enumerate(parts)])
    if _event(arm[:, :, :10], np.concatenate([own, _drift(own, late)], axis=2), tau, nominal, alone, loaded, owner) < _EXPLAINED:
        return None
    gains = _gains_of_currents(own, tau, nominal, size)
    if gains is not None and _helps(arm[:, asked], (tau / gains)[:, asked], nominal[:, asked]):
        return None
    worst = ", ".join(f"{robot.joint_names[j]} {100 * np.sqrt(left[j]):.0f} %" for j in np.argsort(-left)[:3])
    return (
        f"The URDF '{robot.name}' does not explain these torques: beside friction it leaves {worst} of them (rms), and with any "
        "payload and force it explains no more than no model at all. It is another robot's URDF, or the efforts are no joint "
        "torques; give the URDF of the robot that was recorded (--urdf)."
    )


def _one_cause(arm: FloatArray, tau: FloatArray, nominal: FloatArray, alone: FloatArray, loaded: NDArray[np.bool_]) -> float:
    """What the URDF with one cause of the whole arm leaves of what friction, rotor and offset alone leave, over the joints for
    which that is much: the geometric mean, for the cause for which it is least."""
    joints = range(_CAUSES[-1].stop, arm.shape[2])
    causes = (arm[:, :, [*range(cause.start, cause.stop), *joints]] for cause in _CAUSES)
    return min(_explained_by(columns, tau, nominal, alone, loaded) for columns in causes)


def _event(
    payload: FloatArray,
    own: FloatArray,
    tau: FloatArray,
    nominal: FloatArray,
    alone: FloatArray,
    loaded: NDArray[np.bool_],
    owner: NDArray[np.int_],
) -> float:
    """As :func:`_one_cause`, for a payload that is there only from some time on, or up to some time, or both.

    Args:
        payload: columns, shape (N, n, 10). own: of each joint, shape (N, n, p). owner: stretch of each instant, shape (N,).
    """
    n = payload.shape[1]
    joints = np.concatenate([own[:, :, None, k] * np.eye(n) for k in range(own.shape[2])], axis=2)
    found = []
    for stretch in np.unique(owner):
        within = np.flatnonzero(owner == stretch)
        cuts = within[0] + np.linspace(0, len(within), _TIMES + 2).astype(int)
        for first, last in combinations(cuts, 2):
            carried = np.zeros_like(payload)
            carried[first:last] = payload[first:last]
            found.append(_explained_by(np.concatenate([carried, joints], axis=2), tau, nominal, alone, loaded))
    return min(found)


def _explained_by(
    columns: FloatArray, tau: FloatArray, nominal: FloatArray, alone: FloatArray, loaded: NDArray[np.bool_]
) -> float:
    scale = 1.0 / np.sqrt(np.maximum(np.mean(tau**2, axis=0), 1e-12))
    rest = ((tau - nominal) * scale).ravel()
    X = (columns * scale[:, None]).reshape(-1, columns.shape[2])
    left = np.mean((rest - X @ np.linalg.lstsq(X, rest, rcond=1e-7)[0]).reshape(tau.shape) ** 2, axis=0)
    return float(np.exp(np.mean(np.log(np.maximum(left / alone, 1e-6)[loaded]))))


def _drift(own: FloatArray, late: FloatArray) -> FloatArray:
    """A drift of each joint's offset, shape (N, n, 1)."""
    return np.asarray(np.broadcast_to(late[:, None, None], (*own.shape[:2], 1)))


def _own(v: FloatArray, a: FloatArray) -> FloatArray:
    """Friction, rotor and offset of each joint, shape (N, n, 4)."""
    return np.stack([smoothed_sign(v), v, a, np.ones_like(v)], axis=-1)


def _left(X: FloatArray, y: FloatArray) -> float:
    theta = np.linalg.lstsq(X, y, rcond=None)[0]
    return float(np.mean((y - X @ theta) ** 2))


def _by_bodies(regressor: FloatArray, tau: FloatArray, own: FloatArray) -> FloatArray:
    """Mean square of each joint's torque that bodies on the links, whatever they weigh, leave beside the joint's own, shape (n,).

    Each block of rows is predicted from the others: what is only noise is not explained by fitting many columns to it.
    """
    blocks = np.arange(len(tau)) * _BLOCKS // len(tau) % _FOLDS
    left = np.zeros(tau.shape[1])
    for j in range(tau.shape[1]):
        X = np.concatenate([own[:, j], regressor[:, j]], axis=1)
        X /= np.maximum(np.sqrt(np.mean(X**2, axis=0)), 1e-9)
        for fold in range(_FOLDS):
            judged = blocks == fold
            theta = np.linalg.lstsq(X[~judged], tau[~judged, j], rcond=_CUT)[0]
            left[j] += float(np.sum((tau[judged, j] - X[judged] @ theta) ** 2)) / len(tau)
    return left


def _without_gravity(robot: RobotModel, q: FloatArray, tau: FloatArray, nominal: FloatArray, own: FloatArray) -> bool:
    """True where the efforts hold no weight of any link, and the URDF's gravity is all that keeps it from them.

    Then no more than small inertial torques are left to compare, which may be as large as the noise.
    """
    still = np.zeros_like(q)
    gravity = robot.rnea_along(q, still, still)
    if np.median(np.sum((tau - nominal + gravity) ** 2, axis=0) / np.sum((tau - nominal) ** 2, axis=0)) > _NEAR:
        return False
    alone = np.array([_left(own[:, j], tau[:, j]) for j in range(robot.n)])
    left = _by_bodies(robot.regressor_along(q, still, still), tau, own)
    borne = np.mean(gravity**2, axis=0) > alone
    return bool(borne.any() and np.median((left / alone)[borne]) > _BODIES)


def _whole_arm(robot: RobotModel, q: FloatArray, v: FloatArray, a: FloatArray, own: FloatArray) -> FloatArray:
    """Columns of a payload, of a force, of gravity and of each joint's own, shape (N, n, p)."""
    n, frame, still = robot.n, robot.frame_id(robot.default_frame), np.zeros_like(q)
    columns = np.zeros((len(q), n, 14 + _OWN * n))
    columns[:, :, :10] = [robot.payload_regressor(*state, frame) for state in zip(q, v, a, strict=True)]
    columns[:, :, 10:13] = robot.frame_jacobian_along(q, frame).swapaxes(1, 2)
    columns[:, :, 13] = robot.rnea_along(q, still, still)
    for j in range(n):
        columns[:, j, 14 + _OWN * j : 14 + _OWN * (j + 1)] = own[:, j]
    return columns


def _helps(columns: FloatArray, tau: FloatArray, nominal: FloatArray) -> bool:
    """True where much less is left with the URDF than without it."""
    scale = 1.0 / np.sqrt(np.maximum(np.mean(tau**2, axis=0), 1e-12))
    X = (columns * scale[:, None]).reshape(-1, columns.shape[2])
    left = []
    for y in (tau - nominal, tau):
        rest = (y * scale).ravel()
        theta = np.linalg.lstsq(X, rest, rcond=1e-7)[0]
        left.append(np.mean((rest - X @ theta).reshape(tau.shape) ** 2, axis=0))
    ratio = np.maximum(left[0], 1e-30) / np.maximum(left[1], 1e-30)
    return bool(np.median(ratio) < _HELPS or np.exp(np.mean(np.log(ratio))) < _HELPS_ALL)


def _gains_of_currents(own: FloatArray, tau: FloatArray, nominal: FloatArray, size: FloatArray) -> FloatArray | None:
    """One factor a joint, shape (n,), where the efforts are the torques times such factors, far from 1; else None."""
    gains, left = np.ones(tau.shape[1]), np.ones(tau.shape[1])
    for j in range(tau.shape[1]):
        X = np.column_stack([nominal[:, j], own[:, j]])
        theta = np.linalg.lstsq(X, tau[:, j], rcond=None)[0]
        gains[j], left[j] = theta[0], np.mean((tau[:, j] - X @ theta) ** 2) / size[j]
    usual = float(np.median(gains))
    if usual <= 0.0 or 1.0 / _CURRENT < usual < _CURRENT or np.median(left) > _FITS:
        return None
    return np.where(gains > 0.1 * usual, gains, usual)
