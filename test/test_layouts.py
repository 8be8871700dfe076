"""The layouts in config/: every topic in them is published with the type that they take it for, and every number is there."""

from __future__ import annotations

import json
import os
import re
import sys
import types
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")

os.environ["ROS_DOMAIN_ID"] = str(os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker

from sysid_ros.nodes.adaptive_controller import AdaptiveController
from sysid_ros.nodes.believed import EstimateMessage
from sysid_ros.nodes.drawings import PayloadFrame, markers_message, region_of, transform_of
from sysid_ros.nodes.launch_plan import LAUNCH_FILES
from sysid_ros.nodes.messages import stamp_of
from sysid_ros.nodes.online_payload_estimator import OnlinePayloadEstimator
from sysid_ros.nodes.viewers import Program, moved, root_link
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.robot.inertial_parameters import from_com

CONFIG = Path(__file__).resolve().parents[1] / "config"
URDF = Path(__file__).parent / "data" / "small_arm.urdf"
RVIZ, FOXGLOVE, PLOTJUGGLER = (CONFIG / f"payload.{end}" for end in ("rviz", "foxglove.json", "plotjuggler.xml"))
# what a display of RViz and a panel of Foxglove subscribe to
DISPLAYS = {
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "PoseWithCovariance": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "RobotModel": "std_msgs/msg/String",
}
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
MESSAGES = {
    DIAGNOSTICS: DiagnosticArray,
    "geometry_msgs/msg/InertiaStamped": InertiaStamped,
    "sensor_msgs/msg/JointState": JointState,
}


@pytest.fixture(scope="module")
def topics(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Type of each topic that the nodes publish, and of those that they read as the robot publishes them."""
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
    rclpy.init()
    idle = [Parameter("autostart", value=False)]
    nodes: list[Any] = [OnlinePayloadEstimator(parameter_overrides=idle), AdaptiveController(parameter_overrides=idle)]
    found: dict[str, str] = {}
    for node in nodes:
        name = (node.get_name(), node.get_namespace())
        found |= {topic: kinds[0] for topic, kinds in node.get_subscriber_names_and_types_by_node(*name)}
        found |= {topic: kinds[0] for topic, kinds in node.get_publisher_names_and_types_by_node(*name)}
    yield found
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()


def estimate(status: str = "ok") -> PayloadEstimate:
    theta = from_com(1.5, np.array([0.03, -0.02, 0.1]), np.diag([0.004, 0.005, 0.006]))
    covariance = np.diag(np.arange(1.0, 11.0)) * 1e-6
    return PayloadEstimate(3.0, "flange", theta, covariance, status, "", np.ones(10, dtype=bool), np.zeros(6), np.ones(6))


def value_at(kind: str, path: str) -> Any:
    """The value of a path such as inertia.com.x or effort[2] in a message of a type, as it comes from a node."""
    message: Any = MESSAGES[kind]()
    if isinstance(message, JointState):
        message.name, message.effort = [f"joint_{i}" for i in range(6)], [1.0] * 6
    if isinstance(message, DiagnosticArray):
        from sysid_ros.nodes.believed import Believed

        message = EstimateMessage().of(estimate(), "ok", "", Believed.of(estimate(), "ok"), stamp_of(3.0))
    for name, index in re.findall(r"(\w+)(?:\[(\d+)\])?", path):
        message = getattr(message, name)
        message = message[int(index)] if index else message
    return message


def test_rviz_shows_what_the_nodes_publish(topics: dict[str, str]) -> None:
    manager = yaml.safe_load(RVIZ.read_text(encoding="utf-8"))["Visualization Manager"]
    shown = {}
    for display in manager["Displays"]:
        kind = display["Class"].removeprefix("rviz_default_plugins/")
        if topic := display.get("Topic", display.get("Description Topic")):
            # relative, so that they move with RViz's namespace
            assert not topic["Value"].startswith("/")
            assert topics[f"/{topic['Value']}"] == DISPLAYS[kind]
            shown[kind] = topic
    assert set(shown) == set(DISPLAYS)
    assert shown["RobotModel"]["Durability Policy"] == "Transient Local"
    (markers,) = [d for d in manager["Displays"] if d["Class"].endswith("MarkerArray")]
    drawn = markers_message(estimate(), stamp_of(3.0)).markers
    assert {marker.ns for marker in drawn} == set(markers["Namespaces"])


def test_foxglove_shows_what_the_nodes_publish(topics: dict[str, str]) -> None:
    layout = json.loads(FOXGLOVE.read_text(encoding="utf-8"))
    panels = layout["configById"]
    places = re.findall(r'"(?:first|second)": "([^"]+)"', json.dumps(layout["layout"]))
    assert sorted(places) == sorted(panels)
    numbers = 0
    for name, panel in panels.items():
        if name.startswith("Diagnostic"):
            assert topics[panel["topicToRender"]] == DIAGNOSTICS
        for topic in panel.get("topics", {}):
            assert topics[topic] == DISPLAYS["MarkerArray"]
        for layer in panel.get("layers", {}).values():
            assert layer["layerId"] == "foxglove.Grid" or topics[layer["topic"]] == DISPLAYS["RobotModel"]
        for path in panel.get("paths", []):
            topic, _, rest = path["value"].partition(".")
            value = value_at(topics[topic], rest)
            assert isinstance(value, str if name.startswith("StateTransitions") else float), path["value"]
            assert path["timestampMethod"] == "headerStamp"
            numbers += 1
    assert numbers > 10


def test_plotjuggler_shows_what_the_nodes_publish(topics: dict[str, str]) -> None:
    root = ElementTree.parse(PLOTJUGGLER).getroot()
    selected = {topic.get("name") for topic in root.iterfind(".//selected_topics/topic")}
    assert selected <= set(topics)
    stamped = root.find(".//use_header_stamp")
    assert stamped is not None
    assert stamped.get("value") == "true"
    curves = [curve.get("name", "") for curve in root.iterfind(".//curve")]
    assert len(curves) > 20
    for name in curves:
        (topic,) = [t for t in selected if t is not None and name.startswith(f"{t}/")]
        kind, rest = topics[topic], name.removeprefix(f"{topic}/")
        if kind == DIAGNOSTICS:
            told = value_at(kind, "status[0]")
            assert told.hardware_id == ""
            status, _, key = rest.partition("/")
            assert status == told.name
            (value,) = [pair.value for pair in told.values if pair.key == key]
            assert np.isfinite(float(value)), name
        else:
            assert isinstance(value_at(kind, rest.replace("/", ".")), float), name
    for splitter in root.iter("DockSplitter"):
        sizes = [float(x) for x in splitter.get("sizes", "").split(";")]
        assert len(splitter) == len(sizes) == int(splitter.get("count", "0"))
        assert sum(sizes) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("layout", [FOXGLOVE, PLOTJUGGLER], ids=lambda path: path.suffix)
def test_a_layout_moves_with_the_namespace(layout: Path) -> None:
    assert moved(layout, "") == layout
    copy = moved(layout, "/left/")
    text = copy.read_text(encoding="utf-8")
    assert '"/left/online_payload_estimator/' in text
    assert not re.search(r'"/(online_payload_estimator|adaptive_controller|robot_description)', text)
    assert len(text.splitlines()) == len(layout.read_text(encoding="utf-8").splitlines())


def views(name: str, **given: str) -> dict[str, Program]:
    file = LAUNCH_FILES[name]
    values = {a.name: a.default for a in file.arguments(CONFIG)} | given
    return {view.package: view for view in file.programs(values, CONFIG)}


def test_launch_arguments_open_the_layouts() -> None:
    assert views("online_payload_estimator.launch.py") == {}
    found = views(
        "online_payload_estimator.launch.py",
        rviz="true",
        plotjuggler="true",
        foxglove="true",
        urdf_path=str(URDF),
        namespace="left",
    )
    assert set(found) == {"rviz2", "plotjuggler", "foxglove_bridge"}
    assert found["rviz2"].namespace == "left"
    assert found["rviz2"].arguments == ["-d", str(RVIZ), "-f", root_link(URDF.read_text())]
    assert Path(found["plotjuggler"].arguments[1]).name == PLOTJUGGLER.name
    assert FOXGLOVE.name in found["foxglove_bridge"].note
    plain = views("online_payload_estimator.launch.py", rviz="true")["rviz2"]
    assert plain.arguments[-1] == "base_link"
    assert views("online_payload_estimator.launch.py", rviz="true", fixed_frame="map")["rviz2"].arguments[-1] == "map"


def test_only_the_simulated_arm_gets_a_robot_state_publisher() -> None:
    pytest.importorskip("pybullet_data", reason="PyBullet is not installed: pip install '.[sim]'")
    assert "robot_state_publisher" not in views("adaptive_controller.launch.py", rviz="true")
    for name, given in (("adaptive_controller.launch.py", {"simulated": "true"}), ("simulated_arm.launch.py", {})):
        found = views(name, rviz="true", **given)
        urdf = found["robot_state_publisher"].parameters["robot_description"]
        assert found["rviz2"].arguments[-1] == root_link(urdf)
    assert "robot_state_publisher" not in views("simulated_arm.launch.py", rviz="true", robot="quadruped")


def test_root_link_of_what_is_no_urdf_is_empty() -> None:
    assert root_link("") == root_link("<robot") == ""
    assert root_link(URDF.read_text()) != ""


@pytest.mark.parametrize("seed", range(4))
def test_the_region_holds_95_percent(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((3, 3)) * np.array([0.01, 0.003, 0.02])
    widths, axes = region_of(root @ root.T)
    points = rng.standard_normal((20_000, 3)) @ root.T
    inside = (((points @ axes) / (0.5 * widths)) ** 2).sum(axis=1) < 1.0
    assert inside.mean() == pytest.approx(0.95, abs=0.006)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_region_that_means_nothing_is_not_drawn() -> None:
    *_, region = markers_message(estimate(), stamp_of(1.0)).markers
    assert region.action == Marker.ADD
    wide = PayloadEstimate(**{**vars_of(estimate()), "covariance": np.eye(10) * 4.0})
    assert markers_message(wide, stamp_of(1.0)).markers[-1].action == Marker.DELETE
    assert {m.action for m in markers_message(estimate("no_payload"), stamp_of(1.0)).markers} == {Marker.DELETE}


def vars_of(e: PayloadEstimate) -> dict[str, Any]:
    return {name: getattr(e, name) for name in PayloadEstimate.__dataclass_fields__}


def test_the_frame_of_the_payload_is_at_its_centre_of_mass() -> None:
    message = transform_of(estimate(), stamp_of(3.0))
    assert (message.header.frame_id, message.child_frame_id) == ("flange", "flange_payload")
    t = message.transform.translation
    assert [t.x, t.y, t.z] == pytest.approx([0.03, -0.02, 0.1])
    assert message.transform.rotation.w == 1.0


def test_the_frame_is_published_on_tf_where_something_is_carried(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a stand-in for tf2_msgs, which is in ROS 2 and not among the wheels."""
    messages = types.ModuleType("tf2_msgs.msg")
    messages.TFMessage = type("TFMessage", (), {"__init__": lambda self, transforms: setattr(self, "transforms", transforms)})  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "tf2_msgs", types.ModuleType("tf2_msgs"))
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", messages)
    sent: list[Any] = []
    asked: list[str] = []

    def create(kind: Any, topic: str, depth: int) -> Any:
        asked.append(topic)
        return types.SimpleNamespace(publish=sent.append)

    frame = PayloadFrame(types.SimpleNamespace(create_lifecycle_publisher=create))
    frame.publish(estimate(), stamp_of(3.0))
    frame.publish(estimate("no_payload"), stamp_of(3.5))
    assert asked == ["/tf"]
    assert [message.transforms[0].child_frame_id for message in sent] == ["flange_payload"]


def test_a_frame_that_can_not_be_published_is_said(topics: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tf2_msgs", None)
    given = [Parameter("publish_tf", value=True), Parameter("urdf_path", value=str(URDF))]
    node = OnlinePayloadEstimator(namespace="framed", parameter_overrides=given)
    problem = node._problem
    node.destroy_node()
    assert "publish_tf needs tf2_msgs" in problem
    assert "apt install" in problem
