"""urdf_of_mjcf: a robot that is described for MuJoCo, as a URDF of the same bodies, joints and joint dynamics."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from sysid_ros.exceptions import RobotModelError, in_a_line
from sysid_ros.sample import FloatArray

_FREE, _BALL, _SLIDE = 0, 1, 2
"""Types of joints in MuJoCo, beside the hinge."""
_TIES_JOINTS = 2
"""Type of an equality in MuJoCo between the positions of two joints."""


def is_mjcf(text: str) -> bool:
    """Whether a text describes a robot for MuJoCo: its first element is that of an MJCF. URDFs may hold one further on."""
    first = re.search(r"<(?=\w)(\w+)", re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL))
    return first is not None and first[1] == "mujoco"


def read_mjcf(path: Path) -> Any:
    """The model that MuJoCo makes of an MJCF.

    Raises:
        RobotModelError: MuJoCo is not installed or can't read the file.
    """
    try:
        import mujoco
    except ImportError:
        raise RobotModelError(f"'{path}' is an MJCF, which MuJoCo reads: pip install 'sysid_ros[mujoco]'.") from None
    without_log(mujoco)
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except Exception as error:
        raise RobotModelError(f"MuJoCo can't read '{path}': {in_a_line(error)}.") from error


def urdf_of_mjcf(path: Path) -> str:
    """The URDF of the robot in an MJCF, as MuJoCo itself reads it.

    Bodies keep their names, inertials and frames; a hinge or slide away from its body's origin gets a frame of its own.
    ``damping`` and ``frictionloss`` become ``<dynamics>``, ``armature`` its attribute of that name, which URDFs do not have and
    this package reads. Positions are MuJoCo's: a joint with ``ref`` is not at 0 where the file draws it. A joint that an
    ``<equality>`` ties to another becomes its ``<mimic>``, as fingers are. A free joint is left out: its body is the root, as of
    a robot on legs. Shapes are left out: see :func:`.mjcf_geoms`.

    Raises:
        RobotModelError: as of :func:`read_mjcf`, or it has ball joints.
    """
    model = read_mjcf(path)
    if np.any(model.jnt_type == _BALL):
        raise RobotModelError(f"'{path}' has ball joints; only hinges and slides can be estimated.")
    root = ElementTree.Element("robot", name=bytes(model.names).split(b"\0", 1)[0].decode(errors="replace") or path.stem)
    ElementTree.SubElement(root, "link", name="world")
    for body in range(1, model.nbody):
        _body(root, model, body)
    _tied(root, model)
    _without_free_base(root)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def without_log(mujoco: Any) -> None:
    """Keep MuJoCo from writing its warnings to a file MUJOCO_LOG.TXT in the folder at hand; a handler that is set stays."""
    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(lambda text: None)


def _body(root: ElementTree.Element, model: Any, body: int) -> None:
    """Add a body with its joints."""
    name, before = link_of(model, body), int(model.body_parentid[body])
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    rotation = pin.Quaternion(*model.body_quat[body].tolist()).toRotationMatrix()
    at = shift_of_link(model, before) + model.body_pos[body]
    behind: FloatArray = np.zeros(3)  # the body's origin in the frame that the next joint starts from
    link = link_of(model, before)
    for k in range(first, first + count):
        joint = model.joint(k)
        own = name if k == first + count - 1 else f"{name}_before_{model.joint(k + 1).name or k + 1}"
        free = int(model.jnt_type[k]) == _FREE
        place = np.zeros(3) if free else np.array(model.jnt_pos[k])
        shift, turn = (np.zeros(3), np.eye(3)) if free else _at_zero(model, k)
        at_zero = at + rotation @ (behind + place + shift)
        _joint(root, model, k, joint.name or f"joint_{k}", link, own, at_zero, rotation @ turn)
        link, at, rotation, behind = own, np.zeros(3), np.eye(3), -place
    if count == 0:
        _joint(root, model, -1, f"{name}_fixed", link, name, at, rotation)
    last = ElementTree.SubElement(root, "link", name=name)
    _inertial(last, model, body)
    for k in range(first, first + count - 1):
        ElementTree.SubElement(root, "link", name=f"{name}_before_{model.joint(k + 1).name or k + 1}")


def link_of(model: Any, body: int) -> str:
    """The link that a body of MuJoCo's becomes."""
    return str(model.body(body).name) or f"body_{body}"  # "world" of body 0


def shift_of_link(model: Any, body: int) -> FloatArray:
    """Where the origin of a body of MuJoCo's is in the frame of its link, which is that of its last joint, shape (3,) [m]."""
    last = int(model.body_jntadr[body]) + int(model.body_jntnum[body]) - 1
    still = int(model.body_jntnum[body]) == 0 or int(model.jnt_type[last]) == _FREE
    return np.zeros(3) if still else -np.array(model.jnt_pos[last])


