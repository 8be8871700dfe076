"""Payload: a rigid body that the simulated arm picks up."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.rotation import rotation_of
from sysid_ros.sample import FloatArray

_EDGES = np.array([0.12, 0.09, 0.07])
_EDGES_MASS = 1.5


@dataclass(frozen=True, slots=True)
class Payload:
    """A rigid body in the frame of the tip link.

    Attributes:
        mass: [kg].
        com: centre of mass, shape (3,) [m].
        inertia_com: inertia about the centre of mass, axes parallel to the tip link's, shape (3, 3) [kg m^2].
    """

    mass: float
    com: FloatArray
    inertia_com: FloatArray

    @property
    def theta(self) -> FloatArray:
        """The ten inertial parameters about the frame's origin, shape (10,), in the order of ``inertial_parameters``."""
        return inertial_parameters.from_com(self.mass, self.com, self.inertia_com)

    def principal(self) -> tuple[FloatArray, FloatArray]:
        """Principal moments (3,) [kg m^2] and the rotation (3, 3) from the principal axes to the tip link's."""
        moments, axes = np.linalg.eigh(self.inertia_com)
        if np.linalg.det(axes) < 0.0:
            axes[:, 2] *= -1.0
        return moments, axes


def box(
    mass: float, com: Sequence[float], size: Sequence[float] | None = None, rpy: Sequence[float] = (0.0, 0.0, 0.0)
) -> Payload:
    """A box with the inertia of a solid one, whatever its centre of mass.

    Args:
        mass: [kg].
        com: centre of mass in the tip link's frame, shape (3,) [m].
        size: edges, shape (3,) [m]; None: 12 x 9 x 7 cm at 1.5 kg, scaled to the same density.
        rpy: how the box is turned in the tip link's frame: roll, pitch, yaw as in a URDF, shape (3,) [rad].
    """
    edges = _EDGES * (mass / _EDGES_MASS) ** (1.0 / 3.0) if size is None else np.asarray(size, dtype=float)
    squares = edges**2
    rotation = rotation_of(rpy)
    inertia = rotation @ np.diag(mass / 12.0 * (squares.sum() - squares)) @ rotation.T
    return Payload(float(mass), np.asarray(com, dtype=float), inertia)


def truth_of_payload(payload: Payload | None, events: Sequence[tuple[float, str]], start_time: float) -> dict[str, Any]:
    """What a recording says of its body, in plain types: ``events`` are (time since the start [s], pick or drop)."""
    first = {kind: start_time + t for t, kind in reversed(events)}
    body = payload and {
        "mass": payload.mass,
        "com": payload.com.tolist(),
        "inertia_com": payload.inertia_com.tolist(),
        "theta": payload.theta.tolist(),
    }
    return {
        "payload": body,
        "pick_time": first.get("pick"),
        "drop_time": first.get("drop"),
        "events": [{"t": start_time + t, "kind": kind} for t, kind in events],
    }


def urdf_with_payload(urdf: str, link: str, payload: Payload) -> str:
    """The URDF with the payload as one more link, fixed to ``link``: the model of the arm that carries it."""
    root = ElementTree.fromstring(urdf)
    body = ElementTree.SubElement(root, "link", name="payload")
    inertial = ElementTree.SubElement(body, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=" ".join(repr(float(x)) for x in payload.com), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(payload.mass))
    i = payload.inertia_com
    entries = {"ixx": i[0, 0], "ixy": i[0, 1], "ixz": i[0, 2], "iyy": i[1, 1], "iyz": i[1, 2], "izz": i[2, 2]}
    ElementTree.SubElement(inertial, "inertia", {name: repr(float(value)) for name, value in entries.items()})
    joint = ElementTree.SubElement(root, "joint", name="payload_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=link)
    ElementTree.SubElement(joint, "child", link="payload")
    ElementTree.SubElement(joint, "origin", xyz="0 0 0", rpy="0 0 0")
    return ElementTree.tostring(root, encoding="unicode")
