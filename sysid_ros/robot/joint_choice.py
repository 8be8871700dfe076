"""Which joints of the URDF the joint states are about, where nobody has said so, and where their names are others."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot.flange import gripper_joints
from sysid_ros.robot.urdf import read_urdf
from sysid_ros.sample import JointStateRecord

_FEWEST = 3
_AS_OFTEN = 0.1
"""Joints that come by themselves are the arm's too from so many messages, and this part of the most frequent kind's, on."""


@dataclass(slots=True)
class Kind:
    """Messages that name the same joints: how many came, whether they hold efforts, and of which joints any but 0 and NaN."""

    count: int = 0
    has_effort: bool = False
    measured: set[str] = field(default_factory=set)

    def add(self, record: JointStateRecord) -> None:
        """Count one."""
        self.count += 1
        self.has_effort |= len(record.effort) > 0
        effort = np.asarray(record.effort, dtype=float)
        measured = (effort != 0.0) & ~np.isnan(effort)  # 0 or NaN all the time is what a driver says of what it does not measure
        self.measured.update(name for name, one in zip(record.names, measured.tolist(), strict=False) if one)


def kinds_of(records: Collection[JointStateRecord]) -> dict[tuple[str, ...], Kind]:
    """The kinds of messages among some, in the order in which they came up."""
    kinds: dict[tuple[str, ...], Kind] = {}
    for record in records:
        kinds.setdefault(record.names, Kind()).add(record)
    return kinds


def choose(movable: Sequence[str], grips: Collection[str], kinds: Mapping[tuple[str, ...], Kind]) -> tuple[str, ...]:
    """The joints that the messages with the most of them name, those with efforts first, and what other publishers add with
    efforts; joints of a gripper only where they come with the others and their effort is measured. In the order of ``movable``.

    Args:
        movable: joints of the URDF. grips: those of a gripper.
    """
    held = {names: [name for name in movable if name in names] for names in kinds}
    best = max(kinds, key=lambda names: (kinds[names].has_effort and bool(held[names]), len(held[names])), default=())
    chosen = set(held.get(best, ()))
    silent = chosen.intersection(grips) - kinds[best].measured if best in kinds else set()
    chosen = chosen - silent or chosen
    enough = max(_FEWEST, _AS_OFTEN * max((kind.count for kind in kinds.values()), default=0))
    for names, kind in kinds.items():
        if kind.has_effort and kind.count >= enough and chosen:
            chosen.update(name for name in held[names] if name not in grips)
    return tuple(name for name in movable if name in chosen)


def renamed(urdf: str, joint_names: Sequence[str], message_names: Collection[str]) -> dict[str, str]:
    """The URDF's name of each of ``joint_names`` where these are the messages' own; empty where they are the URDF's.

    Joints that the URDF calls otherwise are its joints in its order, with or without those of a gripper.

    Raises:
        RobotModelError: they are neither.
    """
    types, mimic, _ = read_urdf(urdf)
    strange = [name for name in joint_names if name not in types]
    missing = [name for name in joint_names if name not in message_names]
    if not strange and not missing:
        return {}
    movable = [name for name in types if name not in mimic]
    arm = [name for name in movable if name not in gripper_joints(urdf)]
    if not missing:
        for own in (arm, movable):
            if len(own) == len(joint_names):
                return dict(zip(joint_names, own, strict=True))
    there, lacking, source = (message_names, missing, "messages") if missing else (movable, strange, "URDF")
    nearest = {name: difflib.get_close_matches(name, there, 1, 0.5) for name in lacking}
    close = ", ".join(f"{found[0]} for {name}" for name, found in nearest.items() if found)
    raise RobotModelError(
        f"joint_names (--joint-names) has {', '.join(lacking)}, which the {source} lack"
        f"{'s' if source == 'URDF' else ''}. The messages name {', '.join(message_names)}; the URDF has "
        f"{', '.join(movable)}.{f' The nearest: {close}.' if close else ''} Give joints of the messages: those that the URDF "
        f"names, or {len(arm)} others for {', '.join(arm)}, in this order."
    )


class JointChoice:
    """Picks the joints from the first messages: see :func:`choose`.

    A message with all movable joints and their efforts decides at once. Else it waits, because a gripper's messages may come
    before the arm's on the same topic, and an arm's joints may come from several publishers.

    Args:
        movable: movable joints of the URDF. grips: those of a gripper.
        patience: time from the first message to the decision [s].

    Attributes:
        text: what it waits for.
    """

    def __init__(self, movable: Sequence[str], grips: Collection[str] = (), patience: float = 0.5) -> None:
        self._movable, self._grips = tuple(movable), frozenset(grips)
        self._patience = patience
        self._first: float | None = None
        self._kinds: dict[tuple[str, ...], Kind] = {}
        self.text = f"Waiting for messages that name joints of the URDF: {', '.join(self._movable)}."

    def offer(self, record: JointStateRecord) -> tuple[str, ...] | None:
        """The joints, in the URDF's order, or None while it is not decided."""
        named = set(record.names)
        if named.intersection(self._movable):
            self._kinds.setdefault(tuple(record.names), Kind()).add(record)
        if self._first is None or record.receive_time < self._first:
            self._first = record.receive_time
        if not self._kinds:
            self.text = (
                f"The messages name {', '.join(record.names) or 'no joint'}; the URDF's movable joints are "
                f"{', '.join(self._movable)}. Check that the URDF is this robot's, and the topic."
            )
            return None
        complete = len(record.effort) > 0 and named.issuperset(self._movable)
        if complete or record.receive_time - self._first >= self._patience:
            return choose(self._movable, self._grips, self._kinds)
        return None