def _at_zero(model: Any, k: int) -> tuple[FloatArray, FloatArray]:
    """From where the file draws what a joint moves to where it is at position 0: a shift (3,) [m] and a rotation (3, 3)."""
    drawn_at, axis = float(model.qpos0[model.jnt_qposadr[k]]), np.array(model.jnt_axis[k])
    if int(model.jnt_type[k]) == _SLIDE:
        return -drawn_at * axis, np.eye(3)
    return np.zeros(3), np.array(pin.AngleAxis(-drawn_at, axis).toRotationMatrix())


def _tied(root: ElementTree.Element, model: Any) -> None:
    """``<mimic>`` of the joints that an active equality makes a line of another joint's position."""
    joints = {str(joint.get("name")): joint for joint in root.findall("joint")}
    for k in range(model.neq):
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        offset, slope, *curved = model.eq_data[k, :5].tolist()
        if int(model.eq_type[k]) != _TIES_JOINTS or not model.eq_active0[k] or second < 0 or any(curved) or not slope:
            continue
        drawn_at = [float(model.qpos0[model.jnt_qposadr[j]]) for j in (first, second)]
        joint = joints[model.joint(first).name or f"joint_{first}"]
        other = model.joint(second).name or f"joint_{second}"
        shift = drawn_at[0] + offset - slope * drawn_at[1]
        ElementTree.SubElement(joint, "mimic", joint=other, multiplier=repr(slope), offset=repr(shift))


def _joint(
    root: ElementTree.Element, model: Any, k: int, name: str, parent: str, child: str, at: FloatArray, rotation: FloatArray
) -> None:
    kind = "fixed" if k < 0 else {_FREE: "floating", _SLIDE: "prismatic"}.get(int(model.jnt_type[k]), "revolute")
    limited = k >= 0 and bool(model.jnt_limited[k])
    if kind == "revolute" and not limited:
        kind = "continuous"
    element = ElementTree.SubElement(root, "joint", name=name, type=kind)
    _origin(element, at, rotation)
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    if kind in ("fixed", "floating"):
        return
    ElementTree.SubElement(element, "axis", xyz=_words(model.jnt_axis[k]))
    low, high = model.jnt_range[k] if limited else (-1e6, 1e6)
    bounds = {} if kind == "continuous" else {"lower": repr(float(low)), "upper": repr(float(high))}
    ElementTree.SubElement(element, "limit", {**bounds, "effort": repr(_effort(model, k)), "velocity": "0"})
    dof = int(model.jnt_dofadr[k])
    values = {"damping": model.dof_damping, "friction": model.dof_frictionloss, "armature": model.dof_armature}
    ElementTree.SubElement(element, "dynamics", {word: repr(float(x[dof])) for word, x in values.items()})


def _effort(model: Any, k: int) -> float:
    """Largest effort of a joint; 0 where nothing limits it."""
    found = [float(np.abs(model.jnt_actfrcrange[k]).max())] if model.jnt_actfrclimited[k] else []
    for a in range(model.nu):
        if model.actuator_forcelimited[a] and int(model.actuator_trnid[a, 0]) == k and int(model.actuator_trntype[a]) in (0, 1):
            found.append(float(np.abs(model.actuator_forcerange[a] * model.actuator_gear[a, 0]).max()))
    return min(found, default=0.0)


def _inertial(link: ElementTree.Element, model: Any, body: int) -> None:
    mass = float(model.body_mass[body])
    if mass <= 0.0:
        return
    element = ElementTree.SubElement(link, "inertial")
    turned = pin.Quaternion(*model.body_iquat[body].tolist()).toRotationMatrix()
    tensor = turned @ np.diag(model.body_inertia[body]) @ turned.T
    _origin(element, shift_of_link(model, body) + model.body_ipos[body], np.eye(3))
    ElementTree.SubElement(element, "mass", value=repr(mass))
    entries = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ElementTree.SubElement(element, "inertia", {key: repr(float(tensor[ij])) for key, ij in entries.items()})


def _without_free_base(root: ElementTree.Element) -> None:
    """A body that floats is the root itself."""
    free = [joint for joint in root.findall("joint") if joint.get("type") == "floating"]
    if len(free) != 1:
        return
    parents = {j.find("child").get("link"): j for j in root.findall("joint")}  # type: ignore[union-attr]
    if sum(j.find("parent").get("link") == "world" for j in parents.values()) == 1:  # type: ignore[union-attr]
        root.remove(free[0])
        root.remove(next(link for link in root.findall("link") if link.get("name") == "world"))


def _origin(element: ElementTree.Element, at: FloatArray, rotation: FloatArray) -> None:
    ElementTree.SubElement(element, "origin", xyz=_words(at), rpy=_words(pin.rpy.matrixToRpy(np.asarray(rotation))))


def _words(values: Any) -> str:
    return " ".join(repr(float(x)) for x in values)
