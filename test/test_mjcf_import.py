"""A robot described for MuJoCo, read as a URDF: the same torques as MuJoCo's own."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from robots import ROBOTS, robot

import sysid_ros as sysid
from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import urdf_text
from sysid_ros.torque.mjcf_export import mjcf
from sysid_ros.torque.torque_model import TorqueModel

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")

ARM = """<mujoco model="three">
  <compiler angle="degree" eulerseq="xyz"/>
  <default><joint damping="0.3" armature="0.02"/></default>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="stand" pos="0.1 0.2 0.3" euler="10 20 30">
      <geom type="box" size="0.1 0.1 0.1" mass="2"/>
      <body name="upper" pos="0 0 0.1" euler="0 90 5">
        <joint name="shoulder" type="hinge" axis="0 0.6 0.8" pos="0.02 0.01 -0.03" range="-120 120" frictionloss="0.5"/>
        <joint name="twist" type="hinge" axis="1 0 0" pos="0 0.05 0" range="-90 90"/>
        <inertial pos="0.1 0.02 0.3" mass="1.5" fullinertia="0.03 0.03 0.02 0.001 0.002 0.003"/>
        <body name="tube" pos="0 0.1 0.4" quat="0.9 0.1 0.3 0.2">
          <geom type="capsule" size="0.03 0.1" pos="0.01 0 0.05" density="800"/>
          <body name="rod" pos="0.05 0 0.1">
            <joint name="slide" type="slide" axis="0 0.2 1" range="0 0.5" armature="0"/>
            <inertial pos="0 0 0.1" mass="0.7" diaginertia="0.001 0.002 0.003" euler="30 0 60"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="shoulder" gear="2" forcelimited="true" forcerange="-20 20"/></actuator>
</mujoco>"""


def without_shapes(text: str) -> str:
    """A URDF whose bodies are just as it states, for MuJoCo's own reader of URDFs."""
    root = ElementTree.fromstring(text)
    for link in root.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", fusestatic="false")
    return ElementTree.tostring(root, encoding="unicode")


def as_mjcf(urdf: str) -> str:
    """The MJCF that MuJoCo makes of a URDF. It saves six digits; bodies and joints get all of what it compiled back."""
    spec = mujoco.MjSpec.from_string(without_shapes(urdf))
    compiled = spec.compile()
    root = ElementTree.fromstring(spec.to_xml())

    def in_full(element: ElementTree.Element | None, **values: Any) -> None:
        assert element is not None
        for word, value in values.items():
            saved = np.array([float(x) for x in element.get(word, "").split()] or np.zeros_like(value))
            if word in element.attrib:
                np.testing.assert_allclose(saved, value, rtol=1e-5, atol=1e-6)
            element.set(word, " ".join(repr(float(x)) for x in np.atleast_1d(value)))

    for element in root.iter("body"):
        body = compiled.body(element.get("name"))
        in_full(element, pos=body.pos, quat=body.quat)
        in_full(element.find("inertial"), pos=body.ipos, quat=body.iquat, mass=body.mass, diaginertia=body.inertia)
    for element in root.iterfind(".//body/joint"):
        joint = compiled.joint(element.get("name"))
        in_full(element, pos=joint.pos, axis=joint.axis)
    return ElementTree.tostring(root, encoding="unicode")


@pytest.mark.parametrize("fingers", ["locked", "as told", "moving"])
def test_a_panda_as_urdf_and_as_mjcf(fingers: str, tmp_path: Path) -> None:
    """Equal torques of 1000 states, fingers locked, one of them moving (the other follows it), or both."""
    described = packaged("panda")
    if described is None:
        pytest.skip("example-robot-data, which has the Panda, is not installed")
    path = tmp_path / "panda.xml"
    path.write_text(as_mjcf(described.read_text()))
    both = (*(f"panda_joint{k}" for k in range(1, 8)), "panda_finger_joint1", "panda_finger_joint2")
    wanted = {"locked": both[:7], "as told": (), "moving": both}[fingers]
    own, again = (RobotModel.from_urdf(urdf_text(file), wanted) for file in (described, path))
    assert own.joint_names == again.joint_names == (wanted or both[:8])
    assert {"panda_hand", "panda_hand_tcp", "panda_link8"} <= set(again.frame_names)
    assert own.default_frame == again.default_frame
    np.testing.assert_array_equal(own.position_upper, again.position_upper)
    np.testing.assert_array_equal(own.effort_limit, again.effort_limit)
    np.testing.assert_array_equal(own.damping, again.damping)
    rng, largest = np.random.default_rng(7), 0.0
    for _ in range(1000):
        q = rng.uniform(own.position_lower, own.position_upper)
        v, a = rng.normal(size=(2, own.n)) * [[1.0], [5.0]]
        tau = own.rnea(q, v, a)
        np.testing.assert_allclose(again.rnea(q, v, a), tau, rtol=0.0, atol=1e-9)
        largest = max(largest, float(np.abs(tau).max()))
    assert largest > 50.0


