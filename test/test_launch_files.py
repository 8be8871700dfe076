"""The launch files: what they start, in which namespace and with which parameters, and what they refuse."""

from __future__ import annotations

import importlib
import os
import re
import runpy
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
import yaml
from launch_stand_in import Context, Node, ParameterValue, standing_in

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")

os.environ["ROS_DOMAIN_ID"] = str(os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from geometry_msgs.msg import InertiaStamped
from rclpy.executors import SingleThreadedExecutor

from sysid_ros import __version__
from sysid_ros.control.control_settings import ControlSettings, SafetySettings
from sysid_ros.exceptions import SettingsError
from sysid_ros.nodes import argument_table, start
from sysid_ros.nodes.adaptive_controller import AdaptiveController
from sysid_ros.nodes.controller_settings import ControllerSettings
from sysid_ros.nodes.launch_plan import CONTROLLER, ESTIMATOR, LAUNCH_FILES, ROBOT, LaunchFile, NodePlan
from sysid_ros.nodes.messages import LATCHED
from sysid_ros.nodes.online_payload_estimator import OnlinePayloadEstimator
from sysid_ros.nodes.simulation_parameters import PARAMETERS
from sysid_ros.online_settings import Settings

ROOT = Path(__file__).resolve().parents[1]
CONFIG = ROOT / "config"
URDF = Path(__file__).parent / "data" / "small_arm.urdf"
CONTROL_GROUPS: tuple[type[Settings], ...] = (ControllerSettings, ControlSettings, SafetySettings)
ABSOLUTE = {"/diagnostics", "/rosout", "/parameter_events", "/clock"}
FILES = list(LAUNCH_FILES.values())
BOTH = LAUNCH_FILES["adaptive_controller.launch.py"]


def plans(file: LaunchFile, **given: str) -> dict[str, NodePlan]:
    values = {a.name: a.default for a in file.arguments(CONFIG)} | given
    return {plan.executable: plan for plan in file.plan(values, CONFIG)}


@pytest.fixture(scope="module")
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
    rclpy.init()
    yield
    rclpy.try_shutdown()


def test_the_table_of_the_arguments_is_that_of_the_settings() -> None:
    made_anew = "python -m sysid_ros.nodes.argument_table > config/launch_arguments.json"
    assert (CONFIG / "launch_arguments.json").read_text(encoding="utf-8") == argument_table.text(), made_anew


def test_launch_files_need_nothing_that_calculates() -> None:
    """'ros2 launch' runs in the interpreter of ROS, where the libraries of the nodes need not be."""
    code = (
        "import sys\n"
        "for name in ('numba', 'scipy', 'pinocchio', 'cvxpy', 'rosbags', 'click', 'rich', 'pybullet'): sys.modules[name] = None\n"
        "from pathlib import Path\n"
        "from sysid_ros.nodes.launch_plan import LAUNCH_FILES\n"
        f"config = Path({str(CONFIG)!r})\n"
        "for file in LAUNCH_FILES.values():\n"
        "    values = {a.name: a.default for a in file.arguments(config)} | {'rviz': 'true' if file.around else 'false'}\n"
        "    print(file.name, len(file.plan(values, config)), len(file.programs(values, config)))\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "ros2_control_arm.launch.py 2 4" in done.stdout


def test_a_plan_for_every_launch_file() -> None:
    assert set(LAUNCH_FILES) == {path.name for path in (ROOT / "launch").glob("*.launch.py")}


@pytest.mark.parametrize("kind", [OnlinePayloadEstimator, AdaptiveController])
def test_every_parameter_of_a_node_is_an_argument(ros: None, kind: Callable[..., Any]) -> None:
    node = kind(namespace=f"names_{kind.__name__}", cli_args=["--ros-args", "-p", "autostart:=false"])
    names = {name for name in node.list_parameters([], 10).names if not name.startswith("qos_overrides.")}
    own = node.get_name()
    node.destroy_node()
    assert len(names) > 15
    for file in FILES:
        if own in {n.executable for n in file.nodes}:
            assert names - {"start_type_description_service"} <= {a.name for a in file.arguments(CONFIG)}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_arguments_are_named_once_and_told(file: LaunchFile) -> None:
    arguments = file.arguments(CONFIG)
    assert len({a.name for a in arguments}) == len(arguments)
    assert all(a.description for a in arguments)
    parameters = {name for node in file.nodes for name in argument_table.table()[node.executable]}
    assert not parameters & {name for node in file.nodes for name in node.topics}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_namespace_simulated_time_and_topics_reach_every_node(file: LaunchFile) -> None:
    given = {"namespace": "left", "use_sim_time": "true", "joint_states": "states"}
    found = plans(file, **given, **({"simulated": "true"} if file.optional else {}))
    assert len(found) == (3 if file.optional else len(file.nodes))
    for plan in found.values():
        assert plan.namespace == "left"
        assert plan.parameters["use_sim_time"] is True
        assert plan.remappings["joint_states"] == "states"
        assert set(plan.remappings) <= {"joint_states", "effort_commands"}
        assert Path(plan.config).is_file()


def test_an_argument_goes_to_every_node_that_has_it() -> None:
    given = {
        "joint_names": "[b, a]",
        "gravity": "0, 0, 9.81",
        "loop_delay": "0.002",
        "effort_scale": "[2, 3]",
        "autostart": "True",
    }
    found = plans(BOTH, **given, urdf_path="/robot.urdf", frame_id="1.0")
    controller, estimator = found["adaptive_controller"].parameters, found["online_payload_estimator"].parameters
    shared = {"urdf_path": "/robot.urdf", "frame_id": "1.0", "joint_names": ["b", "a"], "gravity": [0.0, 0.0, 9.81]}
    assert controller == shared | {"loop_delay": 0.002, "autostart": True, "use_sim_time": False}
    assert estimator == shared | {"effort_scale": [2.0, 3.0], "use_sim_time": False}
    assert set(found) == {"adaptive_controller", "online_payload_estimator"}
    assert plans(BOTH, simulated="true", rate="250")["simulated_robot"].parameters == {
        "commanded": True,
        "rate": 250,
        "use_sim_time": False,
    }


def test_the_payload_topic_of_the_controller_can_be_moved() -> None:
    found = plans(BOTH, payload_committed="/elsewhere/payload", effort_commands="/effort_controller/commands")
    assert found["adaptive_controller"].remappings == {
        "online_payload_estimator/payload_committed": "/elsewhere/payload",
        "effort_commands": "/effort_controller/commands",
    }
    assert found["online_payload_estimator"].remappings == {}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"loop_delay": "fast"}, ("loop_delay:=fast", "a number such as")),
        ({"loop_delay": "nan"}, ("loop_delay:=nan", "a number such as")),
        ({"bandwidth": "0"}, ("bandwidth:=0", "0.1 to 500")),
        ({"law": "pid"}, ("law:=pid", "composite")),
        ({"gravity": "[0, 0, 99]"}, ("gravity:=[0, 0, 99]", "-30 to 30")),
        ({"joint_names": "[]"}, ("joint_names:=[]", "leave it out")),
        ({"use_sim_time": "perhaps"}, ("use_sim_time:=perhaps", "true or false")),
        ({"simulated": "2"}, ("simulated:=2", "true or false")),
        ({"config": "/nowhere.yaml"}, ("config:=/nowhere.yaml", "no such file")),
        ({"estimator_config": "/nowhere.yaml"}, ("estimator_config:=/nowhere.yaml", "no such file")),
        ({"simulated": "true", "rate": "many"}, ("rate:=many", "a number such as")),
        ({"simulated": "true", "rate": "0.5"}, ("rate:=0.5", "a whole number")),
    ],
)
def test_a_value_that_is_not_allowed_is_refused_before_a_node_starts(given: dict[str, str], words: Sequence[str]) -> None:
    with pytest.raises(SettingsError) as caught:
        plans(BOTH, **given)
    assert all(word in str(caught.value) for word in words)


