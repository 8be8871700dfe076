"""Latency, loss and processor load of the real node: an arm at 1 kHz, or a quadruped with IMU and contacts at 500 Hz.

This process publishes the joint states of a moving 7-joint arm, or what a simulated 12-joint quadruped with a payload measured
while its trunk sways, recorded before the measurement begins. Their stamp is the time at which they are filled in, a few
hundredths of a millisecond before they are published. The node runs in a process of its own, as ``ros2 run`` does it. All figures
are the node's: messages received and the time from the stamp to the moment after the step stand in its diagnostics, its processor
time in /proc. Exit code 1 if a target is missed.

Example: python benchmarks/node_latency.py --seconds 60 --json node_latency.json
         python benchmarks/node_latency.py --robot quadruped --rate 500
"""

from __future__ import annotations

import argparse
import array
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(os.getpid() % 100))
os.environ.setdefault("ROS_LOG_DIR", tempfile.mkdtemp(prefix="node_latency_"))

import numpy as np  # noqa: E402
import pybullet_data  # noqa: E402
import rclpy  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.progress import Progress  # noqa: E402
from rich.table import Table  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402

from sysid_ros.robot.robot_model import RobotModel  # noqa: E402

URDF = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
DISCOVERY = 60.0
MAX_LATENCY_MS = 0.6
MAX_CPU = 70.0


class Arm:
    """A sinusoidal motion of all joints, known at any time, so that positions fit the stamps however late a message is."""

    def __init__(self) -> None:
        self.urdf = URDF.read_text()
        self._robot = robot = RobotModel.from_urdf(self.urdf)
        self.joint_names = robot.joint_names
        self._start = time.time_ns()
        self._w = 2.0 * np.pi / 10.0 * (np.arange(robot.n) + 2.0)
        self._noise = 0.1 * np.random.default_rng(0).standard_normal((4096, robot.n))
        self._k, self.playing = 0, True

    def attach(self, node: Node) -> None:
        """Nothing but joint states is published."""

    def fill(self, message: JointState, now: int) -> None:
        """Position, velocity and effort at ``now`` [ns]."""
        w, phase = self._w, self._w * 1e-9 * (now - self._start)
        q = 0.5 * np.sin(phase)
        v = 0.5 * w * np.cos(phase)
        self._k = (self._k + 1) % len(self._noise)
        tau = self._robot.rnea(q, v, -w * w * q) + self._noise[self._k]
        message.position, message.velocity, message.effort = (array.array("d", x.tobytes()) for x in (q, v, tau))


class Quadruped:
    """A recorded sway of the simulated quadruped, played a message at a time once the measurement has begun."""

    def __init__(self, seconds: float, rate: int) -> None:
        from sysid_ros.simulation.quadruped_record import simulate_quadruped
        from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario

        scenario = QuadrupedScenario(duration=seconds + 1.0, rate=rate, gait="sway", payload_mass=2.0)
        record = simulate_quadruped(scenario, start_time=1000.0)
        self.urdf, self.joint_names = record.urdf, tuple(record.truth["joint_names"])
        self._states, self._k, self.playing = record.measured, 0, False

    def attach(self, node: Node) -> None:
        """IMU and contacts are published by this node too."""
        from sysid_ros.nodes.simulated_robot import TrunkOutputs

        self._trunk = TrunkOutputs(node)

    def fill(self, message: JointState, now: int) -> None:
        """The next state; IMU and contacts of the same instant are published before."""
        state = self._states[min(self._k, len(self._states) - 1)]
        self._k += self.playing
        self._trunk.publish(state, message.header.stamp)
        message.position, message.velocity, message.effort = (
            array.array("d", x.tobytes()) for x in (state.q, state.v, state.tau)
        )


@contextmanager
def running_node(executor: str, urdf: Path) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", "sysid_ros.nodes.online_payload_estimator", "--ros-args", "-p", f"urdf_path:={urdf}"]
    if executor:
        command += ["-p", f"executor:={executor}"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    process = subprocess.Popen(command, cwd=ROOT, env=environment, start_new_session=True)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def processor_seconds(pid: int) -> float:
    """User and system time of a process so far [s]."""
    after_name = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(after_name[11]) + int(after_name[12])) / os.sysconf("SC_CLK_TCK")


