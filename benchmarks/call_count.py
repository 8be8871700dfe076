"""How many functions of the package one JointState passes through in the live node, and in how many files.

The node's real class is made in this process and its callback is called with messages of a simulated 7-joint arm at 1 kHz that
carries a payload. Every message of two seconds, once the estimate is known, is counted with ``sys.setprofile``: Python functions
whose code lies in the package, comprehensions included. What numba compiled is one call of machine code, as those of numpy are;
it shows in the profile too and is counted apart. Three kinds of message are told apart: those that only go through the filters,
those that give the estimator new rows, and those that also publish an estimate. The usual message is the median one; now and then
a check that runs on few samples, such as that of gravity at 20 Hz, comes on top.

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
from numba.core.dispatcher import Dispatcher
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


def compiled_functions() -> set[tuple[str, str]]:
    """File and name of the package's functions that numba compiles."""
    found = set()
    for module in [m for name, m in sys.modules.items() if name.startswith("sysid_ros.")]:
        for value in vars(module).values():
            if isinstance(value, Dispatcher):
                code = value.py_func.__code__
                found.add((code.co_filename.removeprefix(PACKAGE), code.co_qualname))
    return found


def usual_messages(duration: float = 10.0) -> dict[str, tuple[Calls, Calls]]:
    """Of each kind: the median message, and the costliest, as the calls that they take."""
    record = simulate_arm(ArmScenario(seed=1, duration=duration, payload_mass=1.5))
    kinds: dict[str, list[Calls]] = {kind: [] for kind in KINDS}
    for calls in _calls_of_messages(record):
        names = {name for _, name in calls}
        kind = KINDS[2 if "Outputs.publish" in names else 1 if "OnlineEstimation._take" in names else 0]
        kinds[kind].append(calls)
    ordered = {kind: sorted(found, key=Counter.total) for kind, found in kinds.items()}
    return {kind: (found[len(found) // 2], found[-1]) for kind, found in ordered.items()}


def _calls_of_messages(record: ArmRecord) -> list[Calls]:
    import rclpy
    from rclpy.parameter import Parameter
    from sensor_msgs.msg import JointState

    from sysid_ros.nodes.messages import record_of, stamp_of
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
                node._on_joint_states(message, record_of)
            else:
                counted.append(calls_of(lambda message=message: node._on_joint_states(message, record_of)))  # type: ignore[misc]
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
    messages = usual_messages()
    compiled = compiled_functions()
    usual = {kind: median for kind, (median, _) in messages.items()}
    python = {kind: {key: n for key, n in calls.items() if key not in compiled} for kind, calls in usual.items()}
    console = Console(width=130)
    table = Table(title="Calls of the package's functions by one JointState, the usual one of its kind", title_justify="left")
    for column in ("file", "function", *KINDS):
        table.add_column(column, justify="right" if column in KINDS else "left", overflow="fold")
    for file, name in dict.fromkeys(key for calls in usual.values() for key in calls):
        shown = f"{name} (compiled)" if (file, name) in compiled else name
        table.add_row(file, shown, *(str(calls[file, name] or "") for calls in usual.values()))
    counts = {kind: sum(calls.values()) for kind, calls in python.items()}
    files = {kind: len({file for file, _ in calls}) for kind, calls in python.items()}
    with_compiled = {kind: calls.total() for kind, calls in usual.items()}
    most = {kind: calls.total() for kind, (_, calls) in messages.items()}
    for what, row in (("Python calls", counts), ("files", files), ("with compiled calls", with_compiled), ("the most", most)):
        table.add_row(what, "", *(str(n) for n in row.values()), style="bold")
    console.print(table)
    targets = [
        Target(f"Python calls {KINDS[0]}", counts[KINDS[0]], low=1, high=20),
        Target(f"Python calls {KINDS[2]}", counts[KINDS[2]], low=1, high=45),
        Target(f"files {KINDS[2]}", files[KINDS[2]], low=1, high=14),
    ]
    results = {
        "calls": counts,
        "files": files,
        "with_compiled": with_compiled,
        "most": most,
        "functions": {kind: {f"{file}: {name}": n for (file, name), n in calls.items()} for kind, calls in usual.items()},
    }
    sys.exit(conclude("call_count", targets, results, json_path))


if __name__ == "__main__":
    main()
