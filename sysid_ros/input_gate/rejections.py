"""Why a message is not used, in words: what, the value found, what is allowed, the cure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sysid_ros.input_gate import kernel
from sysid_ros.sample import FloatArray, JointStateRecord

STUCK = "effort_stuck"
"""Reason of a message whose efforts repeat while the arm moves."""


@dataclass(frozen=True, slots=True)
class Rejection:
    """A message that is not used.

    Attributes:
        reason: one key such as ``effort_nan``, as it is counted.
        text: what, the value found, what is allowed, the cure.
    """

    reason: str
    text: str


def of_names(names: Sequence[str], joints: Sequence[str]) -> Rejection | None:
    """Whether messages with these names can be used for the robot's joints."""
    if not names:
        return Rejection("names_empty", "A message names no joint, so its values belong to none. Make the driver fill in 'name'.")
    if len(set(names)) < len(names):
        twice = ", ".join(sorted({name for name in names if names.count(name) > 1}))
        return Rejection(
            "names_duplicate", f"A message names {twice} more than once; each joint may stand there once. Correct the driver."
        )
    if missing := [joint for joint in joints if joint not in names]:
        return Rejection(
            "joints_missing",
            f"A message does not hold {', '.join(missing)}; it holds {', '.join(names)}. All joints must come in one message, "
            "or in several that are at most max_gap apart: check the names, or set joint_names to the joints that are there.",
        )
    return None


def of_length(record: JointStateRecord, count: int) -> Rejection:
    """One of the arrays is not as long as the names."""
    lengths = {"position": len(record.position), "velocity": len(record.velocity), "effort": len(record.effort)}
    for key in ("effort", "position"):
        if lengths[key] == 0:
            cure = "Switch on the hardware's effort state interface." if key == "effort" else "Make the driver publish positions."
            return Rejection(
                f"{key}_empty", f"The array '{key}' is empty; it must hold one value for each of the {count} names. {cure}"
            )
    found = ", ".join(f"{n} in '{key}'" for key, n in lengths.items())
    return Rejection("length_mismatch", f"A message has {count} names but {found}; all must be as many. Correct the driver.")


def of_stamp(t: float, last: float) -> Rejection:
    """The stamp is none, or not after the last one."""
    if t == 0.0:
        return Rejection(
            "stamp_zero",
            "The stamp is 0: the driver never fills it in. Make it do so, or set allow_unstamped to use the receive time.",
        )
    if t == last:
        return Rejection(
            "stamp_duplicate", f"The stamp {t:.6f} s came before. Check for a second publisher or a driver that repeats messages."
        )
    if 0.0 < t < last:
        return Rejection(
            "stamp_out_of_order",
            f"The stamp {t:.6f} s is before the last one, {last:.6f} s. "
            "Messages overtake each other or two publishers share the topic.",
        )
    return Rejection("stamp_invalid", f"The stamp is {t:g} s; it must be a time after 0. Correct the driver.")


def no_velocity() -> Rejection:
    """Velocities are asked for and the array is empty."""
    return Rejection(
        "velocity_empty", "The array 'velocity' is empty and velocity_source is 'message'. Set velocity_source to 'position'."
    )


def of_check(code: int, joints: Sequence[str], values: FloatArray, limits: FloatArray, seconds: float) -> Rejection:
    """What :func:`kernel.check` found.

    Args:
        code: what it returned.
        joints: the model's joint names.
        values: position, velocity, effort as received in the model's order, shape (3, n).
        limits: the table that it was given.
        seconds: since the last accepted sample.
    """
    j, joint = code // kernel.CODES, joints[code // kernel.CODES]
    q, v, effort = (float(x) for x in values[:, j])
    match code % kernel.CODES:
        case kernel.POSITION_NAN:
            return Rejection(
                "position_nan", f"The position of {joint} is NaN. The driver can't read this joint: check its hardware."
            )
        case kernel.EFFORT_NAN:
            return Rejection(
                "effort_nan",
                f"The effort of {joint} is NaN: the hardware has no effort state interface for it. Switch it on, "
                "or leave the joint out of joint_names.",
            )
        case kernel.VELOCITY_NAN:
            return Rejection(
                "velocity_nan",
                f"The velocity of {joint} is NaN and velocity_source is 'message'. Set velocity_source to 'position'.",
            )
        case kernel.POSITION_RANGE | kernel.VELOCITY_RANGE | kernel.EFFORT_RANGE:
            return _of_range(code % kernel.CODES, joint, (q, v, effort), limits[:, j])
        case kernel.POSITION_JUMP:
            return Rejection(
                "position_jump",
                f"The position of {joint} jumped to {q:g} within {seconds:.4f} s, faster than ten times its velocity limit. "
                "The values of a message are mixed up, or a second publisher shares the topic: check with ros2 topic info -v.",
            )
        case kernel.EFFORT_ZERO:
            return Rejection(
                "effort_zero",
                "The effort is exactly 0 on all joints although gravity pulls at the arm. The driver or the simulator does not "
                "measure effort: switch it on, or use a controller that does.",
            )
        case kernel.EFFORT_FROZEN:
            return Rejection(
                "effort_frozen",
                f"The effort of {joint} stays at {effort:g} while the joint moves, the other joints' do not: it is not measured, "
                "or its driver repeats an old value. Check this drive, or leave the joint out of joint_names.",
            )
        case kernel.POSITION_FROZEN:
            return Rejection(
                "position_frozen",
                f"The position of {joint} stays at {q:g} while its velocity says that it moves ({v:g}). Check its encoder and "
                "driver.",
            )
        case _:
            return Rejection(
                STUCK,
                f"The effort has not changed on any joint for {kernel.STUCK_TIME:g} s or more while the arm moves. "
                "The driver repeats an old value: check the fieldbus or the controller.",
            )


def _within(limit: float) -> str:
    return f"a finite number up to {limit:g} in size is believed, ten times what the URDF allows"


def _of_range(code: int, joint: str, values: tuple[float, float, float], limits: FloatArray) -> Rejection:
    """A value of a joint is larger than can be; ``limits``: the joint's column of the table, shape (8,)."""
    q, v, effort = values
    if code == kernel.EFFORT_RANGE:
        tau = effort * limits[kernel.SCALE]
        return Rejection(
            "effort_range",
            f"The torque of {joint} is {tau:g} (effort {effort:g}); {_within(limits[kernel.MAX_EFFORT])}. "
            "If effort is in another unit such as mA, set effort_scale; else check the effort limit in the URDF.",
        )
    what, value, limit, unit = (
        ("position", q, limits[kernel.MAX_POSITION], "")
        if code == kernel.POSITION_RANGE
        else ("velocity", v, limits[kernel.MAX_VELOCITY], "/s")
    )
    misread = "The message was misread: check the driver."
    cure = f"If it is in degrees{unit}, make the driver publish rad{unit}." if abs(value) < 1e4 else misread
    return Rejection(f"{what}_range", f"The {what} of {joint} is {value:g}; {_within(limit)}. {cure}")
