"""Contacts: short windows in which a force pushes the arm, found in what a fit leaves, dated, and kept out of every fit.

A force f on a link loads the joints below it as ``tau = -J(q)' f`` and none above it. In a short window its direction in the
world hardly turns, so what is left has one amplitude g(t) for all joints, ``r(t) = -J(q(t))' d g(t)``: as many numbers as there
are instants, and two for the direction. Friction that is wrong shows on one joint, a body that was picked up does not go away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sysid_ros.diagnosis.band import CUTOFF
from sysid_ros.diagnosis.evidence import Evidence
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.effects import Motion
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

_SMOOTH = 0.05
_PEAK, _REST = 40.0, 5.0
"""Mean square over the joints, in units of its usual value, that a window reaches, and at which it ends."""
_BRIDGE = 0.25
"""Windows nearer to one another are one [s]."""
_LONGEST = 5.0
"""A longer one is no contact [s]."""
_MARGIN = 0.15
"""Left out before and after [s]."""
_EXPLAINED = 0.8
"""Part of a window's energy that must be predicted: that of each joint, by the force that the others tell."""
_JOINTS = 4
"""A force on a link below fewer joints can look like anything."""
_SHARE = 0.05
"""Part of a window's energy from which a joint takes part; at least two must."""
_BETTER = 1e-3
_TURNS = 0.1
"""Time before and after a joint stands in which it is not looked at [s]."""
_AS_WELL = 0.1
"""A force must explain a window by so much better than one joint that gives way."""
SMEARED = 0.15
"""Time over which the filters spread a step [s]."""
_INDEPENDENT = 2.0 * CUTOFF
"""Independent values of the residual of one joint in a second: two a hertz of the band that it is judged in."""
_MOST = 0.3
"""Part of the time: more is no event."""
_STRONG = 1000.0
"""Size of a force before any data [N]: more breaks the arm. Where a posture shows nothing of a direction there is none in it."""


@dataclass(frozen=True)
class Contact:
    """A force that acted for a while.

    Attributes:
        recording: its name. start, end: since the first stamp [s]. frame: link that is pushed.
        force: its mean on the robot, in the world, over the time in which it has more than half of its peak, shape (3,) [N].
        std: of it, shape (3,). peak: of its size [N].
        evidence: its gain is the part of the nominal residual's power that is predicted on each joint from all others.
    """

    recording: str
    start: float
    end: float
    frame: str
    force: FloatArray
    std: FloatArray
    peak: float
    evidence: Evidence

    def in_words(self) -> str:
        """In half a sentence."""
        size = float(np.linalg.norm(self.force))
        direction = ", ".join(f"{x:.2f}" for x in self.force / max(size, 1e-12))
        when = f"from {self.start:.2f} s to {self.end:.2f} s"
        return f"{when} a force of {size:.3g} N along ({direction}) of the base acts on {self.frame}"


def find_contacts(
    robot: RobotModel,
    names: Sequence[str],
    motions: Sequence[Motion],
    residuals: Sequence[FloatArray],
    nominal: Sequence[FloatArray],
    moving: Sequence[NDArray[np.bool_]],
) -> list[Contact]:
    """Contacts in what a fit leaves.

    Args:
        names: recording of each motion. residuals: torque that is left on its grid, shape (N, n) [N m]. nominal: torque of the
            nominal model alike.
        moving: where each joint moves, shape (N, n): friction leaves the torque of a standing joint undetermined.
    """
    pooled = np.concatenate([np.where(m, r, np.nan) for r, m in zip(residuals, moving, strict=True)])
    judged = np.sum(np.isfinite(pooled), axis=0) > 50
    if judged.sum() < _JOINTS:
        return []
    scale = np.full(robot.n, np.inf)
    scale[judged] = 1.4826 * np.nanmedian(np.abs(pooled[:, judged]), axis=0)
    scale = np.maximum(scale, 1e-9)
    out: list[Contact] = []
    seconds, tried = 0.0, 0
    for name, motion, residual, moves in zip(names, motions, residuals, moving, strict=True):
        # where a joint starts or turns, its friction is what is modelled worst
        reach = 2 * round(_TURNS / motion.period) + 1
        moves = ndimage.binary_erosion(moves, np.ones((reach, 1), dtype=np.bool_), border_value=1)
        z = np.where(moves, residual, 0.0) / scale
        for window in _windows(z, moves & judged, motion.period):
            seconds += (window.stop - window.start) * motion.period
            tried += robot.n - _JOINTS + 1
            if (contact := _explain(robot, name, motion, z, scale, window)) is not None:
                out.append(contact)
    if seconds > _MOST * sum(len(m.t) * m.period for m in motions):
        return []
    left = [np.where(moves, m.tau - x, 0.0) / scale for m, x, moves in zip(motions, nominal, moving, strict=True)]
    energy = sum(float(np.sum(z**2)) * m.period for z, m in zip(left, motions, strict=True))
    return [
        replace(c, evidence=replace(c.evidence, gain=(c.evidence.gain or 0.0) / max(energy, 1e-12), candidates=tried))
        for c in out
    ]


