"""What the live node says where the torques of an arm show that its model, or what efforts are, is another."""

from __future__ import annotations

from sysid_ros.online.model_check import IDENTIFY
from sysid_ros.sample import FloatArray

_ONLY = 0.5
"""Efforts that show less of what the arm takes are compensated or in another unit; else each joint has its own factor."""
_SAME = 0.1
"""Factors of the joints that differ by less are one."""


def further_off(links: float, gains: float, times: float) -> str:
    """What is wrong, and by how much. Args: links, gains, times: as of :class:`.ModelEvidence`."""
    what = "the efforts' gains are" if gains > links else "what the links weigh and where is"
    return f"The torques show that {what} wrong by some {times:.0f} times as much as is usual."


def not_shown(factors: FloatArray, share: tuple[float, float]) -> str:
    """Why efforts are not what they are said to be.

    Args:
        factors: of each joint's effort beside the torque, shape (n,). share: of what the arm takes that shows, and its standard
            deviation.
    """
    part, std = share
    shown, least = f"{100.0 * max(part, 0.0):.0f} % (std {100.0 * std:.0f})", float(factors.min())
    if part < _ONLY and least > -_ONLY:
        return (
            f"The efforts show only {shown} of the torque that the arm itself takes: are they compensated for gravity by the "
            "driver (effort_type), or in another unit (effort_scale)? The payload can't be trusted."
        )
    if float(factors.max()) - least < _SAME:
        return (
            f"The efforts show {shown} of the torque that the arm itself takes: are they in another unit (effort_scale), or "
            f"is the model heavier or lighter than the arm? The payload can't be trusted. {IDENTIFY}"
        )
    listed = ", ".join(f"{x:.2f}" for x in factors)
    return (
        f"The efforts are the torques that the arm itself takes by another factor on each joint, about {listed} in their "
        "order: are they currents (effort_scale; below zero: the sign), compensated for gravity (effort_type), or is the "
        f"model another arm's, or the arm on a wall or a ceiling (gravity)? The payload can't be trusted. {IDENTIFY}"
    )
