"""Robots that the tests run over, and their URDFs with a body fixed to a link."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample

DATA = Path(__file__).parent / "data"


@cache
def urdf(name: str) -> str:
    """The URDF's text: 'iiwa' is the simulated arm, from pybullet_data; the others are in test/data."""
    if name == "iiwa":
        pytest.importorskip("pybullet_data", reason="PyBullet, which brings the arm, is not installed")
        from sysid_ros.simulation.description import arm_description

        return arm_description()
    return (DATA / f"{name}.urdf").read_text()


ROBOTS = ("iiwa", "small_arm", "tree_robot")


@cache
def robot(name: str) -> RobotModel:
    return RobotModel.from_urdf(urdf(name))


def random_sample(model: RobotModel, rng: np.random.Generator, still: bool = False) -> Sample:
    """A sample within the joints' limits; at rest where ``still``."""
    lower, upper = np.maximum(model.position_lower, -3.0), np.minimum(model.position_upper, 3.0)
    moving = 0.0 if still else 1.0
    return Sample(
        0.0,
        rng.uniform(lower, upper),
        moving * rng.normal(size=model.n),
        moving * 3.0 * rng.normal(size=model.n),
        10.0 * rng.normal(size=model.n),
    )


def random_body(rng: np.random.Generator) -> tuple[float, FloatArray, FloatArray]:
    """Mass, centre of mass and inertia about it of a body with positive density."""
    points = 0.05 * rng.normal(size=(8, 3)) + 0.1 * rng.normal(size=3)
    weights = rng.uniform(0.1, 0.4, 8)
    com = weights @ points / weights.sum()
    rest = points - com
    inertia = sum(w * (r @ r * np.eye(3) - np.outer(r, r)) for w, r in zip(weights, rest, strict=True))
    return float(weights.sum()), com, inertia


def with_body(text: str, frame: str, mass: float, com: FloatArray, inertia_com: FloatArray) -> str:
    """The URDF in which a body is welded to a link, at its origin."""
    root = ElementTree.fromstring(text)
    link = ElementTree.SubElement(root, "link", name="welded_body")
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=" ".join(repr(float(x)) for x in com))
    ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
    axes = "xyz"
    tensor = {f"i{axes[i]}{axes[j]}": repr(float(inertia_com[i, j])) for i in range(3) for j in range(i, 3)}
    ElementTree.SubElement(inertial, "inertia", tensor)
    joint = ElementTree.SubElement(root, "joint", name="weld", type="fixed")
    ElementTree.SubElement(joint, "parent", link=frame)
    ElementTree.SubElement(joint, "child", link="welded_body")
    return ElementTree.tostring(root, encoding="unicode")