def test_an_argument_that_is_not_understood_is_an_error() -> None:
    names = [a.name for a in BOTH.arguments(CONFIG)]
    command = ["/opt/ros/jazzy/bin/ros2", "launch", "sysid_ros", BOTH.name]
    BOTH.refuse_unknown([*command, "loop_delay:=0.002", "--debug"], names)
    with pytest.raises(SettingsError, match=r"has no argument 'loop_dealy'. Did you mean 'loop_delay'\?.*--show-args"):
        BOTH.refuse_unknown([*command, "loop_dealy:=0.002"], names)
    # another file that includes this one has arguments of its own
    BOTH.refuse_unknown(["ros2", "launch", "my_robot", "my_robot.launch.py", "speed:=3"], names)


def run_file(name: str, words: Sequence[str], monkeypatch: pytest.MonkeyPatch) -> list[Node]:
    """Actions that 'ros2 launch' would perform."""
    monkeypatch.setattr(sys, "argv", ["ros2", "launch", "sysid_ros", name, *words])
    given = dict(word.split(":=", 1) for word in words)
    with standing_in():
        context = Context(given)
        runpy.run_path(str(ROOT / "launch" / name))["generate_launch_description"]().run(context)
        return context.started


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_the_file_itself_starts_what_is_planned(file: LaunchFile, monkeypatch: pytest.MonkeyPatch) -> None:
    actions = run_file(file.name, ["namespace:=left", "frame_id:=true"], monkeypatch)
    expected = plans(file, namespace="left", frame_id="true")
    actions = [a for a in actions if a.given["package"] == "sysid_ros"]
    assert [a.given["executable"] for a in actions] == list(expected)
    for action, plan in zip(actions, expected.values(), strict=True):
        assert action.lifecycle == plan.lifecycle
        assert action.given["name"] == plan.executable
        assert action.given["namespace"] == "left"
        assert action.given["remappings"] == list(plan.remappings.items())
        config, parameters = action.given["parameters"]
        assert Path(config).resolve() == Path(plan.config).resolve()
        assert {k: v.value if isinstance(v, ParameterValue) else v for k, v in parameters.items()} == plan.parameters
        assert all(isinstance(v, ParameterValue) for k, v in parameters.items() if isinstance(plan.parameters[k], str))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_the_file_itself_refuses_what_it_does_not_know(file: LaunchFile, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SettingsError, match="has no argument 'speeed'"):
        run_file(file.name, ["speeed:=1"], monkeypatch)


