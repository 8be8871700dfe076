"""Channels of a recording that do not measure: frozen, saturated, out of range; found, named, and kept out of the fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.exceptions import DataError
from sysid_ros.identification.result import Problem
from sysid_ros.identification.rows import BoolArray
from sysid_ros.identification.tolerances import TOL
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording


@dataclass(frozen=True, slots=True)
class CheckedRecording:
    """A recording, what was found in it, and which values must not be fitted: ``spoiled``, shape (N, n)."""

    recording: Recording
    problems: tuple[Problem, ...]
    spoiled: BoolArray


def check_legs(legs: RobotModel, recording: Recording, max_gap: float) -> CheckedRecording:
    """As :func:`check_channels`, of a robot on legs: beside that, torques at the limits of its drives are not to be fitted.

    A foot that strikes the ground asks its drives for all that they have, for an instant. A drive gives no more, whatever its
    message says, and the rows of the whole robot hold the torques of all legs.

    Raises:
        DataError: as there.
    """
    checked = check_channels(legs, recording, max_gap)
    spoiled, size = checked.spoiled.copy(), np.abs(recording.tau)
    limit = np.where(np.isfinite(legs.effort_limit) & (legs.effort_limit > 0.0), legs.effort_limit, np.inf)
    limit = np.where(size.max(axis=0) > (2.0 - TOL.at_limit) * limit, np.inf, limit)  # what is exceeded limits nothing
    there = size > TOL.at_limit * limit
    if not there.any():
        return checked
    spoiled |= there
    names = ", ".join(name for name, at in zip(legs.joint_names, np.any(there, axis=0).tolist(), strict=True) if at)
    text = (
        f"The effort of {names} is at the URDF's limit in {100.0 * float(np.mean(there.any(axis=1))):.2g} % of the messages: "
        "what a drive gives there is not what it says. These rows are not used; walk more softly, or slower."
    )
    return CheckedRecording(recording, (*checked.problems, Problem(recording.name, "", "saturated_effort", text)), spoiled)


def check_channels(robot: RobotModel, recording: Recording, max_gap: float) -> CheckedRecording:
    """Look at every channel by itself.

    Raises:
        DataError: the effort of a joint is one constant for most of the time that the joint moves, or no time passes.
    """
    if not recording.period:
        raise DataError(f"{recording.name}: it holds {len(recording.t)} samples and no time passes. Record at least 10 s.")
    spoiled: BoolArray = np.zeros(recording.tau.shape, dtype=np.bool_)
    problems = _gaps(recording, max_gap)
    for j, joint in enumerate(robot.joint_names):
        problems += _saturated(recording, j, joint, spoiled)
        problems += _frozen_effort(recording, j, joint, spoiled)
        problems += _frozen_position(recording, j, joint, spoiled)
        problems += _outside(robot, recording, j, joint)
    return CheckedRecording(recording, tuple(problems), spoiled)


def frozen_messages(robot: RobotModel, recording: Recording) -> tuple[BoolArray, tuple[str, ...]]:
    """Messages in which an effort or a position of a joint stays what it was while the joint moves, shape (N,), and what stands
    in words. An effort that its drive limits is none of these.

    Raises:
        DataError: as :func:`check_channels`.
    """
    limited: BoolArray = np.zeros(recording.tau.shape, dtype=np.bool_)
    found = list[Problem]()
    if not recording.period:
        return np.any(limited, axis=1), ()
    for j, joint in enumerate(robot.joint_names):
        _saturated(recording, j, joint, limited)
    frozen = limited.copy()
    for j, joint in enumerate(robot.joint_names):
        found += _frozen_effort(recording, j, joint, frozen, "These messages are not used")
        found += _frozen_position(recording, j, joint, frozen, "These messages are not used")
    return np.any(frozen & ~limited, axis=1), tuple(problem.text for problem in found)


def _gaps(recording: Recording, max_gap: float) -> list[Problem]:
    steps = np.diff(recording.t)
    back, gaps = int(np.sum(steps <= 0.0)), steps[steps > max_gap]
    out = []
    if len(gaps):
        text = f"{len(gaps)} gaps longer than {max_gap:g} s, {gaps.sum():.1f} s in all, the longest {gaps.max():.1f} s. "
        out.append(
            Problem(recording.name, "", "gaps", f"{text}Nothing is fitted across them; record without loss if they matter.")
        )
    if back:
        text = f"The stamps run back {back} times; each part is used by itself."
        out.append(Problem(recording.name, "", "time_runs_back", text))
    return out


def _runs(values: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First index and length of every run of equal values, shape (r,) each."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1])
    return starts, np.diff(np.concatenate([starts, [len(values)]]))


def _frozen_effort(recording: Recording, j: int, joint: str, spoiled: BoolArray, rows: str = "") -> list[Problem]:
    """The effort repeats while the joint moves; ``rows``: what becomes of these, in words."""
    period, tau, q = recording.period, recording.tau[:, j], recording.q[:, j]
    starts, lengths = _runs(tau)
    usual = float(np.median(np.repeat(lengths, lengths))) if len(lengths) > 4 else 1.0
    frozen = np.flatnonzero((lengths * period >= TOL.frozen) & (lengths >= TOL.frozen_runs * min(usual, TOL.frozen / period)))
    total, moving, longest = 0, _moving_samples(q, recording.t), (0, 0)
    for r in frozen:
        where = slice(int(starts[r]), int(starts[r] + lengths[r]))
        if np.ptp(q[where]) <= TOL.moved or spoiled[where, j].all():
            continue
        spoiled[where, j] = True
        total += int(lengths[r])
        longest = max(longest, (int(lengths[r]), int(starts[r])))
    if not total:
        return []
    value, since = tau[longest[1]], recording.t[longest[1]] - recording.t[0]
    if total > TOL.nothing_measured * moving:
        raise DataError(
            f"{recording.name}: the effort of {joint} is constant ({value:g}) for {100 * min(total / moving, 1.0):.0f} % of the "
            "time that the joint moves; it measures nothing. Switch on the effort of this joint in its driver and record again, "
            "or leave the joint out of joint_names (--config)."
        )
    text = (
        f"The effort of {joint} stays at {value:g} while the joint moves, {total * period:.1f} s in all, "
        f"{longest[0] * period:.1f} s from {since:.1f} s on. {rows or f'These rows of {joint} are not used'}; check its driver."
    )
    return [Problem(recording.name, joint, "frozen_effort", text)]


def _moving_samples(q: FloatArray, t: FloatArray) -> int:
    """Samples in seconds in which the joint moves."""
    second = np.floor(t - t[0]).astype(int)
    ends = np.flatnonzero(np.diff(second)) + 1
    parts = np.split(q, ends)
    return max(sum(len(p) for p in parts if np.ptp(p) > TOL.moved), 1)


def _frozen_position(
    recording: Recording, j: int, joint: str, spoiled: BoolArray, rows: str = "These rows are not used on any joint"
) -> list[Problem]:
    """The position repeats while the message's velocity says that the joint moves; ``rows``: what becomes of these, in words."""
    if recording.v is None:
        return []
    v, q, period = recording.v[:, j], recording.q[:, j], recording.period
    starts, lengths = _runs(q)
    total, since = 0, 0.0
    moves = TOL.moved / TOL.frozen_position
    for r in np.flatnonzero(lengths * period >= TOL.frozen_position):
        where = slice(int(starts[r]), int(starts[r] + lengths[r]))
        if float(np.median(np.abs(v[where]))) > moves:
            since = since if total else float(recording.t[where.start] - recording.t[0])
            spoiled[where] = True
            total += int(lengths[r])
    if not total:
        return []
    text = (
        f"The position of {joint} does not change for {total * period:.1f} s, first at {since:.1f} s, while its velocity says "
        f"that it moves. {rows}; check its encoder."
    )
    return [Problem(recording.name, joint, "frozen_position", text)]


