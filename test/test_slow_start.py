"""How the nodes start: what they say while they compile, how they end then, what they say of what nobody foresaw."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")

os.environ["ROS_DOMAIN_ID"] = str(os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from sysid_ros.exceptions import DataError
from sysid_ros.nodes import controller_parts, online_payload_estimator
from sysid_ros.nodes.adaptive_controller import AdaptiveController
from sysid_ros.nodes.messages import record_of, stamp_of
from sysid_ros.nodes.online_payload_estimator import OnlinePayloadEstimator
from sysid_ros.nodes.slow_start import cause_of, said_if_slow
from sysid_ros.robot.robot_model import RobotModel

ROOT = Path(__file__).resolve().parents[1]
URDF = Path(__file__).parent / "data" / "small_arm.urdf"
ONE_JOINT = """<robot name="lever"><link name="base"/>
  <link name="lever"><inertial><origin xyz="0.3 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="lever"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="60" velocity="4"/></joint></robot>"""


@pytest.fixture(scope="module")
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
    rclpy.init()
    yield
    rclpy.try_shutdown()


def start(name: str, folder: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    code = f"import sys; from sysid_ros.nodes import start; sys.exit(start.{name}())"
    return subprocess.Popen(
        [sys.executable, "-c", code, "--ros-args", "-p", f"urdf_path:={URDF}", *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT), "ROS_LOG_DIR": str(folder), "PYTHONUNBUFFERED": "1", **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def ended(process: subprocess.Popen[str], within: float) -> str:
    """What the process said until it ended."""
    try:
        said, _ = process.communicate(timeout=within)
    finally:
        process.kill()
    return said


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_node_that_compiles_says_so_and_ends_when_it_is_asked(number: int, tmp_path: Path) -> None:
    process = start("online_payload_estimator", tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "cold"))
    assert process.stdout is not None
    line = process.stdout.readline()
    assert "it is compiled" in line
    assert "about a minute" in line
    asked = time.monotonic()
    process.send_signal(number)
    rest = ended(process, 20.0)
    assert time.monotonic() - asked < 10.0
    assert process.returncode == 130
    assert "Traceback" not in rest


@pytest.mark.slow
@pytest.mark.parametrize("name", ["online_payload_estimator", "adaptive_controller"])
def test_no_interrupt_at_any_moment_prints_a_stack(name: str, tmp_path: Path) -> None:
    """Moments between the first import and a node that runs, drawn without pattern; SYSID_STOPS makes them more."""
    rng = np.random.default_rng(3)
    with_stack = {}
    for wait in rng.uniform(0.02, 4.0, int(os.environ.get("SYSID_STOPS", "8"))):
        process = start(name, tmp_path, "-p", "autostart:=true")
        time.sleep(float(wait))
        process.send_signal(signal.SIGINT)
        said = ended(process, 30.0)
        # before the interpreter has come to a line of ours, Python itself answers
        if "Traceback" in said and re.search(r'/sysid_ros/(\w+/)*\w+\.py"', said):
            with_stack[round(float(wait), 2)] = said[-600:]
    assert not with_stack


def test_slow_is_said_once_and_quick_is_not() -> None:
    said: list[str] = []
    with said_if_slow(said.append, "wait", 0.05):
        time.sleep(0.3)
    with said_if_slow(said.append, "not this", 5.0):
        pass
    time.sleep(0.05)
    assert said == ["wait"]


def test_the_cause_of_what_was_foreseen_is_its_own_sentence() -> None:
    assert cause_of(DataError("no joint states.")) == "no joint states."
    text = cause_of(TypeError("a kernel"))
    assert "TypeError: a kernel" in text
    assert "sysid doctor" in text


def broken(*_: object) -> None:
    raise RuntimeError("made up")


@pytest.mark.parametrize(
    ("kind", "module", "name"),
    [
        (OnlinePayloadEstimator, online_payload_estimator, "warm_up"),
        (OnlinePayloadEstimator, online_payload_estimator, "urdf_text"),
        (AdaptiveController, controller_parts, "make_law"),
    ],
)
def test_an_exception_in_configure_is_said_with_cause_and_cure(
    ros: None,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    kind: Callable[..., Any],
    module: Any,
    name: str,
) -> None:
    monkeypatch.setattr(module, name, broken)
    given = [Parameter("urdf_path", value=str(URDF)), Parameter("autostart", value=False)]
    node = kind(namespace=f"broken_{name}", parameter_overrides=given)
    assert node.trigger_configure() == TransitionCallbackReturn.FAILURE
    problem = node._problem
    node.destroy_node()
    said = capfd.readouterr().err
    for text in (problem, said):
        assert "RuntimeError: made up" in text
        assert "sysid doctor" in text


@pytest.mark.parametrize("kind", [OnlinePayloadEstimator, AdaptiveController])
def test_a_robot_of_one_joint_is_configured_and_moved(ros: None, tmp_path: Path, kind: Callable[..., Any]) -> None:
    path = tmp_path / "one.urdf"
    path.write_text(ONE_JOINT)
    given = [Parameter("urdf_path", value=str(path)), Parameter("autostart", value=True)]
    node = kind(namespace="lever", parameter_overrides=given)
    assert node.live is not None
    robot, t0 = RobotModel.from_urdf(ONE_JOINT), time.time()
    for k in range(500):
        t = k / 250.0
        q, v, a = (np.array([x]) for x in (0.5 * np.sin(2 * t), np.cos(2 * t), -2.0 * np.sin(2 * t)))
        message = JointState(name=["turn"], position=q.tolist(), velocity=v.tolist(), effort=robot.rnea(q, v, a).tolist())
        message.header.stamp = stamp_of(t0 + t)
        node._on_joint_states(message, *([record_of] if kind is OnlinePayloadEstimator else []))
    if kind is OnlinePayloadEstimator:
        assert not node._troubles
        assert not node.live.troubles
        assert node.live.estimation.latest is not None
    else:
        assert node.live.reference is not None
    node.destroy_node()
