"""Contacts in fitted and in held-out recordings, as findings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.contacts import Contact, find_contacts
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.result import Finding, Parameter
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.effects import ExternalForce, Motion
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_95 = 1.959964
_SIGN = 0.02
"""Width of the sign of a velocity [rad/s]."""
_RATE = 50.0
"""Rate at which strong contacts are looked for [Hz]."""
_OWN = 7
"""Columns a joint, before anything is fitted."""
_FAR, _ROUNDS = 4.7, 5
"""Tukey's bisquare: residual, in robust standard deviations, from which a row has no weight; how often it is fitted."""
_RIDGE = 1e-9
"""Decides what the motion does not show."""
_EDGE = 0.03
"""Standard deviation of the times at which a contact begins and ends: about half of what the filters smear [s]."""


def strong_contacts(robot: RobotModel, train: Prepared) -> list[Contact]:
    """Contacts that stand out before anything is fitted: in what a payload, friction, rotors, offsets and their drifts leave.

    The parameters are found by least squares with the weights of Tukey's bisquare, which windows far off do not pull.
    """
    frame = robot.default_frame
    columns, rest, motions, moves = [], [], [], []
    for whole, nominal_torque, moving_all in zip(train.motions, train.nominal, train.band.moving, strict=True):
        every = slice(None, None, max(1, int(1.0 / (_RATE * whole.period))))
        motion = Motion(robot, *(x[every] for x in (whole.t, whole.q, whole.v, whole.a, whole.tau)))
        nominal = nominal_torque[every]
        motions.append(motion)
        moves.append(moving_all[every])
        count, n = motion.q.shape
        X = np.zeros((count, n, 10 + _OWN * n))
        late = motion.t / max(float(motion.t[-1]), 1e-9)
        X[:, :, :10] = motion.payload_regressor(frame)
        for j in range(n):
            v = motion.v[:, j]
            s, own = np.tanh(v / _SIGN), slice(10 + _OWN * j, 10 + _OWN * (j + 1))
            X[:, j, own] = np.stack([s, v, np.ones(count), motion.a[:, j], s * late, v * late, late], axis=1)
        columns.append(X)
        rest.append(motion.tau - nominal)
    X, y = np.concatenate(columns), np.concatenate(rest)
    moving = np.concatenate(moves)
    weight = moving.astype(float)
    theta = np.zeros(X.shape[2])
    for _ in range(_ROUNDS):
        left = y - X @ theta
        scale = 1.4826 * np.array([np.median(np.abs(left[m, j])) if m.any() else 1.0 for j, m in enumerate(moving.T)])
        if theta.any():
            far = np.sqrt(np.mean((left / np.maximum(scale, 1e-12)) ** 2, axis=1, keepdims=True)) / _FAR
            weight = moving * np.where(far < 1.0, (1.0 - far**2) ** 2, 0.0)
        root = np.sqrt(weight) / np.maximum(scale, 1e-12)
        theta = _least_squares((X * root[:, :, None]).reshape(-1, X.shape[2]), (y * root).ravel())
    left = y - X @ theta
    parts = np.split(left, np.cumsum([len(m.t) for m in motions])[:-1])
    return find_contacts(robot, train.names, motions, parts, moves)


def _least_squares(X: FloatArray, y: FloatArray) -> FloatArray:
    """Parameters by the normal equations of columns of length 1, which are many times faster here than by singular values."""
    length = np.maximum(np.sqrt(np.sum(X**2, axis=0)), 1e-12)
    columns = X / length
    theta: FloatArray = np.linalg.solve(columns.T @ columns + _RIDGE * np.eye(X.shape[1]), columns.T @ y) / length
    return theta


def contacts_in(robot: RobotModel, train: Prepared, selection: Selection, fit: Fit) -> list[Contact]:
    """Contacts in the recordings that were fitted."""
    return contacts_held_out(robot, HeldOut(train, selection.library, {t: t for t in fit.terms}), fit)


def contacts_held_out(robot: RobotModel, held: HeldOut, fit: Fit) -> list[Contact]:
    """Contacts in recordings that were not fitted."""
    prepared = held.prepared
    residuals = [m.tau - x for m, x in zip(prepared.motions, held.predictions(fit, robot), strict=True)]
    return find_contacts(robot, prepared.names, prepared.motions, residuals, prepared.band.moving)


def contact_findings(contacts: Sequence[Contact], joints: Sequence[str]) -> list[Finding]:
    """One finding for all contacts, none where there is none."""
    if not contacts:
        return []
    values: list[Parameter] = []
    for c in contacts:
        low, high = c.force - _95 * c.std, c.force + _95 * c.std
        values += [
            Parameter("force", None, c.force.tolist(), "N", c.std.tolist(), low.tolist(), high.tolist()),
            Parameter("t0", None, c.start, "s", _EDGE, c.start - _95 * _EDGE, c.start + _95 * _EDGE),
            Parameter("t1", None, c.end, "s", _EDGE, c.end - _95 * _EDGE, c.end + _95 * _EDGE),
            Parameter("frame", None, c.frame, "", 0.0, c.frame, c.frame),
        ]
    shown = "; ".join(f"{c.recording}: {in_words(c)}" for c in contacts[:4]) + ("; ..." if len(contacts) > 4 else "")
    sentence = f"Something pushed the robot. {shown}. These windows are kept out of every other fit."
    share = float(sum(c.share for c in contacts))
    rows = sum(c.rows for c in contacts)
    least = max(1.0 - min(c.explained for c in contacts), 1e-6)
    return [
        Finding(
            ExternalForce.id,
            "contact",
            tuple(joints),
            tuple(values),
            min(share, 1.0),
            float(-rows * np.log(least)),
            0.0,
            (),
            sentence,
            "a short push on all joints below one link at once, gone afterwards",
            ExternalForce.separated_by,
        )
    ]


def in_words(c: Contact) -> str:
    """A contact in half a sentence."""
    size = float(np.linalg.norm(c.force))
    direction = ", ".join(f"{x:.2f}" for x in c.force / max(size, 1e-12))
    return f"from {c.start:.2f} s to {c.end:.2f} s a force of {size:.3g} N along ({direction}) of the base acts on {c.frame}"
