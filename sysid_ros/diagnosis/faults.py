"""Input faults: recordings that can't answer the question, found before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.recording import Recording
from sysid_ros.robot_model import RobotModel

_SHORTEST = 4.0
_STILL = 0.01
_FROZEN_MOVES = 0.05
_DEGREES = 7.0


def refusal_of(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    """Why the recordings can't be judged, with the cure; None where they can."""
    for check in (_too_short, _not_numbers, _at_rest, _degrees, _frozen):
        if reason := check(robot, recordings):
            return reason
    return None


def _too_short(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    seconds = sum(r.seconds for r in recordings)
    if seconds < _SHORTEST or all(len(r.t) < 100 for r in recordings):
        return (
            f"The recordings last {seconds:.1f} s; at least {_SHORTEST:g} s of motion are needed to tell one cause from another. "
            "Record 15 to 30 s in which every joint moves."
        )
    return None


def _not_numbers(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    for r in recordings:
        bad = [name for j, name in enumerate(robot.joint_names) if not np.isfinite(r.tau[:, j]).any()]
        if bad:
            return f"{r.name}: no effort of {', '.join(bad)} is a number. Record a robot whose driver publishes effort."
    return None


def _at_rest(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    span = np.max([np.ptp(r.q, axis=0) for r in recordings], axis=0)
    if np.all(span < _STILL):
        return (
            f"The robot is at rest: no joint moves by more than {span.max():.2g} rad. Friction and inertia do not show at rest; "
            "record a motion of all joints."
        )
    return None


def _degrees(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    turning = ~robot.is_prismatic & ~robot.is_continuous
    most = np.max([np.abs(r.q).max(axis=0) for r in recordings], axis=0)
    limit = np.maximum(np.abs(robot.position_lower), np.abs(robot.position_upper))
    beyond = turning & (most > 3.0 * np.where(np.isfinite(limit), limit, _DEGREES)) & (most > _DEGREES)
    if beyond.sum() >= max(1, turning.sum() // 2):
        worst = int(np.argmax(np.where(beyond, most, 0.0)))
        return (
            f"Positions look like degrees: {robot.joint_names[worst]} reaches {most[worst]:.3g}, its limit is "
            f"{limit[worst]:.3g} rad. Publish radians, or convert the bag."
        )
    return None


def _frozen(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    for r in recordings:
        moving = np.ptp(r.q, axis=0) > _FROZEN_MOVES
        for j, name in enumerate(robot.joint_names):
            values = r.tau[:, j]
            same = np.mean(np.diff(values) == 0.0) if len(values) > 1 else 1.0
            if moving[j] and (np.ptp(values) == 0.0 or same > 0.98):
                return (
                    f"{r.name}: the effort of {name} stays at {values[-1]:.4g} while the joint moves; the channel is frozen "
                    "or not measured. Correct the driver, or leave the joint out (joint_names)."
                )
    return None
