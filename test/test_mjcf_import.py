"""A robot described for MuJoCo, read as a URDF: the same torques as MuJoCo's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from robots import ROBOTS, robot

import sysid_ros as sysid
from sysid_ros.exceptions import RobotModelError
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
        np.testing.assert_allclose(again.rnea(q, v, a), own.rnea(q, v, a), rtol=1e-6, atol=1e-6)


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
