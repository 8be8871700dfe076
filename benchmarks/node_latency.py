"""Latency, loss and processor load of the real node at 1 kHz.

This process publishes the joint states of a moving 7-joint arm. Their stamp is the time at which they are filled in, a few
hundredths of a millisecond before they are published. The node runs in a process of its own, as ``ros2 run`` does it. All figures
are the node's: messages received and the time from the stamp to the moment after the step stand in its diagnostics, its processor
time in /proc. Exit code 1 if a target is missed.

Example: python benchmarks/node_latency.py --seconds 60 --json node_latency.json
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
from rich.console import Console  # noqa: E402
from rich.progress import Progress  # noqa: E402
from rich.table import Table  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402

from sysid_ros.robot_model import RobotModel  # noqa: E402

URDF = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
DISCOVERY = 60.0
MAX_LATENCY_MS = 0.6
MAX_CPU = 70.0


class Motion:
    """A sinusoidal motion of all joints, known at any time, so that positions fit the stamps however late a message is."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._w = 2.0 * np.pi / 10.0 * (np.arange(robot.n) + 2.0)
        self._noise = 0.1 * np.random.default_rng(0).standard_normal((4096, robot.n))
        self._k = 0

    def fill(self, message: JointState, t: float) -> None:
        """Position, velocity and effort at ``t`` [s]."""
        w, phase = self._w, self._w * t
        q = 0.5 * np.sin(phase)
        v = 0.5 * w * np.cos(phase)
        self._k = (self._k + 1) % len(self._noise)
        tau = self._robot.rnea(q, v, -w * w * q) + self._noise[self._k]
        message.position, message.velocity, message.effort = (array.array("d", x.tobytes()) for x in (q, v, tau))


@contextmanager
def running_node(executor: str) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", "sysid_ros.nodes.online_payload_estimator", "--ros-args", "-p", f"urdf_path:={URDF}"]
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

    def __init__(self, robot: RobotModel, rate: int) -> None:
        self.node = rclpy.create_node("node_latency")
        self.publisher = self.node.create_publisher(JointState, "joint_states", 10)
        self.subscription = self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.rate = rate
        self.values: dict[str, dict[str, str]] = {}
        self.reports = 0
        self._motion = Motion(robot)
        self._start = time.time_ns()
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
            self._motion.fill(message, 1e-9 * (now - self._start))
            stamp.sec, stamp.nanosec = divmod(now, 1_000_000_000)
            self.publisher.publish(message)
            if k % 200 == 0:
                self.executor.spin_once(timeout_sec=0.0)
                if progress is not None:
                    progress(k / count)
        return count


def measure(seconds: float, rate: int, executor: str) -> dict[str, Any]:
    robot = RobotModel.from_urdf(URDF.read_text())
    rclpy.init()
    bench = Bench(robot, rate)
    progress = Progress(transient=True, disable=not sys.stderr.isatty(), console=Console(stderr=True))
    with running_node(executor) as process, progress as bar:
        end = time.monotonic() + DISCOVERY
        while bench.received() == 0:
            if process.poll() is not None or time.monotonic() > end:
                raise SystemExit("The node has not received a message. See its output above.")
            bench.publish(0.3)
            bench.next_report(DISCOVERY)
        bench.next_report()
        before = bench.received()
        task = bar.add_task(f"{rate} Hz", total=1.0)
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
        "joints": robot.n,
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
    parser.add_argument("--rate", type=int, default=1000, help="messages a second (1000)")
    parser.add_argument("--executor", choices=("single", "events"), default="", help="the node's parameter 'executor'")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    result = measure(arguments.seconds, arguments.rate, arguments.executor)
    least_rate = 0.98 * arguments.rate
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
