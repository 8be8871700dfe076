"""What is wrong in a URDF, told with the element that it stands in."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter

from sysid_ros.exceptions import RobotModelError

_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_LIMITED = ("revolute", "prismatic")
_TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_VECTORS = (("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz"))
_LIMITS = ("lower", "upper", "effort", "velocity")
_DYNAMICS = ("damping", "friction", "armature")


def check_urdf(root: ElementTree.Element) -> None:
    """Check names, the tree, and that all that should be numbers are.

    Raises:
        RobotModelError: naming the first that is wrong.
    """
    if not root.get("name"):
        raise RobotModelError('the URDF gives the robot no name. Give it one: <robot name="arm">.')
    links, joints = root.findall("link"), root.findall("joint")
    for kind, elements in (("link", links), ("joint", joints)):
        names = [element.get("name") for element in elements]
        if not all(names):
            raise RobotModelError(f"the URDF has a <{kind}> without a name. Give it one.")
        if twice := next((name for name, count in Counter(names).items() if count > 1), None):
            raise RobotModelError(f"the URDF has two {kind}s of the name '{twice}'; each must have its own.")
    for joint in joints:
        _check_joint(joint)
    for link in links:
        if (inertial := link.find("inertial")) is not None:
            _check_inertial(inertial, f"link '{link.get('name')}'")
    _check_tree([str(link.get("name")) for link in links], joints)


def _check_joint(joint: ElementTree.Element) -> None:
    where, kind = f"joint '{joint.get('name')}'", joint.get("type")
    if kind not in _TYPES:
        raise RobotModelError(f"{where} of the URDF has the type {kind!r}; it must be one of {', '.join(_TYPES)}.")
    for tag, key in _VECTORS:
        element = joint.find(tag)
        if element is None or (text := element.get(key)) is None:
            continue
        vector = [_number(x) for x in text.split()]
        if len(vector) != 3 or not all(map(math.isfinite, vector)):
            raise RobotModelError(f"{where} of the URDF: {key} of <{tag}> is '{text}'; it must be three numbers.")
        if tag == "axis" and kind != "fixed" and not any(vector):
            raise RobotModelError(f"{where} of the URDF: its axis is '{text}', which is no direction. Give it a length.")
    limit, dynamics = joint.find("limit"), joint.find("dynamics")
    if limit is None and kind in _LIMITED:
        raise RobotModelError(f"{where} of the URDF is {kind} and has no <limit lower= upper= effort= velocity=>. Give it one.")
    for element, keys in ((limit, _LIMITS), (dynamics, _DYNAMICS)):
        if element is None:
            continue
        for key in keys:
            if (text := element.get(key)) is not None and math.isnan(_number(text)):
                raise RobotModelError(f"{where} of the URDF: {key} of <{element.tag}> is '{text}'; it must be a number.")


def _check_inertial(inertial: ElementTree.Element, where: str) -> None:
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    text = None if mass is None else mass.get("value")
    if text is None:
        raise RobotModelError(f"{where} of the URDF has an <inertial> without <mass value=>. Give its mass in kg.")
    if not 0.0 <= _number(text) < math.inf:
        raise RobotModelError(f"{where} of the URDF has the mass '{text}'; it must be a number of 0 kg or more.")
    if inertia is None:
        raise RobotModelError(f"{where} of the URDF has an <inertial> without <inertia>. Give {', '.join(_TENSOR)} in kg m^2.")
    for key in _TENSOR:
        if not math.isfinite(_number(inertia.get(key, ""))):
            raise RobotModelError(f"{where} of the URDF: {key} of <inertia> is '{inertia.get(key, '')}'; it must be a number.")
    origin = inertial.find("origin")
    for key in ("xyz", "rpy") if origin is not None else ():
        assert origin is not None
        if (vector := origin.get(key)) is not None and [math.isfinite(_number(x)) for x in vector.split()] != [True] * 3:
            raise RobotModelError(
                f"{where} of the URDF: {key} of the <inertial>'s <origin> is '{vector}'; it must be three numbers."
            )


def _check_tree(links: list[str], joints: list[ElementTree.Element]) -> None:
    parents: dict[str, str] = {}
    for joint in joints:
        for tag in ("parent", "child"):
            if (link := _link(joint, tag)) not in links:
                what = "has no" if link is None else f"names '{link}', which is no link of it, as its"
                raise RobotModelError(f"joint '{joint.get('name')}' of the URDF {what} {tag}. The links are {_some(links)}.")
        child = str(_link(joint, "child"))
        if child in parents:
            raise RobotModelError(f"link '{child}' of the URDF is the child of two joints; links and joints must form one tree.")
        parents[child] = str(_link(joint, "parent"))
    roots = [link for link in links if link not in parents]
    if len(roots) > 1:
        raise RobotModelError(
            f"the URDF has {len(roots)} root links, {_some(roots)}; there must be one. Fix the others to it with joints, or take "
            "them out."
        )
    reached, more = set(roots), True
    while more:
        found = {child for child, parent in parents.items() if parent in reached} - reached
        reached, more = reached | found, bool(found)
    if lost := [str(joint.get("name")) for joint in joints if _link(joint, "child") not in reached]:
        raise RobotModelError(
            f"joints {_some(sorted(lost))} of the URDF do not hang on its root link; links and joints must form one tree. Check "
            "it with check_urdf."
        )


def _link(joint: ElementTree.Element, tag: str) -> str | None:
    end = joint.find(tag)
    return None if end is None else end.get("link")


def _number(text: str) -> float:
    """NaN where it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _some(names: list[str]) -> str:
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