def test_positions_are_mujocos_where_a_joint_has_a_reference(tmp_path: Path) -> None:
    """Drawn at 30 degrees and 0.1 m, which are its positions there; a finger that follows another one has its line."""
    text = ARM.replace('name="shoulder"', 'name="shoulder" ref="30"').replace('name="slide"', 'name="slide" ref="0.1"')
    path = tmp_path / "three.xml"
    path.write_text(text)
    assert_same_torques(text, RobotModel.from_urdf(urdf_text(path)))
    path.write_text(
        text.replace(
            "</mujoco>",
            '<equality><joint joint1="twist" joint2="shoulder" polycoef="0.2 -0.5 0 0 0"/></equality></mujoco>',
        )
    )
    tied = ElementTree.fromstring(urdf_text(path)).find("joint[@name='twist']/mimic")
    assert tied is not None
    assert tied.get("joint") == "shoulder"
    assert [float(tied.get(word, "nan")) for word in ("multiplier", "offset")] == pytest.approx([-0.5, 0.2 + 0.5 * np.pi / 6.0])
    assert RobotModel.from_urdf(urdf_text(path)).joint_names == ("shoulder", "slide")


def assert_same_torques(text: str, model: RobotModel) -> None:
    """Inverse dynamics of random states, friction left out."""
    theirs = mujoco.MjModel.from_xml_string(text)
    theirs.dof_damping[:], theirs.dof_frictionloss[:] = 0.0, 0.0
    theirs.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data, rng = mujoco.MjData(theirs), np.random.default_rng(0)
    order = [theirs.joint(name).dofadr[0] for name in model.joint_names]
    for _ in range(50):
        q, v, a = rng.uniform(-1.0, 1.0, (3, model.n))
        data.qpos[order], data.qvel[order], data.qacc[order] = q, v, a
        mujoco.mj_inverse(theirs, data)
        np.testing.assert_allclose(model.rnea(q, v, a), data.qfrc_inverse[order], rtol=1e-9, atol=1e-9)


def test_torques_are_mujocos(tmp_path: Path) -> None:
    path = tmp_path / "three.xml"
    path.write_text(ARM)
    model = RobotModel.from_urdf(urdf_text(path))
    assert model.name == "three"
    assert model.joint_names == ("shoulder", "twist", "slide")
    assert_same_torques(ARM, model)
    np.testing.assert_allclose(model.position_upper, [np.deg2rad(120.0), np.deg2rad(90.0), 0.5])
    np.testing.assert_allclose(model.damping, 0.3)
    np.testing.assert_allclose(model.friction, [0.5, 0.0, 0.0])
    np.testing.assert_allclose(model.model.armature, [0.02, 0.02, 0.0])
    assert model.effort_limit[0] == pytest.approx(40.0)
    assert np.isinf(model.effort_limit[1])


@pytest.mark.parametrize("name", ROBOTS)
def test_a_urdf_as_mjcf_and_back(name: str, tmp_path: Path) -> None:
    """What the package writes for MuJoCo, it reads again: the same torques."""
    own, path = robot(name), tmp_path / "robot.xml"
    path.write_text(mjcf(TorqueModel(own, [], [])))
    again, rng = RobotModel.from_urdf(urdf_text(path), own.joint_names), np.random.default_rng(1)
    for _ in range(20):
        q, v, a = rng.uniform(-1.0, 1.0, (3, own.n))
        np.testing.assert_allclose(again.rnea(q, v, a), own.rnea(q, v, a), rtol=1e-9, atol=1e-9)


def test_a_robot_of_the_library_may_be_one(tmp_path: Path) -> None:
    path = tmp_path / "three.xml"
    path.write_text(ARM)
    assert repr(sysid.Robot(path)).startswith("Robot three: 3 joints, ")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("<mujoco><worldbody><body><joint type='ball'/><geom size='1'/></body></worldbody></mujoco>", "ball joints"),
        ("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>", "MuJoCo can't read"),
        ("<mujoco><worldbody", "MuJoCo can't read"),
    ],
)
def test_what_cannot_be_read_is_said(text: str, word: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.xml"
    path.write_text(text)
    with pytest.raises(RobotModelError, match=word):
        urdf_text(path)


def test_a_floating_body_is_the_root(tmp_path: Path) -> None:
    path = tmp_path / "hopper.xml"
    path.write_text(
        "<mujoco><worldbody><body name='trunk' pos='0 0 1'><freejoint/><geom size='0.1'/><body name='leg' pos='0 0 -0.1'>"
        "<joint name='hip'/><geom size='0.05' pos='0 0 -0.1'/></body></body></worldbody></mujoco>"
    )
    text = urdf_text(path)
    assert "floating" not in text
    assert RobotModel.from_urdf(text).joint_names == ("hip",)
