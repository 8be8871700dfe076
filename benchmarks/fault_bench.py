"""FaultBench: three nodes, an arm that moves, and what can go wrong; for ``controller_faults.py``."""

from __future__ import annotations

import array
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped, Vector3
from lifecycle_msgs.srv import ChangeState
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.description import HOME, arm_description

RATE, WATCHED = 500, 2.0
_LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_NODE = "import sys; from sysid_ros.nodes.start import {0}; sys.exit({0}())"
_DEACTIVATE, _CLEANUP, _CONFIGURE, _ACTIVATE = 4, 2, 1, 3


class Fault(NamedTuple):
    """What goes wrong: its name, a word of those that must name it, whether the motion goes on, and whether the node ends."""

    name: str
    words: tuple[str, ...]
    goes_on: bool = False
    ends: bool = False


FAULTS = (
    Fault("SIGINT", ("no command",), ends=True),
    Fault("SIGTERM", ("no command",), ends=True),
    Fault("SIGKILL", ("no command",), ends=True),
    Fault("deactivate", ("inactive", "no command")),
    Fault("states stop", ("no usable joint states", "no joint state")),
    Fault("states 0.5 s late", ("no usable joint states", "no joint state", "too late")),
    Fault("states NaN", ("nan",)),
    Fault("efforts NaN", (), goes_on=True),
    Fault("no efforts", (), goes_on=True),
    Fault("one wild stamp", (), goes_on=True),
    Fault("stamps an hour back", ("no joint state", "jumped", "restart")),
    Fault("a third of the states lost", (), goes_on=True),
    Fault("false payload", ("is not what the arm carries",), goes_on=True),
    Fault("impossible payload", ("no body that can exist",), goes_on=True),
    Fault("unknown payload picked", (), goes_on=True),
    Fault(
        "contact",
        ("external_force", "something changed", "what was told explain", "change at", "pick at", "from where it should be"),
        goes_on=True,
    ),
    Fault("wild trajectory", ("refused",), goes_on=True),
    Fault("estimator killed", (), goes_on=True),
)


class Outcome(NamedTuple):
    """Of a run: see ``controller_faults.py``."""

    fault: str
    executor: str
    at: float
    moved: float
    faster: float
    settled: bool
    reached: bool
    named: bool
    limit_passed: bool
    stacks: int
    said: str


