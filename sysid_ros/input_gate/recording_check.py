"""Recordings that can't answer any question about their robot: found before anything is fitted, with the cure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.input_gate.effort_channels import frozen_efforts, same_efforts, wrapping_counts
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.conditioning import SHORTEST, longest_stretch
from sysid_ros.signals.recording import Recording

_SHORTEST = 2.0 * SHORTEST + 0.2
"""Of all recordings together: a stretch to fit and one to judge on [s]."""
_LONGEST_STEP = 0.05
"""Between messages [s]: torques are compared below 8 Hz, half of 16 messages a second and some for the filter's flank."""
_STILL = 0.01
_FROZEN_MOVES = 0.05
_DEGREES = 7.0
_ALIKE = 3
"""Fewest links of one mass that are no accident; two wrists of one arm often are alike."""


def refusal_of(robot: RobotModel, recordings: Sequence[Recording], validation: Sequence[Recording] = ()) -> str | None:
    """Why the recordings can't be judged, with the cure; None where they can."""
    first, then = (
        (_no_effort, wrapping_counts),
        (_too_slow, broken, _at_rest, _frozen_position, _degrees, _frozen, frozen_efforts),
    )
    for check in (*first, _too_short, _no_mass, *then):
        if reason := check(robot, recordings):
            return reason
    for check in (*first, *then):
        if validation and (reason := check(robot, validation)):
            return f"The recordings to judge on (--validate): {reason}"
    return same_efforts(robot, [*recordings, *validation])


def _too_short(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    seconds = sum(r.seconds for r in recordings)
    if seconds < _SHORTEST or all(len(r.t) < 100 for r in recordings):
        return (
            f"The recordings last {seconds:.1f} s; at least {_SHORTEST:g} s of motion are needed to tell one cause from another. "
            "Record 15 to 30 s in which every joint moves."
        )
    return None


def _too_slow(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    for r in recordings:
        if r.period > _LONGEST_STEP:
            return (
                f"{r.name}: its messages are {r.period:.3g} s apart; {_LONGEST_STEP:g} s is the most. Record at 100 Hz or more."
            )
    return None


def broken(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    """Why none of the recordings can be filtered."""
    longest = max((longest_stretch(r) for r in recordings), default=0.0)
    if longest < SHORTEST:
        return (
            f"The longest stretch without a gap lasts {longest:.1f} s; {SHORTEST:g} s are the least that can be filtered. Record "
            "longer motions, and see to it that no messages are lost."
        )
    return None


def _no_mass(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    if np.any(robot.pi):
        return None
    return (
        f"No link of the URDF '{robot.name}' that moves has a mass, so that there is no model to judge. Give a URDF with "
        "<inertial>, or find the masses first: sysid identify --urdf-out."
    )


def only_places(robot: RobotModel) -> tuple[str, ...]:
    """What is to be said of a URDF whose links all weigh the same, but for one at most: no robot is built so."""
    masses, counts = np.unique(np.round(robot.pi[::10], 9), return_counts=True)
    alike = int(counts.max())
    if alike < max(_ALIKE, robot.n - 1) or not masses[np.argmax(counts)] > 0.0:
        return ()
    return (
        f"{alike} of {robot.n} links of the URDF '{robot.name}' weigh {masses[np.argmax(counts)]:g} kg each: such inertials only "
        "hold a place. What is told of links, and of a body that the robot carries, is told against them. Give the URDF with the "
        "robot's own inertials, or identify them with nothing carried ('sysid identify') and give --model.",
    )


def _no_effort(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    for r in recordings:
        bad = [name for j, name in enumerate(robot.joint_names) if not np.isfinite(r.tau[:, j]).any()]
        if len(bad) == robot.n:
            return (
                f"{r.name} holds no effort of any joint. Switch on the effort state interface of the robot's hardware and record "
                "again: without torques there is nothing to judge."
            )
        if bad:
            return (
                f"{r.name} holds no effort of {', '.join(bad)}. Switch on the effort of these joints in the driver and record "
                "again, or leave them out (joint_names)."
            )
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


def _frozen_position(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    for r in recordings:
        if r.v is None or len(r.t) < 2:
            continue
        way = np.sum(np.abs(r.v[:-1]) * np.maximum(np.diff(r.t), 0.0)[:, None], axis=0)
        frozen = (np.ptp(r.q, axis=0) == 0.0) & (way > _FROZEN_MOVES) & (np.ptp(r.v, axis=0) > 0.0)
        if frozen.any():
            j = int(np.argmax(frozen))
            return (
                f"{r.name}: the position of {robot.joint_names[j]} stays at {r.q[0, j]:.4g} while its velocity is not zero; "
                "the channel is frozen. Check the encoder and the driver, or leave the joint out (joint_names)."
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
                    f"{r.name}: the effort of {name} stays at {values[-1]:.4g} while the joint moves; the channel is "
                    "frozen, not measured, or in steps larger than the torque. Correct the driver, or leave the joint out "
                    "(joint_names)."
                )
    return None
