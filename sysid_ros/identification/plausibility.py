"""Does the effort of recordings follow the URDF's gravity? Finds currents in place of torques, and another robot's URDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.identification.result import Problem
from sysid_ros.identification.rows import BagRows, BoolArray
from sysid_ros.identification.tolerances import TOL
from sysid_ros.robot.effort_presets import offer
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class Agreement:
    """Torque regressed on the URDF's gravity torque, with offset, friction and inertia of the joint beside it, shape (n,) each.

    ``tau = slope g(q) + offset + Fc sign(v) + b v + J a``: the slope is 1 where effort and URDF agree, the unit's factor where
    effort is something else than N m, more with a tool that the URDF lacks.

    Attributes:
        slope: NaN where gravity changes too little to judge.
        explained: part of what offset and friction leave of the torque that all of the URDF's torque and a rotor explain, 0 to 1;
            NaN where that is next to nothing.
    """

    slope: FloatArray
    explained: FloatArray


def agreement(robot: RobotModel, bags: Sequence[BagRows], nominal: FloatArray) -> Agreement:
    """See :class:`Agreement`.

    Args:
        nominal: parameters of the URDF's links and 0 of the other effects, shape (p,).
    """
    n = robot.n
    slope, explained, size, load = (np.full(n, np.nan) for _ in range(4))
    asked = np.concatenate([bag.Y @ nominal for bag in bags])
    q, v, a, tau = (np.concatenate([getattr(bag, channel) for bag in bags]) for channel in ("q", "v", "a", "tau"))
    moving = np.concatenate([bag.moving for bag in bags])
    gravity = np.array([robot.gravity_torque(x) for x in q])
    for j in range(n):
        here = moving[:, j]
        if int(here.sum()) <= 6:  # as many unknowns
            continue
        beside = np.stack([np.ones(int(here.sum())), np.sign(v[here, j]), v[here, j], a[here, j]], axis=1)
        x, y = _without(beside, gravity[here, j]), _without(beside, tau[here, j])
        size[j] = np.std(x)
        power = float(x @ x)
        if not power > 0.0:
            continue
        slope[j] = float(x @ y) / power
        x, y = _without(beside[:, :3], asked[here, j]), _without(beside[:, :3], tau[here, j])
        load[j] = np.std(x)
        residual = _without(np.stack([x, _without(beside[:, :3], a[here, j])], axis=1), y)
        explained[j] = 1.0 - float(residual @ residual) / max(float(y @ y), 1e-300)
    judged = size >= max(TOL.judged_gravity * float(np.nanmax(size, initial=0.0)), 1e-6)
    loaded = load >= max(TOL.judged_gravity * float(np.nanmax(load, initial=0.0)), 1e-6)
    return Agreement(np.where(judged, slope, np.nan), np.where(loaded, explained, np.nan))


def check_plausible(robot: RobotModel, bags: Sequence[BagRows], nominal: FloatArray) -> list[Problem]:
    """What is doubtful about the effort beside the URDF.

    Args:
        nominal: as of :func:`agreement`.

    Raises:
        DataError: the effort can't be the torque of this URDF's robot.
    """
    found = agreement(robot, bags, nominal)
    _require_torque(robot, found)
    return _doubts(robot, found)


def _slopes(robot: RobotModel, found: Agreement) -> str:
    listed = ", ".join(f"{robot.joint_names[j]} {found.slope[j]:.2g}" for j in np.flatnonzero(np.isfinite(found.slope)))
    return f"(slope of the effort on the URDF's gravity torque, 1 expected: {listed})"


def _explained(robot: RobotModel, found: Agreement) -> tuple[float, str]:
    """Part of the torque that the URDF explains, of a usual joint, and of each in words."""
    loaded = np.isfinite(found.explained)
    listed = ", ".join(f"{robot.joint_names[j]} {100 * found.explained[j]:.0f} %" for j in np.flatnonzero(loaded))
    return float(np.median(found.explained[loaded])) if loaded.any() else 1.0, listed


def _low_and_high(found: Agreement) -> tuple[BoolArray, BoolArray]:
    """Joints whose effort is far too small for the arm's weight, and far too large, shape (n,) each."""
    return found.slope < TOL.slope_low, found.slope > TOL.slope_high


def _require_torque(robot: RobotModel, found: Agreement) -> None:
    """Check that the effort is the torque of this robot.

    Raises:
        DataError: it is not.
    """
    names, against = robot.joint_names, _slopes(robot, found)
    if flipped := [names[j] for j in np.flatnonzero(found.slope < TOL.slope_flipped)]:
        raise DataError(
            f"the effort of {', '.join(flipped)} runs against gravity {against}. Set effort_sign to -1 for these joints in "
            "--config, or give the URDF of the robot that was recorded."
        )
    follows, part = _explained(robot, found)
    if follows < TOL.follows_urdf:
        raise DataError(
            f"the effort does not follow the URDF: of what friction leaves, it explains {part}; most of it is expected. "
            "Give the URDF of the robot that was recorded, with its joints in the recording's zero and direction."
        )
    most = 0.5 * np.sum(np.isfinite(found.slope))
    low, high = _low_and_high(found)
    if np.sum(low) > most:
        scale = 1.0 / float(np.median(found.slope[low]))
        raise DataError(
            f"the effort is far smaller than the arm's weight asks for {against}. If it is a motor current (A) or a part of the "
            f"rated torque, set effort_scale in --config to N m per unit, a joint each (about {scale:.2g} by these slopes); if "
            f"gravity is already taken out of it, record the total torque.{offer(robot.joint_names)}"
        )
    if np.sum(high) > most:
        raise DataError(
            f"the effort is far larger than the arm's weight asks for {against}. Give the URDF of the robot that was recorded, "
            "or set effort_scale in --config if the effort is in another unit such as mA."
        )


def _doubts(robot: RobotModel, found: Agreement) -> list[Problem]:
    names, against = robot.joint_names, _slopes(robot, found)
    low, high = _low_and_high(found)
    problems = []
    for j in np.flatnonzero(low | high):
        much = "smaller" if found.slope[j] < 1.0 else "larger"
        text = f"The effort of {names[j]} is much {much} than its weight asks for {against}. Check effort_scale of this joint, "
        problems.append(Problem("", names[j], "effort_scale", f"{text}and whether a spring or balancer carries it."))
    follows, part = _explained(robot, found)
    if follows < TOL.follows_well:
        text = (
            f"The effort follows the URDF badly: of what friction leaves, it explains {part}; nearly all of it is expected. "
            "Is it the URDF of the robot that was recorded, with its zero and its joint order?"
        )
        problems.append(Problem("", "", "urdf_mismatch", text))
    doubtful = (found.slope > TOL.slope_suspicious) & ~high
    if np.any(doubtful):
        which = ", ".join(names[j] for j in np.flatnonzero(doubtful))
        text = (
            f"The arm weighs far more than its URDF says, seen at {which} {against}. Is it the URDF of another robot? Else a "
            "tool that the URDF lacks is identified as part of the last links."
        )
        problems.append(Problem("", "", "urdf_mismatch", text))
    return problems


def _without(beside: FloatArray, values: FloatArray) -> FloatArray:
    """What of the values the columns of ``beside`` do not explain."""
    coefficients, *_ = np.linalg.lstsq(beside, values, rcond=None)
    return np.asarray(values - beside @ coefficients)