def without(recording: Recording, contacts: Sequence[Contact]) -> Recording:
    """The recording without the windows of its contacts."""
    t = recording.t - recording.start
    keep = np.ones(len(t), dtype=np.bool_)
    for c in contacts:
        if c.recording == recording.name:
            keep &= (t < c.start - _MARGIN) | (t > c.end + _MARGIN)
    keep[0] = True  # times count from the first stamp
    return recording.at(keep)


def _windows(z: FloatArray, used: NDArray[np.bool_], period: float) -> list[slice]:
    """Where the energy of several joints is far above what it usually is, and back again before the end."""
    count = np.maximum(used.sum(axis=1), 1)
    energy = np.sum(z**2, axis=1) / count
    energy = ndimage.uniform_filter1d(energy, max(1, round(_SMOOTH / period)))
    # where the usual level itself goes up and down, the model is wrong there; that is no event
    level = max(1.0, float(np.quantile(energy, 0.8)))
    above = ndimage.binary_closing(energy > _REST * level, np.ones(max(1, round(_BRIDGE / period)), dtype=bool))
    labels, _ = ndimage.label(above)
    out = []
    for (where,) in ndimage.find_objects(labels):
        # an end at which the joints stand is none: nothing is seen there
        after = used[where.stop : where.stop + max(1, round(_MARGIN / period))]
        inside = where.start > 0 and where.stop < len(energy) and bool(np.all(after.sum(axis=1) >= 2))
        if inside and (where.stop - where.start) * period < _LONGEST and energy[where].max() > _PEAK * level:
            out.append(where)
    return out


def _explain(robot: RobotModel, name: str, motion: Motion, z: FloatArray, scale: FloatArray, window: slice) -> Contact | None:
    """The force that explains a window, on the link where it does so best; None where no force does."""
    residual = z[window]
    power = np.sum(residual**2, axis=0)
    if np.sum(power > _SHARE * power.sum()) < 2:
        return None
    explained, best = -np.inf, ""
    for frame in robot.body_names[_JOINTS - 1 : robot.n]:
        columns = _of_force(robot, frame, motion.q[window], scale, residual)
        direction, size = _one_direction(columns, residual)
        left = residual - np.einsum("kjx,x->kj", columns, direction) * size[:, None]
        part = 1.0 - float(np.sum(left**2) / np.sum(residual**2))
        # where two links share an origin the nearer one is named
        if part > explained + _BETTER:
            explained, best = part, frame
    columns = _of_force(robot, best, motion.q[window], scale, residual)
    removed = _predicted(columns, residual)
    if removed < _EXPLAINED * power.sum():
        return None
    if _one_joint(motion.sensitivity[2][window] / scale[:, None], residual) > explained - _AS_WELL:
        return None
    size = _one_direction(columns, residual)[1]
    size = size if size.sum() >= 0.0 else -size
    strong = size > 0.5 * size.max()
    X, y = columns[strong].reshape(-1, 3), residual[strong].ravel()
    information = X.T @ X + np.eye(3) / _STRONG**2
    force = np.linalg.solve(information, X.T @ y)
    independent = max(3.0, _INDEPENDENT * strong.sum() * motion.period * np.count_nonzero(np.any(columns[strong], axis=(0, 2))))
    variance = float(np.mean((y - X @ force) ** 2)) * len(y) / independent
    std = np.sqrt(np.diag(np.linalg.inv(information)) * max(variance, len(y) / independent))
    start, end = float(motion.t[window.start]), float(motion.t[window.stop - 1])
    # a direction and its amplitudes, against nothing
    amplitudes = _INDEPENDENT * len(residual) * motion.period
    rows = amplitudes * np.count_nonzero(power)
    rise = -rows * float(np.log(max(1.0 - explained, np.finfo(float).eps)))
    evidence = Evidence(rise, 2 + max(1, round(amplitudes)), float(rows), 1, removed * motion.period)
    return Contact(name, start, end, best, force, std, float(size.max()), evidence)


