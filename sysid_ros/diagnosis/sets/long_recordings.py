"""Long recordings: sets of causes are searched for in the stretches that tell the most, and judged on all of the recordings.

Which stretches these are depends on the motion, not on the torque that is to be explained: of that nothing but the level of the
noise over all of the recordings is used, so that the likelihood of what is kept needs no correction (ignorable selection, Rubin
1976). Each comes from another part of the recordings: what drifts, or lasts for a while, shows in some of them. Of the stretches
of a part the one is taken that adds the most to the log-determinant of the information on what every arm has (D-optimal
design, Fedorov 1972).
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared, assemble
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.sets.two_starts import most_probable
from sysid_ros.effects import Motion
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import SLIDE, smoothed_sign
from sysid_ros.sample import FloatArray

_SEARCHED = 45.0
"""Time in which sets are searched for [s]: a search in all of a longer recording costs as many times more."""
_WORTH_IT = 2.0
"""Length of the recordings over that from which a part of them is searched first."""
_TURNS = 0.03
"""Speed at which dry friction turns, for the choice of stretches [rad/s]."""


def searched(
    robot: RobotModel, train: Prepared, progress: Callable[[str], None], not_away: Collection[tuple[str, int]] = ()
) -> Selection:
    """The most probable set of causes; the library and the rows of the selection are those of all recordings.

    Args:
        not_away: as :class:`Library` has it.
    """
    library = Library(robot, train.band, not_away=not_away)
    if not too_long(train):
        return most_probable(train, library, progress)
    part = thinned(robot, train)
    progress(f"searching {part.band.seconds:.0f} s of {train.band.seconds:.0f} s")
    first = most_probable(part, Library(robot, part.band, not_away=not_away), progress)
    progress("what was found, in all of the recordings")
    selection = first.on(train.problem, library, train.nominal)
    selection.settle()
    return selection


def too_long(train: Prepared) -> bool:
    """Whether a part of the recordings is searched first."""
    return train.band.seconds >= _WORTH_IT * _SEARCHED


def thinned(robot: RobotModel, train: Prepared) -> Prepared:
    """The stretches that tell the most, ready for a search."""
    kept = telling(train)
    cut = [(train.band.slices[s][0], train.band.slices[s][1]) for s in kept]
    motions = [_cut(train.motions[i], where) for i, where in cut]
    names = tuple(train.names[i] for i, _ in cut) if train.names else ()
    return replace(
        assemble(robot, motions, [train.nominal[i][where] for i, where in cut], train.band.silent, train.problem.gains),
        names=names,
        turns=train.turns,
    )


def telling(train: Prepared) -> list[int]:
    """Segments of the band that tell the most of what every arm has, one from each of several equal parts of the recordings."""
    each, segments = _information(train), train.band.segments
    count = max(1, round(_SEARCHED * segments / train.band.seconds))
    parts = [list(map(int, part)) for part in np.array_split(np.arange(segments), count)]
    known = np.concatenate([train.problem.prior, np.zeros(each.shape[1] - len(train.problem.prior))])
    # as much as one row tells: for what no stretch that is kept so far tells of
    total = np.diag(known + np.diagonal(each.sum(axis=0)) / len(train.problem.y) + 1e-12)
    scale = 1.0 / np.sqrt(np.diagonal(each.sum(axis=0)) + np.diag(total))
    kept: list[int] = []
    while parts:
        options = [s for part in parts for s in part]
        best = max(options, key=lambda s: float(np.linalg.slogdet((total + each[s]) * scale[:, None] * scale)[1]))
        total += each[best]
        kept.append(best)
        parts = [part for part in parts if best not in part]
    return sorted(kept)


def _information(train: Prepared) -> FloatArray:
    """Of inexact links, and of friction, rotor and offset of each joint, in each segment, shape (segments, p, p)."""
    band, problem = train.band, train.problem
    root = 1.0 / np.sqrt(band.noise_of(problem.y).along(band))
    own = band.rows([_of_a_joint(m) for m in train.motions])
    links, each = problem.nuisance.shape[2], own.shape[2]
    out = np.zeros((band.segments, links + each * band.n, links + each * band.n))
    for j in problem.active:
        at = np.r_[0:links, links + each * j : links + each * (j + 1)]
        X = np.concatenate([problem.nuisance[:, j], own[:, j]], axis=1) * root[:, j, None]
        for s in range(band.segments):
            x = X[band.segment == s]
            out[s][np.ix_(at, at)] += x.T @ x
    return out


def _of_a_joint(motion: Motion) -> FloatArray:
    """Dry and viscous friction, rotor and offset, shape (N, n, 4)."""
    unit = np.where(motion.robot.is_prismatic, SLIDE, 1.0)
    return np.stack([smoothed_sign(motion.v / unit, _TURNS), motion.v, motion.a, np.ones_like(motion.v)], axis=-1)


def _cut(motion: Motion, where: slice) -> Motion:
    """A part of a motion."""
    q, v, a, tau = motion.q[where], motion.v[where], motion.a[where], motion.tau[where]
    out = Motion(motion.robot, motion.t[where], q, v, a, tau, motion.link_torque[where], motion.drive_torque[where])
    out.temperature = None if motion.temperature is None else motion.temperature[where]
    out.clear, out.recording = motion.clear, motion.recording
    out.by_radius = None if motion.by_radius is None else motion.by_radius[where]
    return out
