"""The example for ros2_control, as far as it can be checked without: description, controllers and launch file fit each other."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")

from sysid_ros.exceptions import SettingsError
from sysid_ros.nodes.launch_plan import LAUNCH_FILES, NodePlan
from sysid_ros.nodes.ros2_control import command_order
from sysid_ros.nodes.viewers import Program
from sysid_ros.robot.robot_model import RobotModel

CONFIG = Path(__file__).resolve().parents[1] / "config"
URDF, CONTROLLERS = CONFIG / "ros2_control" / "example_arm.urdf", CONFIG / "ros2_control" / "controllers.yaml"
FILE = LAUNCH_FILES["ros2_control_arm.launch.py"]


def parameters(name: str) -> dict[str, Any]:
    read: dict[str, Any] = yaml.safe_load(CONTROLLERS.read_text(encoding="utf-8"))
    found: dict[str, Any] = read[f"/**/{name}"]["ros__parameters"]
    return found


def launched(**given: str) -> tuple[dict[str, NodePlan], list[Program]]:
    values = {a.name: a.default for a in FILE.arguments(CONFIG)} | given
    return {plan.executable: plan for plan in FILE.plan(values, CONFIG)}, FILE.programs(values, CONFIG)


def test_the_description_has_what_ros2_control_and_the_model_need() -> None:
    root = ElementTree.parse(URDF).getroot()
    robot = RobotModel.from_urdf(URDF.read_text(encoding="utf-8"))
    joints = {joint.get("name"): joint for joint in root.iterfind("ros2_control/joint")}
    assert set(joints) == set(robot.joint_names)
    for joint in joints.values():
        assert [i.get("name") for i in joint.iterfind("command_interface")] == ["effort"]
        assert {i.get("name") for i in joint.iterfind("state_interface")} == {"position", "velocity", "effort"}
    assert root.findtext("ros2_control/hardware/plugin") == "mock_components/GenericSystem"
    assert robot.flange == "tool0"
    assert np.isfinite(robot.effort_limit).all()
    assert np.isfinite(robot.velocity_limit).all()
    # it can hold itself in any posture, with a payload of 3 kg at its end
    rng = np.random.default_rng(0)
    frame = robot.frame_id("tool0")
    still = np.zeros(robot.n)
    for _ in range(200):
        q = rng.uniform(robot.position_lower, robot.position_upper)
        carried = robot.payload_regressor(q, still, still, frame) @ np.array([3.0, *np.zeros(9)])
        assert np.all(np.abs(robot.gravity_torque(q) + carried) < robot.effort_limit)


def test_the_controllers_are_those_that_are_spawned_and_of_the_robots_joints() -> None:
    manager = parameters("controller_manager")
    kinds = {name: x["type"] for name, x in manager.items() if isinstance(x, dict)}
    assert kinds == {
        "joint_state_broadcaster": "joint_state_broadcaster/JointStateBroadcaster",
        "effort_controller": "effort_controllers/JointGroupEffortController",
    }
    robot = RobotModel.from_urdf(URDF.read_text(encoding="utf-8"))
    assert set(parameters("effort_controller")["joints"]) == set(robot.joint_names)
    assert set(parameters("joint_state_broadcaster")["interfaces"]) == {"position", "velocity", "effort"}
    nodes, programs = launched()
    (spawner,) = [p for p in programs if p.executable == "spawner"]
    assert set(spawner.arguments[:2]) == set(kinds)
    # the gains must be for a loop that is no faster than the states
    from sysid_ros.control.control_settings import ControlSettings

    assert 1.0 / manager["update_rate"] < ControlSettings().loop_delay
    assert nodes["adaptive_controller"].remappings == {"effort_commands": "effort_controller/commands"}


def test_the_order_of_the_commands_is_the_effort_controllers(tmp_path: Path) -> None:
    nodes, _ = launched()
    assert nodes["adaptive_controller"].parameters["joint_names"] == parameters("effort_controller")["joints"]
    text = "effort_controller:\n  ros__parameters: {joints: [b, a]}\n"
    (tmp_path / "mine.yaml").write_text(text)
    nodes, _ = launched(controllers=str(tmp_path / "mine.yaml"))
    assert nodes["adaptive_controller"].parameters["joint_names"] == ["b", "a"]
    nodes, _ = launched(controllers=str(tmp_path / "mine.yaml"), joint_names="[a, b]")
    assert nodes["adaptive_controller"].parameters["joint_names"] == ["a", "b"]


@pytest.mark.parametrize(
    "text", [None, "a: [", "controller_manager: {}", "effort_controller: {ros__parameters: {joints: []}}", "3"]
)
def test_controllers_that_say_no_order_are_refused(text: str | None, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(SettingsError, match="controllers:="):
        command_order(path)


def test_everything_moves_with_the_namespace() -> None:
    nodes, programs = launched(namespace="left", rviz="true", use_sim_time="true")
    assert all(p.parameters["use_sim_time"] is True for p in programs)
    assert {plan.namespace for plan in nodes.values()} == {"left"}
    assert [(p.package, p.executable) for p in programs] == [
        ("robot_state_publisher", "robot_state_publisher"),
        ("controller_manager", "ros2_control_node"),
        ("controller_manager", "spawner"),
        ("rviz2", "rviz2"),
    ]
    assert {p.namespace for p in programs} == {"left"}
    assert programs[-1].arguments[-1] == "base_link"
    assert ElementTree.fromstring(programs[0].parameters["robot_description"]).tag == "robot"
    assert programs[1].config == str(CONTROLLERS)