class Bench:
    """Publishes joint states and listens to the node's diagnostics."""

    def __init__(self, robot: Arm | Quadruped, rate: int) -> None:
        self.node = rclpy.create_node("node_latency")
        self.publisher = self.node.create_publisher(JointState, "joint_states", 10)
        self.subscription = self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.rate = rate
        self.values: dict[str, dict[str, str]] = {}
        self.reports = 0
        self._robot = robot
        robot.attach(self.node)
        self._message = JointState(name=list(robot.joint_names))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.values[status.name.split(": ")[-1]] = {pair.key: pair.value for pair in status.values}
        self.reports += 1

    def received(self) -> int:
        return int(self.values.get("input", {}).get("received", 0))

    def next_report(self, timeout: float = 5.0) -> None:
        wanted, end = self.reports + 1, time.monotonic() + timeout
        while self.reports < wanted and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.1)
        if self.reports < wanted:
            raise SystemExit("The node publishes no diagnostics.")

    def publish(self, seconds: float, progress: Any = None) -> int:
        """Publish in real time; returns how many messages."""
        count, start = round(seconds * self.rate), time.monotonic() + 0.05
        message, stamp = self._message, self._message.header.stamp
        for k in range(count):
            ahead = start + k / self.rate - time.monotonic()
            # overdue messages are made up for, but not at once: no robot's stamps stand so close together
            time.sleep(ahead if ahead > 0.0 else 0.3 / self.rate)
            now = time.time_ns()
            stamp.sec, stamp.nanosec = divmod(now, 1_000_000_000)
            self._robot.fill(message, now)
            self.publisher.publish(message)
            if k % 200 == 0:
                self.executor.spin_once(timeout_sec=0.0)
                if progress is not None:
                    progress(k / count)
        return count


def measure(robot: Arm | Quadruped, seconds: float, rate: int, executor: str) -> dict[str, Any]:
    rclpy.init()
    urdf = Path(os.environ["ROS_LOG_DIR"]) / "robot.urdf"
    urdf.write_text(robot.urdf)
    bench = Bench(robot, rate)
    progress = Progress(transient=True, disable=not sys.stderr.isatty(), console=Console(stderr=True))
    with running_node(executor, urdf) as process, progress as bar:
        end = time.monotonic() + DISCOVERY
        while bench.received() == 0:
            if process.poll() is not None or time.monotonic() > end:
                raise SystemExit("The node has not received a message. See its output above.")
            bench.publish(0.3)
            bench.next_report(DISCOVERY)
        bench.next_report()
        before = bench.received()
        task = bar.add_task(f"{rate} Hz", total=1.0)
        robot.playing = True
        cpu, start = processor_seconds(process.pid), time.monotonic()
        sent = bench.publish(seconds, lambda part: bar.update(task, completed=part))
        elapsed = time.monotonic() - start
        cpu = processor_seconds(process.pid) - cpu
        bench.next_report()
        bench.next_report()
        timing, state = bench.values["timing"], bench.values["estimator"]
        received = bench.received() - before
    bench.node.destroy_node()
    rclpy.try_shutdown()
    return {
        "seconds": elapsed,
        "rate_hz": sent / elapsed,
        "joints": len(robot.joint_names),
        "executor": executor or "default",
        "sent": sent,
        "received": received,
        "lost": sent - received,
        "latency_p50_ms": float(timing["latency_p50_since_start_ms"]),
        "latency_p99_ms": float(timing["latency_p99_since_start_ms"]),
        "cpu_percent": 100.0 * cpu / elapsed,
        "estimates": int(timing["published"]),
        "status": state["status"],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="length of the measurement (60)")
    parser.add_argument("--robot", choices=("arm", "quadruped"), default="arm", help="whose messages (arm)")
    parser.add_argument("--rate", type=int, help="messages a second (1000; quadruped 500)")
    parser.add_argument("--executor", choices=("single", "events"), default="", help="the node's parameter 'executor'")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    rate = arguments.rate or (1000 if arguments.robot == "arm" else 500)
    robot = Arm() if arguments.robot == "arm" else Quadruped(arguments.seconds, rate)
    result = measure(robot, arguments.seconds, rate, arguments.executor)
    least_rate = 0.98 * rate
    p50, cpu = result["latency_p50_ms"], result["cpu_percent"]
    rows = (
        ("messages lost", f"{result['lost']} of {result['sent']}", "0", result["lost"] == 0),
        ("publish to update, p50", f"{p50:.3f} ms", f"< {MAX_LATENCY_MS} ms", p50 < MAX_LATENCY_MS),
        ("publish to update, p99", f"{result['latency_p99_ms']:.3f} ms", "", True),
        ("processor, of one core", f"{cpu:.1f} %", f"< {MAX_CPU:.0f} %", cpu < MAX_CPU),
        ("rate", f"{result['rate_hz']:.1f} Hz", f"> {least_rate:.0f} Hz", result["rate_hz"] > least_rate),
        ("estimates", f"{result['estimates']} ({result['status']})", "", True),
    )
    title = f"{result['joints']} joints, {result['seconds']:.0f} s, executor {result['executor']}"
    table = Table(title=f"online_payload_estimator: {title}", min_width=70)
    for column in ("", "measured", "target", ""):
        table.add_column(column)
    for name, value, target, good in rows:
        table.add_row(name, value, target, ("yes" if good else "NO") if target else "")
    Console().print(table)
    result["passed"] = all(good for *_, good in rows)
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(result, indent=2) + "\n")
    return 0 if result["passed"] else 1


if __name__ == "__main__":
    raise SystemExit(main())
