"""Robots that are written as macros."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot import xacro_file
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.xacro_file import urdf_of_xacro, with_arguments
from sysid_ros.sources import urdf_text

ARM = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="mass" default="2.0"/>
  <xacro:macro name="part" params="name parent">
    <link name="${name}"><inertial><origin xyz="0 0 0.1"/><mass value="$(arg mass)"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
    <joint name="${name}_joint" type="revolute"><parent link="${parent}"/><child link="${name}"/><axis xyz="0 1 0"/>
      <limit lower="${-pi}" upper="${pi}" effort="10" velocity="1"/></joint>
  </xacro:macro>
  <link name="base"/>
  <xacro:part name="upper" parent="base"/>
  <xacro:part name="fore" parent="upper"/>
</robot>
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    path = tmp_path / "an arm.urdf.xacro"
    path.write_text(ARM)
    return path


def test_macros_are_expanded_with_arguments(arm: Path) -> None:
    pytest.importorskip("xacro", reason="xacro is not installed")
    model = RobotModel.from_urdf(urdf_text(arm))
    assert model.joint_names == ("upper_joint", "fore_joint")
    assert model.pi.reshape(2, 10)[:, 0].tolist() == [2.0, 2.0]
    heavy = RobotModel.from_urdf(urdf_text(f"{arm} mass:=3.5"))
    assert heavy.pi.reshape(2, 10)[:, 0].tolist() == [3.5, 3.5]
    arm.write_text(ARM.replace("<xacro:part name=", "<xacro:piece name=", 1))
    with pytest.raises(RobotModelError, match="piece"):
        urdf_text(arm)


def test_what_xacro_says_is_passed_on(arm: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the shell in its place, so that it needs no xacro: the URDF from stdout, the reason from stderr, and its end."""
    told: list[list[str]] = []
    real = subprocess.run

    def run(command: list[str], **more: object) -> object:
        told.append(command)
        script = "echo '<robot/>'" if "mass:=1" in command else "echo no macro 'part' >&2; exit 2"
        return real(["sh", "-c", script], **more)  # type: ignore[call-overload]

    monkeypatch.setattr(xacro_file, "_command", lambda: ["xacro"])
    monkeypatch.setattr(subprocess, "run", run)
    assert urdf_of_xacro(arm, ["mass:=1"]) == "<robot/>\n"
    assert told == [["xacro", str(arm), "mass:=1"]]
    with pytest.raises(RobotModelError, match="no macro part"):
        urdf_of_xacro(arm)


def test_without_xacro_it_says_what_to_do(arm: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(RobotModelError, match=r"pip install 'sysid_ros\[xacro\]'.*xacro an arm.urdf.xacro mass:=1 > robot.urdf"):
        urdf_text(f"{arm} mass:=1")


def test_arguments_stand_behind_the_path() -> None:
    assert with_arguments("a b/arm.xacro side:=left  name:=x") == ("a b/arm.xacro", ["side:=left", "name:=x"])
    assert with_arguments("arm.urdf") == ("arm.urdf", [])