@pytest.mark.parametrize("kind", [OnlinePayloadEstimator, AdaptiveController])
def test_in_a_namespace_every_topic_moves(ros: None, kind: Callable[..., Any]) -> None:
    executable = "online_payload_estimator" if kind is OnlinePayloadEstimator else "adaptive_controller"
    plan = plans(BOTH, namespace="left", urdf_path=str(URDF), autostart="false")[executable]
    node = kind(cli_args=plan.command_line())
    found = {
        t
        for ask in (node.get_publisher_names_and_types_by_node, node.get_subscriber_names_and_types_by_node)
        for t, _ in ask(node.get_name(), "/left")
    }
    assert node.get_namespace() == "/left"
    node.destroy_node()
    assert len(found - ABSOLUTE) >= 5
    assert not [topic for topic in found - ABSOLUTE if not topic.startswith("/left/")]


class Processes:
    """Nodes that run as the launch files start them, and an ear for what they say."""

    def __init__(self, log: Path) -> None:
        self.node = rclpy.create_node("ear")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.heard: dict[str, Any] = {}
        self.running: list[subprocess.Popen[str]] = []
        self.log = log

    def start(self, plan: NodePlan) -> None:
        code = f"import sys; from sysid_ros.nodes import start; sys.exit(start.{plan.executable}())"
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "ROS_LOG_DIR": str(self.log)}
        command = [sys.executable, "-c", code, *plan.command_line()]
        output = (self.log / f"{len(self.running)}.txt").open("w")
        self.running.append(
            subprocess.Popen(command, env=environment, stdout=output, stderr=output, text=True, start_new_session=True)
        )

    def listen(self, topic: str, kind: Any, profile: Any = 10) -> None:
        self.node.create_subscription(kind, topic, lambda message: self.heard.__setitem__(topic, message), profile)

    def until(self, condition: Callable[[], Any], seconds: float) -> None:
        end = time.monotonic() + seconds
        while not condition():
            said = "".join(path.read_text()[-2000:] for path in self.log.glob("*.txt"))
            numbers = {topic: m.inertia.m for topic, m in self.heard.items() if isinstance(m, InertiaStamped)}
            assert time.monotonic() < end, f"waited in vain; {numbers}; {said}"
            self.executor.spin_once(timeout_sec=0.05)

    def topics(self) -> set[str]:
        return {name for name, _ in self.node.get_topic_names_and_types()}

    def close(self) -> None:
        for process in self.running:
            process.terminate()
        for process in self.running:
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
        self.executor.shutdown()
        self.node.destroy_node()


@pytest.fixture
def processes(ros: None, tmp_path: Path) -> Iterator[Processes]:
    made = Processes(tmp_path)
    yield made
    made.close()


def test_the_simulated_robot_moves_with_its_namespace(processes: Processes) -> None:
    pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install '.[sim]'")
    processes.start(plans(BOTH, simulated="true", namespace="left", rate="100")["simulated_robot"])
    wanted = {"joint_states", "robot_description", "effort_commands", "simulated_robot/truth"}
    processes.until(lambda: {f"/left/{name}" for name in wanted} <= processes.topics(), 30.0)
    assert not {f"/{name}" for name in wanted} & processes.topics()