def _saturated(recording: Recording, j: int, joint: str, spoiled: BoolArray) -> list[Problem]:
    """The largest or least effort repeats far longer than other values do, and more than once or for long."""
    tau, period = recording.tau[:, j], recording.period
    starts, lengths = _runs(tau)
    ordinary = float(np.percentile(lengths, 99)) if len(lengths) > 20 else 1.0
    found, bound, times = 0, 0.0, 0
    for extreme in (float(tau.max()), float(tau.min())):
        at = np.flatnonzero(
            (tau[starts] == extreme) & (lengths >= TOL.saturated_runs * max(1.0, ordinary)) & (lengths * period >= TOL.saturated)
        )
        if not len(at) or extreme == 0.0 or (len(at) < 2 and lengths[at].sum() * period < 2.0 * TOL.saturated):
            continue
        if np.ptp(recording.q[:, j]) <= TOL.moved or np.ptp(tau) == 0.0:
            continue
        for r in at:
            spoiled[int(starts[r]) : int(starts[r] + lengths[r]), j] = True
        found, bound, times = found + int(lengths[at].sum()), extreme, times + len(at)
    if not found:
        return []
    text = (
        f"The effort of {joint} stops at {abs(bound):g} {times} times, {found * period:.2f} s in all: it is saturated. These "
        f"rows of {joint} are not used; record a slower motion, or raise the limit of the measurement."
    )
    return [Problem(recording.name, joint, "saturated_effort", text)]


def _outside(robot: RobotModel, recording: Recording, j: int, joint: str) -> list[Problem]:
    q, low, high = recording.q[:, j], float(robot.position_lower[j]), float(robot.position_upper[j])
    part = float(np.mean((q < low - TOL.outside) | (q > high + TOL.outside)))
    if part < TOL.outside_time:
        return []
    text = (
        f"The position of {joint} goes from {q.min():.3g} to {q.max():.3g}; the URDF allows {low:.3g} to {high:.3g}. Is it the "
        "URDF of this robot, with this zero?"
    )
    return [Problem(recording.name, joint, "position_outside", text)]