def _of_force(robot: RobotModel, frame: str, q: FloatArray, scale: FloatArray, residual: FloatArray) -> FloatArray:
    """Torques of unit forces on a link over the scales, shape (k, n, 3); 0 where the residual, shape (k, n), is not judged."""
    jacobian = robot.frame_jacobian_along(q, robot.frame_id(frame))[:, :3]
    return np.where((residual == 0.0)[:, :, None], 0.0, -jacobian.swapaxes(1, 2) / scale[:, None])


def _predicted(columns: FloatArray, residual: FloatArray) -> float:
    """By how much the squared residual falls where the force that the other joints tell predicts each joint.

    Args:
        columns: A, shape (k, n, 3). residual: shape (k, n), zero where not judged.
    """
    out = 0.0
    for j in np.flatnonzero(np.any(columns, axis=(0, 2))):
        others = np.delete(np.arange(columns.shape[1]), j)
        direction, size = _one_direction(columns[:, others], residual[:, others])
        out += float(np.sum(residual[:, j] ** 2 - (residual[:, j] - columns[:, j] @ direction * size) ** 2))
    return out


def _one_joint(columns: FloatArray, residual: FloatArray) -> float:
    """Part of a residual that the acceleration of one link against its motor explains: an elastic joint, or one with play.

    Args:
        columns: mass matrix with its rows over the scales, shape (k, n, n). residual: shape (k, n), zero where not judged.
    """
    columns = np.where((residual == 0.0)[:, :, None], 0.0, columns)
    along = np.einsum("kij,ki->kj", columns, residual) ** 2 / np.maximum(np.sum(columns**2, axis=1), 1e-12)
    return float(np.max(along.sum(axis=0)) / np.sum(residual**2))


def _one_direction(columns: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vector d, shape (3,), and amplitude g, shape (k,), that minimise ``sum_k |r_k - A_k d g_k|^2 + (g_k / F)^2``, with the
    usual size F of a force.

    Args:
        columns: A, shape (k, n, 3). residual: r, shape (k, n).
    """
    least = 1.0 / _STRONG**2
    normal = np.einsum("kjx,kjy->xy", columns, columns) + len(residual) * least * np.eye(3)
    direction = np.linalg.solve(normal, np.einsum("kjx,kj->x", columns, residual))
    size = np.zeros(len(residual))
    for _ in range(30):
        direction = direction / max(float(np.linalg.norm(direction)), 1e-12)
        along = columns @ direction
        size = np.sum(along * residual, axis=1) / (np.sum(along**2, axis=1) + least)
        weighted = columns * size[:, None, None]
        normal = np.einsum("kjx,kjy->xy", weighted, weighted) + max(float(np.sum(size**2)), 1e-12) * least * np.eye(3)
        direction = np.linalg.solve(normal, np.einsum("kjx,kj->x", weighted, residual))
    return direction / max(float(np.linalg.norm(direction)), 1e-12), size


def contacts_in(robot: RobotModel, train: Prepared, selection: Selection) -> list[Contact]:
    """Contacts in the recordings that were fitted."""
    fit = selection.fit
    return contacts_held_out(robot, HeldOut(train, selection.library, {t: t for t in fit.terms}), fit)


def contacts_held_out(robot: RobotModel, held: HeldOut, fit: Fit) -> list[Contact]:
    """Contacts in recordings that were not fitted."""
    prepared = held.prepared
    residuals = [m.tau - x for m, x in zip(prepared.motions, held.predictions(fit), strict=True)]
    found = find_contacts(robot, prepared.names, prepared.motions, residuals, prepared.nominal, prepared.band.moving)
    dated = [held.terms[t].effect.settings for t in fit.terms if "t0" in t.effect.settings]
    whole = dict(zip(prepared.names, (m.recording for m in prepared.motions), strict=True))
    there = [(c, ("", whole[c.recording])) for c in found]
    return [c for c, names in there if not any(s.get("recording", "") in names and is_change(c, s["t0"]) for s in dated)]


def is_change(contact: Contact, t0: float) -> bool:
    """True for what the filters leave of the instant t0 at which a payload changes: a slope in the torque, a step in columns."""
    return t0 - 3.0 * SMEARED < contact.start and contact.end < t0 + 3.0 * SMEARED