@pytest.mark.slow
def test_two_robots_in_two_namespaces_do_not_hear_each_other(processes: Processes) -> None:
    """At 250 Hz each estimator finds what its own robot carries; the controllers are there and send nothing."""
    pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install '.[sim]'")
    truth = {"left": 1.0, "right": 2.5}
    for side, mass in truth.items():
        given = {"namespace": side, "rate": "250", "payload_mass": str(mass), "pick_time": "30.0"}
        robot = plans(LAUNCH_FILES["simulated_arm.launch.py"], **given)
        idle = plans(BOTH, namespace=side, autostart="false")["adaptive_controller"]
        for plan in (*robot.values(), idle):
            processes.start(plan)
        processes.listen(f"/{side}/online_payload_estimator/payload", InertiaStamped)
        processes.listen(f"/{side}/simulated_robot/truth", InertiaStamped, LATCHED)

    def carried(side: str) -> float:
        message = processes.heard.get(f"/{side}/simulated_robot/truth")
        return float(message.inertia.m) if message is not None else 0.0

    processes.until(lambda: all(carried(side) == mass for side, mass in truth.items()), 120.0)

    def found(side: str) -> float:
        message = processes.heard.get(f"/{side}/online_payload_estimator/payload")
        return float(message.inertia.m) if message is not None else 0.0

    processes.until(lambda: all(abs(found(side) - mass) < 0.05 * mass for side, mass in truth.items()), 60.0)
    assert not {"/joint_states", "/online_payload_estimator/payload", "/effort_commands"} & processes.topics()


def flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in values.items():
        found |= flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name: value}
    return found


@pytest.mark.parametrize("node", [ESTIMATOR, CONTROLLER, ROBOT], ids=lambda node: node.executable)
def test_the_configuration_file_tells_every_parameter_with_its_default(node: Any) -> None:
    text = (CONFIG / f"{node.executable}.yaml").read_text(encoding="utf-8")
    stated = flat(yaml.safe_load(text)["/**"]["ros__parameters"])
    if node is ROBOT:
        defaults = {name: default for name, default, _ in PARAMETERS}
        texts = {name: text for name, _, text in PARAMETERS}
    else:
        found = {cls.prefix + f.name: (cls, f) for cls in argument_table.GROUPS[node.executable] for f in fields(cls)}
        defaults = {name: getattr(cls(), f.name) for name, (cls, f) in found.items()}
        texts = {name: f.metadata["description"] for name, (_, f) in found.items()}
    commented = set(re.findall(r"^ *# (\w+): ", text, re.MULTILINE)) & set(defaults)
    assert set(stated) | commented == set(defaults)
    assert {name: tuple(x) if isinstance(x, list) else x for name, x in stated.items()} == {
        name: tuple(x) if isinstance(x := defaults[name], list | tuple) else x for name in stated
    }
    lines = text.splitlines()
    for name, description in texts.items():
        (k,) = [i for i, line in enumerate(lines) if re.match(rf" *(# )?{name.rpartition('.')[2]}: ", line)][-1:]
        assert description in lines[k - 1], name


@pytest.mark.parametrize("name", ["online_payload_estimator", "adaptive_controller", "simulated_robot"])
@pytest.mark.parametrize("option", ["--help", "-h", "--version"])
def test_help_and_version_answer_and_start_nothing(
    name: str, option: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [name, option])
    monkeypatch.setattr(importlib, "import_module", lambda module: pytest.fail(f"{module} was imported"))
    assert getattr(start, name)() == 0
    said = capsys.readouterr().out
    assert (f"{name} (sysid_ros) {__version__}" in said) if option == "--version" else (f"config/{name}.yaml" in said)


def test_the_real_launch_refuses_and_starts(tmp_path: Path) -> None:
    """With ``ros2 launch`` itself, where it is installed."""
    pytest.importorskip("launch.actions", reason="launch is not installed: it comes with ROS 2, not from PyPI")
    pytest.importorskip("ros2launch", reason="ros2launch is not installed: it comes with ROS 2")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    path = str(ROOT / "launch" / "online_payload_estimator.launch.py")
    done = subprocess.run(
        ["ros2", "launch", path, "speeed:=1"], env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode != 0
    assert "has no argument 'speeed'" in done.stdout + done.stderr
    told = subprocess.run(
        ["ros2", "launch", path, "--show-args"], env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert "'max_gap'" in told.stdout
