"""How many functions of the package one JointState passes through in the live node, and in how many files.

The node's real class is made in this process and its callback is called with messages of a simulated 7-joint arm at 1 kHz that
carries a payload; nothing is sent. Every message of two seconds, once the estimate is known, is counted with
``sys.setprofile``: calls of Python functions whose code lies in the package, comprehensions and generators included; compiled
functions are one call of the machine's, as those of numpy are, and do not count. Three kinds of message are told apart: those
that only go through the filters, those that give the estimator new rows, and those that also publish an estimate.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage, or rclpy is not installed.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import click
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

import sysid_ros
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation import ArmRecord, ArmScenario, simulate_arm

PACKAGE = f"{Path(sysid_ros.__file__).parent}{os.sep}"
KINDS = ("without an update", "with an update", "with update and publication")
KNOWN = 8.0
"""Time from which on messages are counted [s]: noise and payload are known, the payload has not just jumped."""

Calls = Counter[tuple[str, str]]
"""Number of calls by file and function."""


def calls_of(act: Callable[[], object]) -> Calls:
    """The package's functions that are called while ``act`` runs."""
    calls: Calls = Counter()

    def count(frame: FrameType, event: str, _: Any) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(PACKAGE):
            calls[frame.f_code.co_filename.removeprefix(PACKAGE), frame.f_code.co_qualname] += 1

    sys.setprofile(count)
    try:
        act()
    finally:
        sys.setprofile(None)
    return calls


def count_calls(duration: float = 10.0) -> dict[str, Calls]:
    """The costliest message of each kind, as the calls that it takes."""
    record = simulate_arm(ArmScenario(seed=1, duration=duration, payload_mass=1.5))
    worst: dict[str, Calls] = {kind: Counter() for kind in KINDS}
    for calls in _calls_of_messages(record):
        names = {name.rpartition(".")[2] for _, name in calls}
        kind = KINDS[2 if "inertia_message" in names else 1 if "update" in names else 0]
        if calls.total() > worst[kind].total():
            worst[kind] = calls
    return worst


def _calls_of_messages(record: ArmRecord) -> list[Calls]:
    import rclpy
    from rclpy.parameter import Parameter
    from sensor_msgs.msg import JointState

    from sysid_ros.nodes.messages import stamp_of
    from sysid_ros.nodes.online_payload_estimator import OnlinePayloadEstimator

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    measurements, names = record.measurements(), list(RobotModel.from_urdf(record.urdf).joint_names)
    rclpy.init(args=["--ros-args", "--log-level", "warn"])
    try:
        node = OnlinePayloadEstimator(parameter_overrides=[Parameter("joint_names", value=names)])
        node._on_description(_string(record.urdf))
        counted = []
        for m in measurements:
            assert m.v is not None
            message = JointState(name=names, position=m.q.tolist(), velocity=m.v.tolist(), effort=m.tau.tolist())
            message.header.stamp = stamp_of(1.0 + m.t)
            if m.t < KNOWN:
                node._on_joint_states(message)
            else:
                counted.append(calls_of(lambda message=message: node._on_joint_states(message)))  # type: ignore[misc]
        status = node.live.estimation.latest.status if node.live and node.live.estimation.latest else "none"
        if status != "ok":
            raise click.ClickException(f"the status of the estimate is {status}, not ok: this is not the usual way of a message.")
        node.destroy_node()
    finally:
        rclpy.try_shutdown()
    return counted


def _string(text: str) -> Any:
    from std_msgs.msg import String

    return String(data=text)


@click.command(help=__doc__.split("\n")[0])
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write the result for machines.")
def main(json_path: Path | None) -> None:
    try:
        import rclpy  # noqa: F401
    except ImportError:
        Console(stderr=True).print("rclpy is not installed, so there is no node to count in: pip install '.[ros]'.")
        sys.exit(2)
    worst = count_calls()
    console = Console(width=130)
    table = Table(title="Calls of the package's functions by one JointState", title_justify="left")
    for column in ("file", "function", *KINDS):
        table.add_column(column, justify="right" if column in KINDS else "left")
    for key in dict.fromkeys(key for calls in worst.values() for key in calls):
        table.add_row(*key, *(str(calls[key] or "") for calls in worst.values()))
    files = {kind: len({file for file, _ in calls}) for kind, calls in worst.items()}
    table.add_row("all", "", *(str(calls.total()) for calls in worst.values()), style="bold")
    table.add_row("files", "", *(str(count) for count in files.values()), style="bold")
    console.print(table)
    targets = [
        Target(f"calls {KINDS[0]}", worst[KINDS[0]].total(), low=1, high=20),
        Target(f"calls {KINDS[2]}", worst[KINDS[2]].total(), low=1, high=45),
        Target(f"files {KINDS[2]}", files[KINDS[2]], low=1, high=14),
    ]
    results = {kind: {f"{file}: {name}": n for (file, name), n in calls.items()} for kind, calls in worst.items()}
    sys.exit(conclude("call_count", targets, {"files": files, "calls": results}, json_path))


if __name__ == "__main__":
    main()
