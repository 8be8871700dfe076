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
from scipy import linalg, ndimage

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
_BETTER = 1e-3
_TURNS = 0.1
"""Time before and after a joint stands in which it is not looked at [s]."""
SMEARED = 0.15
"""Time over which the filters spread a step [s]."""
_INDEPENDENT = 2.0 * CUTOFF
"""Independent values of the residual of one joint in a second: two a hertz of the band that it is judged in."""
_MOST = 0.3
"""Part of the time: more is no event."""
_STRONG = 1000.0
"""Size of a force before any data [N]: more breaks the arm. Where a posture shows nothing of a direction there is none in it."""


@dataclass(frozen=True, eq=False)
class Contact:
    """A force that acted for a while.

    Attributes:
        recording: its name. start, end: since the first stamp [s]. frame: link that is pushed.
        force: its mean on the robot, in the world, over the time in which it has more than half of its peak, shape (3,) [N].
        std: of it, shape (3,): of its direction, and of its size how much that varies over this time. peak: of its size [N].
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

    def overlaps(self, other: Contact) -> bool:
        """True where both acted at the same time."""
        return self.recording == other.recording and self.start <= other.end and other.start <= self.end

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
    explained, best = -np.inf, ""
    for frame in robot.body_names[_JOINTS - 1 : robot.n]:
        each = _of_force(robot, frame, motion.q[window], scale, residual)
        along = _one_direction(each, residual)
        part = 1.0 - float(np.sum((residual - each @ along[0] * along[1][:, None]) ** 2) / np.sum(power))
        # where two links share an origin the nearer one is named
        if part > explained + _BETTER:
            explained, best, columns, (direction, size) = part, frame, each, along
    left = _left_by_force(columns, residual)
    removed = float(np.sum(power - left))
    if removed < _EXPLAINED * power.sum():
        return None
    one_joint = _left_by_one_joint(motion.sensitivity[2][window] / scale[:, None], residual)
    if _likelihood(left, residual) < max(_likelihood(x, residual) for x in one_joint):
        return None
    direction, size = (direction, size) if size.sum() >= 0.0 else (-direction, -size)
    strong = size[size > 0.5 * size.max()]
    force = direction * float(np.mean(strong))
    std = np.sqrt(
        np.diag(_spread(columns, residual, direction, size, motion.period)) * np.mean(strong) ** 2 + direction**2 * np.var(strong)
    )
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


def _left_by_force(columns: FloatArray, residual: FloatArray) -> FloatArray:
    """Squared residual of each joint that the force leaves which all other joints tell, shape (n,).

    Args:
        columns: A, shape (k, n, 3). residual: shape (k, n), zero where not judged.
    """
    out = np.sum(residual**2, axis=0)
    for j in np.flatnonzero(np.any(columns, axis=(0, 2))):
        others = np.delete(np.arange(columns.shape[1]), j)
        direction, size = _one_direction(columns[:, others], residual[:, others])
        out[j] = np.sum((residual[:, j] - columns[:, j] @ direction * size) ** 2)
    return np.asarray(out)


def _left_by_one_joint(columns: FloatArray, residual: FloatArray) -> FloatArray:
    """Squared residual of each joint where the acceleration of one link against its motor (an elastic joint, or one with play) is
    what all other joints tell, shape (n, n): of each elastic joint a row.

    Args:
        columns: mass matrix with its rows over the scales, shape (k, n, n). residual: shape (k, n), zero where not judged.
    """
    columns = np.where((residual == 0.0)[:, :, None], 0.0, columns)
    along, power = columns * residual[:, :, None], columns**2
    # what all joints tell, without what the one that is predicted tells itself
    amplitude = (along.sum(axis=1, keepdims=True) - along) / np.maximum(power.sum(axis=1, keepdims=True) - power, 1e-12)
    return np.asarray(np.sum((residual[:, :, None] - columns * amplitude) ** 2, axis=0).T)


def _likelihood(left: FloatArray, residual: FloatArray) -> float:
    """Logarithm, an instant, of the likelihood of joints that are predicted from all others with what is left of each, shape
    (n,), in units of their usual residual, over that of no prediction."""
    usual = float(len(residual))
    return -0.5 * float(np.sum(np.log((left + usual) / (np.sum(residual**2, axis=0) + usual))))


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


def _spread(columns: FloatArray, residual: FloatArray, direction: FloatArray, size: FloatArray, period: float) -> FloatArray:
    """Covariance of the direction, shape (3, 3), with any amplitude at each instant.

    Args:
        columns, residual: as for :func:`_one_direction`. direction, size: what it returns. period: of the instants [s].
    """
    along, least = columns @ direction, 1.0 / _STRONG**2
    # what the amplitude of an instant takes up tells nothing of the direction
    known = np.einsum("kjx,kj->kx", columns, along) / np.sqrt(np.sum(along**2, axis=1, keepdims=True) + least)
    of_instants = np.einsum("kjx,kjy->kxy", columns, columns) - known[:, :, None] * known[:, None, :]
    information = np.einsum("k,kxy->xy", size**2, of_instants) + np.sum(size**2) * least * np.eye(3)
    across = linalg.null_space(direction[None])
    rows = np.count_nonzero(residual)
    independent = max(3.0, _INDEPENDENT * rows * period)
    variance = float(np.sum((residual - along * size[:, None]) ** 2)) / independent
    inside = np.linalg.inv(across.T @ information @ across)
    return np.asarray(across @ inside @ across.T * max(variance, rows / independent))


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
