"""Where an arm ends and its gripper begins: joints of a gripper, and the flange that a payload is expressed in."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from typing import Any

_WORDS = re.compile(r"finger|thumb|gripper|jaw|knuckle|claw|robotiq|hand_(index|middle|ring|pinky|little)", re.IGNORECASE)
"""What joints of grippers, or the links that they move, are called."""
_TRAVEL = 0.15
"""Slides that come in pairs and travel no further belong to a parallel gripper [m]."""
_FLANGES = (re.compile(r"(^|[^a-z0-9])tool0$", re.IGNORECASE), re.compile(r"(^|[^a-z0-9])flange$", re.IGNORECASE))
"""Names of the frame that tools are mounted in, as ROS-Industrial has them, the better first."""


class _Tree:
    """A URDF's joints: ``children`` by the link that they hang on, ``movable`` in its order; ``massive``: links with a mass."""

    def __init__(self, urdf: str) -> None:
        root = ElementTree.fromstring(urdf)
        self.children: dict[str, list[ElementTree.Element]] = {}
        for joint in root.findall("joint"):
            self.children.setdefault(_link(joint, "parent"), []).append(joint)
        self.massive = {str(link.get("name")) for link in root.findall("link") if _mass(link) > 0.0}
        self.movable = [j for j in root.findall("joint") if j.get("type") in ("revolute", "continuous", "prismatic")]

    def movable_below(self, link: str) -> Iterator[ElementTree.Element]:
        """Movable joints that a link carries, by fixed joints and others, however far."""
        ahead, seen = [link], {link}  # links that go in a circle are somebody else's to refuse
        while ahead:
            for joint in self.children.get(ahead.pop(), []):
                if joint in self.movable:
                    yield joint
                if (child := _link(joint, "child")) not in seen:
                    seen.add(child)
                    ahead.append(child)


def gripper_joints(urdf: str) -> frozenset[str]:
    """Movable joints that open and close a gripper: those that are called so, and short slides that come in pairs, where
    nothing but such joints hangs on them. None where all are: then the gripper is the robot."""
    tree = _Tree(urdf)
    pairs: dict[str, int] = {}
    for joint in filter(_short_slide, tree.movable):
        pairs[_link(joint, "parent")] = pairs.get(_link(joint, "parent"), 0) + 1
    alike = {
        str(joint.get("name"))
        for joint in tree.movable
        if _WORDS.search(f"{joint.get('name')} {_link(joint, 'child')}")
        or (_short_slide(joint) and pairs[_link(joint, "parent")] > 1)
    }
    found = frozenset(
        str(joint.get("name"))
        for joint in tree.movable
        if joint.get("name") in alike and all(j.get("name") in alike for j in tree.movable_below(_link(joint, "child")))
    )
    return found if len(found) < len(tree.movable) else frozenset()


def last_joint(model: Any, urdf: str) -> int:
    """Index in pinocchio's model of the last joint of the arm, not of its gripper; of several arms the last that all share, the
    last of them where they share none."""
    grips = gripper_joints(urdf)
    joints = range(1, model.njoints)
    arm = [j for j in joints if model.names[j] not in grips] or list(joints)
    ends = [j for j in arm if not any(k in arm for k in model.children[j])]
    chains = [list(model.supports[j]) for j in ends]
    shared = [j for j in chains[0] if all(j in chain for chain in chains)]
    return shared[-1] if shared and shared[-1] > 0 else ends[-1]


def flange_of(urdf: str, link: str) -> str:
    """The frame that tools are mounted in, of an arm whose last joint moves ``link``.

    It is the link fixed to that one which is called tool0 or flange; else the only link fixed to it, where that has no mass
    (panda_link8); else ``link`` itself.
    """
    tree = _Tree(urdf)
    fixed: list[str] = [link]
    for name in fixed:  # it grows
        fixed += [_link(j, "child") for j in tree.children.get(name, []) if j.get("type") == "fixed"]
    for pattern in _FLANGES:
        if named := [name for name in fixed[1:] if pattern.search(name)]:
            return named[0]
    direct = tree.children.get(link, [])
    only = _link(direct[0], "child") if len(direct) == 1 and direct[0].get("type") == "fixed" else link
    return link if only in tree.massive else only


def _link(joint: ElementTree.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else str(element.get("link"))


def _mass(link: ElementTree.Element) -> float:
    return _number(link.find("inertial/mass"), "value")


def _short_slide(joint: ElementTree.Element) -> bool:
    limit = joint.find("limit")
    if joint.get("type") != "prismatic" or limit is None:
        return False
    return _number(limit, "upper") - _number(limit, "lower") <= _TRAVEL


def _number(element: ElementTree.Element | None, name: str) -> float:
    """An attribute; 0 where it is missing or no number, which others tell of."""
    try:
        return 0.0 if element is None else float(element.get(name, 0.0))
    except ValueError:
        return 0.0