class FaultBench:
    """The nodes as processes, and this process between the arm's states and the controller; within ``with``.

    Attributes:
        states: topic that the controller hears its joint states on. mass: of the payload [kg]. payload_from: of the controller.

    Args:
        executor: of the controller. rng: draws motions and moments. namespace: of all nodes. rate: of the joint states [Hz].
        delay: ``loop_delay`` [s].
    """

    states, mass, payload_from = "relayed", 1.0, "committed"

    def __init__(
        self, executor: str, rng: np.random.Generator, namespace: str = "", rate: int = RATE, delay: float = 0.006
    ) -> None:
        self._executor_name, self._rng = executor, rng
        self._namespace, self._rate, self._delay = namespace, rate, delay
        self._folder = Path(tempfile.mkdtemp(prefix="faults_"))
        (self._folder / "arm.urdf").write_text(arm_description())
        self.robot = RobotModel.from_urdf(arm_description())
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._spoil: Callable[[JointState], JointState | None] = lambda message: message
        self._seen: list[tuple[float, FloatArray, FloatArray]] = []
        self._away: list[float] = []
        self._efforts: list[FloatArray] = []
        self._wanted: FloatArray | None = None
        self._said: set[str] = set()
        self._logged: dict[Path, int] = {}
        self._late: list[tuple[float, JointState]] = []

    def __enter__(self) -> Self:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self.node = node = rclpy.create_node("fault_bench", namespace=self._namespace)
        self._ros = SingleThreadedExecutor()
        self._ros.add_node(node)
        self._relay = node.create_publisher(JointState, "relayed", 1)
        self._motions = node.create_publisher(JointTrajectory, "adaptive_controller/joint_trajectory", 1)
        self._payloads = node.create_publisher(InertiaStamped, "online_payload_estimator/payload_committed", _LATCHED)
        self._push = node.create_publisher(Vector3, "simulated_robot/push", 10)
        self._pick: Any = node.create_client(Trigger, "simulated_robot/pick")
        best = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._kept = (
            node.create_subscription(JointState, "joint_states", self._on_states, 10),
            node.create_subscription(Float64MultiArray, "effort_commands", lambda m: self._efforts.append(np.array(m.data)), 10),
            node.create_subscription(JointState, "adaptive_controller/reference", self._on_reference, best),
            node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10),
        )
        return self

    def __exit__(self, *_: object) -> None:
        for name in list(self._processes):
            self._end(name, signal.SIGINT)
        self._ros.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()

    def run(self, fault: Fault) -> Outcome:
        """One motion with one fault."""
        self._prepare()
        goal = np.array(HOME) + self._rng.uniform(-0.5, 0.5, self.robot.n)
        duration = max(1.2, 2.2 * float(np.abs(goal - self._seen[-1][1]).max()))
        self._begin_motion(goal, duration)
        at = float(self._rng.uniform(0.15, 0.85)) * duration
        self._spin(at)
        self._said.clear()
        self._logged = {path: path.stat().st_size for path in self._folder.glob("*.log")}
        begin = len(self._seen)
        self._inject(fault)
        if fault.name == "contact":  # what the force itself moves is not the controller's doing
            begin = len(self._seen)
        self._spin(max(WATCHED, duration - at + 0.5 if fault.goes_on else 0.0))
        outcome = self._judge(fault, at, begin, goal)
        self._recover()
        return outcome

    def _judge(self, fault: Fault, at: float, begin: int, goal: FloatArray) -> Outcome:
        q = np.array([seen[1] for seen in self._seen[begin:]])
        v = np.array([seen[2] for seen in self._seen[begin:]])
        before = np.abs(v[0])
        efforts = np.array(self._efforts[-2000:]).reshape(-1, self.robot.n)
        passed = bool(np.any(np.abs(efforts) > self.robot.effort_limit + 1e-6) or np.any(np.abs(v) > self.robot.velocity_limit))
        if fault.goes_on:
            moved = float(np.max(self._away[begin:])) - (self._away[begin] if fault.name == "contact" else 0.0)
            faster = 0.0
        else:
            moved = float(np.abs(q - q[0]).max())
            faster = float((np.abs(v) - before).max())
        settled, reached = bool(np.abs(v[-1]).max() < 0.05), bool(np.abs(q[-1] - goal).max() < 0.05)
        words = " ".join(self._said).lower() + self._output().lower()
        named = not fault.words or any(word in words for word in fault.words)
        told = next((said for said in self._said if any(w in said.lower() for w in fault.words)), "")
        stacks = self._output().count("Traceback")
        return Outcome(fault.name, self._executor_name, at, moved, faster, settled, reached, named, passed, stacks, told)

    def _inject(self, fault: Fault) -> None:
        name, process = fault.name, self._processes["adaptive_controller"]
        signals = {"SIGINT": signal.SIGINT, "SIGTERM": signal.SIGTERM, "SIGKILL": signal.SIGKILL}
        if name in signals:
            process.send_signal(signals[name])
        elif name == "deactivate":
            self._change(_DEACTIVATE, wait=False)
        elif name == "estimator killed":
            self._processes["online_payload_estimator"].kill()
        elif name == "unknown payload picked":
            self._pick.call_async(Trigger.Request())
        elif name in ("false payload", "impossible payload"):
            self._tell(4.0, 0.02 if name == "false payload" else -0.02)
        elif name == "contact":
            force = self._rng.normal(size=3)
            force *= self._rng.uniform(10.0, 40.0) / np.linalg.norm(force)
            self._push.publish(Vector3(x=force[0], y=force[1], z=force[2]))
            self._spin(float(self._rng.uniform(0.1, 0.5)))
            self._push.publish(Vector3())
        elif name == "wild trajectory":
            wild = self._rng.choice(["far", "nan", "fast"])
            q = self._seen[-1][1] + {"far": 5.0, "nan": np.nan, "fast": 0.5}[wild]
            self._send(q, 0.01 if wild == "fast" else 1.0)
        else:
            self._spoil = getattr(self, "_" + name.replace(" ", "_").replace(".", "_"))

    def _states_stop(self, message: JointState) -> JointState | None:
        return None

    def _states_0_5_s_late(self, message: JointState) -> JointState | None:
        self._late.append((time.monotonic() + 0.5, message))
        if self._late[0][0] > time.monotonic():
            return None
        return self._late.pop(0)[1]

    def _states_NaN(self, message: JointState) -> JointState | None:
        message.position[int(self._rng.integers(self.robot.n))] = float("nan")
        return message

    def _efforts_NaN(self, message: JointState) -> JointState | None:
        message.effort = array.array("d", [float("nan")] * self.robot.n)
        return message

    def _no_efforts(self, message: JointState) -> JointState | None:
        message.effort = array.array("d")
        return message

    def _one_wild_stamp(self, message: JointState) -> JointState | None:
        message.header.stamp.sec += int(self._rng.choice([1_000_000, -3600]))
        self._spoil = lambda later: later
        return message

    def _stamps_an_hour_back(self, message: JointState) -> JointState | None:
        message.header.stamp.sec -= 3600
        return message

    def _a_third_of_the_states_lost(self, message: JointState) -> JointState | None:
        return message if self._rng.random() > 1.0 / 3.0 else None

    def _on_states(self, message: JointState) -> None:
        q = np.array(message.position)
        self._seen.append((time.monotonic(), q, np.array(message.velocity)))
        self._away.append(0.0 if self._wanted is None else float(np.abs(q - self._wanted).max()))
        if (passed := self._spoil(message)) is not None:
            self._relay.publish(passed)

    def _on_reference(self, message: JointState) -> None:
        self._wanted = np.array(message.position)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self._said |= {status.message for status in message.status}

    def _tell(self, mass: float, inertia: float) -> None:
        message = InertiaStamped()
        message.header.frame_id = self.robot.flange
        message.inertia.m, message.inertia.com.z = mass, 0.1
        message.inertia.ixx = message.inertia.iyy = message.inertia.izz = inertia
        self._payloads.publish(message)

    def _send(self, q: FloatArray, duration: float) -> None:
        message = JointTrajectory(joint_names=list(self.robot.joint_names))
        point = JointTrajectoryPoint(positions=[float(x) for x in q])
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(1e9 * duration), 10**9)
        message.points.append(point)
        self._motions.publish(message)

    def _begin_motion(self, goal: FloatArray, duration: float) -> None:
        """Send a motion until the controller follows it: one that comes before its subscription is known is lost."""
        for _ in range(20):
            self._send(goal, duration)
            start = self._wanted
            self._spin(0.1)
            if start is not None and self._wanted is not None and np.any(self._wanted != start):
                return
        raise TimeoutError("the controller does not follow a motion: " + " ".join(self._said))

    def _prepare(self) -> None:
        """All three nodes run, the arm is held and empty, and no fault is left."""
        self._spoil, self._late = lambda message: message, []
        payload = f"-p payload_mass:={float(self.mass)}"
        self._start("simulated_robot", f"-p commanded:=true -p pick_time:=-1.0 {payload}", self._rate)
        urdf = f"-p urdf_path:={self._folder}/arm.urdf"
        self._start("online_payload_estimator", urdf)
        delay = f"-p loop_delay:={self._delay} -p executor:={self._executor_name} -p payload_from:={self.payload_from}"
        delay += f" -r joint_states:={self.states}"
        self._start("adaptive_controller", f"-p autostart:=true {urdf} {delay}")
        self._wanted = None
        self._until(lambda: self._wanted is not None, "the controller's first reference")
        self._spin(1.0)
        self._efforts.clear()

    def _recover(self) -> None:
        """Back to an arm that is held and carries nothing."""
        self._spoil, self._late = lambda message: message, []
        self._end("adaptive_controller", signal.SIGINT)
        self._call("simulated_robot/drop")
        self._spin(0.3)

    def _start(self, name: str, arguments: str, rate: int | None = None) -> None:
        process = self._processes.get(name)
        if process is not None and process.poll() is None:
            return
        command = [sys.executable, "-c", _NODE.format(name), "--ros-args", "-r", f"__ns:=/{self._namespace}", *arguments.split()]
        command += ["-p", f"rate:={rate}"] if rate else []
        with (self._folder / f"{name}.log").open("wb") as log:
            self._processes[name] = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=os.environ.copy())
        if name == "simulated_robot":
            self._until(lambda: bool(self._seen), "the first joint state")

    def _end(self, name: str, number: signal.Signals) -> None:
        process = self._processes.pop(name)
        if process.poll() is None:
            process.send_signal(number)
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()

    def _output(self) -> str:
        """What the nodes have printed since the fault began."""
        texts = []
        for path in sorted(self._folder.glob("*.log")):
            said, before = path.read_bytes(), self._logged.get(path, 0)
            texts.append(said[before if before <= len(said) else 0 :].decode(errors="replace"))
        return "\n".join(texts)

    def _call(self, service: str) -> None:
        client: Any = self.node.create_client(Trigger, service)
        if client.wait_for_service(timeout_sec=5.0):
            self._ros.spin_until_future_complete(client.call_async(Trigger.Request()), timeout_sec=5.0)
        self.node.destroy_client(client)

    def _change(self, transition: int, wait: bool) -> None:
        client: Any = self.node.create_client(ChangeState, "adaptive_controller/change_state")
        client.wait_for_service(timeout_sec=5.0)
        request = ChangeState.Request()
        request.transition.id = transition
        future = client.call_async(request)
        if wait:
            self._ros.spin_until_future_complete(future, timeout_sec=5.0)

    def _until(self, condition: Callable[[], bool], what: str) -> None:
        end = time.monotonic() + 90.0
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(f"Waited in vain for {what}.\n{self._output()}")
            self._ros.spin_once(timeout_sec=0.02)

    def _spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._ros.spin_once(timeout_sec=0.01)
