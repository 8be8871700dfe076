"""``make demo``: a simulated robot and the estimator as two ROS 2 processes, estimate against truth in the terminal, a plot."""

from __future__ import annotations

import importlib.util
import os
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console

from sysid_ros.cli.demo_display import Display, Picture, comparison_table
from sysid_ros.cli.demo_processes import DemoProcess, ProcessFailed, ros_arguments
from sysid_ros.cli.demo_verdict import CRITERION, compare, objections
from sysid_ros.exceptions import SysidError
from sysid_ros.payload_estimate import PayloadEvent
from sysid_ros.plots import TruthSegment, write_payload_plot

if TYPE_CHECKING:
    from sysid_ros.nodes.demo_monitor import DemoMonitor, Listener

ROBOT_MODULE = "sysid_ros.nodes.simulated_robot"
ESTIMATOR_MODULE = "sysid_ros.nodes.online_payload_estimator"
_PICK, _DROP = 0.3, 0.75
_PATIENCE = 25.0
_PICTURE_PERIOD = 0.1
_INTERRUPTED = 130
_TERMINATED = 143


@click.command(context_settings={"help_option_names": ["-h", "--help"]}, epilog=f"The demo's question: {CRITERION}")
@click.option("--robot", type=click.Choice(["arm"]), default="arm", show_default=True)
@click.option("--payload-mass", type=click.FloatRange(0.3, 6.0), default=1.5, show_default=True, help="[kg]")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the motion and of the noise.")
@click.option("--duration", type=click.FloatRange(12.0, 50.0), default=30.0, show_default=True, help="Of the motion. [s]")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("demo"), show_default=True,
              help="Folder of the plot and of the logs.")  # fmt: skip
def demo(robot: str, payload_mass: float, seed: int, duration: float, out: Path) -> int:
    """Watch a payload being estimated live: simulated arm and estimator are two real ROS 2 nodes.

    The arm moves, picks the payload up after 30 % of the time, drops it after 75 %, and the demo ends with a plot.

    \b
    Example:
      python -m sysid_ros.cli.demo --robot arm --payload-mass 2.5 --seed 3

    Exit codes: 0 the estimate was right by the criterion below; 1 it was not; 2 bad input, or a process failed.
    """
    _require_packages()
    out.mkdir(parents=True, exist_ok=True)
    console = Console()
    environment = ros_environment(out)
    robot_parameters: dict[str, object] = {
        "seed": seed,
        "duration": float(duration),
        "payload_mass": payload_mass,
        "pick_time": round(_PICK * duration, 3),
        "drop_time": round(_DROP * duration, 3),
    }
    estimator_parameters: dict[str, object] = {"estimate_friction": False}
    _explain(console, environment, robot_parameters, estimator_parameters)

    from sysid_ros.nodes.demo_monitor import Listener

    started = os.environ | environment
    with (
        DemoProcess(ESTIMATOR_MODULE, estimator_parameters, started, out / "online_payload_estimator.log") as estimator,
        DemoProcess(ROBOT_MODULE, robot_parameters, started, out / "simulated_robot.log") as simulated,
        Listener(environment) as listener,
        Display(console) as display,
    ):
        _watch(listener, (estimator, simulated), display, duration)
        monitor = listener.monitor
    return _conclude(console, monitor, out, payload_mass)


def ros_environment(out: Path) -> dict[str, str]:
    """A ROS 2 domain of the demo's own, on this machine only."""
    return {
        # 1 to 101 are safe on every platform; the process number keeps two demos apart
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 101),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_LOG_DIR": str(out.resolve() / "ros_log"),
        "RCUTILS_COLORIZED_OUTPUT": "0",
        "OMP_NUM_THREADS": "1",
    }


def _require_packages() -> None:
    for package, extra in (("rclpy", "ros"), ("pybullet", "sim")):
        if importlib.util.find_spec(package) is None:
            raise SysidError(
                f"The demo needs {package}, which is not installed. Install it with: pip install 'sysid_ros[{extra}]'"
            )


def _explain(
    console: Console, environment: dict[str, str], robot_parameters: dict[str, object], estimator_parameters: dict[str, object]
) -> None:
    """Say what happens, and how to do it by hand."""
    domain = environment["ROS_DOMAIN_ID"]
    mass, pick, drop = (robot_parameters[name] for name in ("payload_mass", "pick_time", "drop_time"))
    console.print(
        f"[bold]A simulated 7-joint arm moves, picks up {mass} kg after {pick} s and drops it after {drop} s.[/bold]\n"
        "The estimator is told neither the payload nor when: it gets /joint_states (positions and torques, with noise)\n"
        "and the URDF of the empty arm. The joints have no friction here, so none is estimated. By hand it is:\n",
        highlight=False,
        soft_wrap=True,
    )
    commands = [
        " ".join(["ros2 run sysid_ros simulated_robot", *map(_quoted, ros_arguments(robot_parameters))]),
        " ".join(["ros2 run sysid_ros online_payload_estimator", *map(_quoted, ros_arguments(estimator_parameters))]),
        f"ROS_DOMAIN_ID={domain} ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ros2 topic echo /online_payload_estimator/payload",
    ]
    notes = ("the robot", "the estimator", "look at this demo's estimate from another terminal")
    for command, note in zip(commands, notes, strict=True):
        console.print(f"  # {note}\n  {command}", style="cyan", highlight=False, soft_wrap=True, markup=False)
    console.print()


def _quoted(word: str) -> str:
    return f"'{word}'" if set(word) & set("[ ]") else word


def _watch(listener: Listener, processes: Sequence[DemoProcess], display: Display, duration: float) -> None:
    """Show what comes until the motion has ended.

    Raises:
        ProcessFailed: a process ended, or no estimate came.
    """
    monitor = listener.monitor
    began = time.monotonic()
    while True:
        listener.listen(_PICTURE_PERIOD)
        for process in processes:
            process.check()
        if not monitor.estimates and time.monotonic() - began > _PATIENCE:
            raise ProcessFailed(_silence(monitor, processes))
        display.show(_picture(monitor, duration))
        if monitor.truth and monitor.estimates:
            end = monitor.truth[0].start + duration
            # a slow machine simulates slower than the clock runs; it gets some seconds more
            if monitor.estimates[-1].t > end - 0.2 or time.time() > end + 8.0:
                return


def _silence(monitor: DemoMonitor, processes: Sequence[DemoProcess]) -> str:
    said = "; ".join(f"{name}: {values['message']}" for name, values in monitor.diagnostics.items()) or "nothing"
    logs = "\n".join(f"{process.name}: {process.last_words()}" for process in processes)
    return f"No estimate came within {_PATIENCE:.0f} s. /diagnostics says: {said}.\n{logs}"


def _picture(monitor: DemoMonitor, duration: float) -> Picture:
    waiting = ""
    if not monitor.truth:
        waiting = "Starting both nodes ..."
    elif not monitor.estimates:
        waiting = "The robot moves; waiting for the first estimate ..."
    start = monitor.truth[0].start if monitor.truth else 0.0
    estimate = monitor.estimates[-1] if monitor.estimates else None
    truth = monitor.truth[-1] if monitor.truth else None
    t = estimate.t - start if estimate else 0.0
    return Picture(t, duration, start, waiting, estimate, truth, monitor.events)


def _conclude(console: Console, monitor: DemoMonitor, out: Path, payload_mass: float) -> int:
    """Show the comparison before the drop, write the plot, and answer the question."""
    carried = next((s for s in monitor.truth if s.mass > 0.0), None)
    if carried is None:
        raise ProcessFailed("The simulated robot never said that it picked the payload up; the logs are in " + str(out))
    before = next((e for e in reversed(monitor.estimates) if carried.start < e.t < carried.end), None)
    if before is not None:
        console.print(comparison_table(compare(before, carried), "The last estimate before the drop"))
    plot = out / "payload.png"
    title = f"Simulated arm picks up and drops {payload_mass:g} kg, estimated live"
    write_payload_plot(
        plot, monitor.estimates, monitor.events, monitor.joint_names, title, monitor.truth_until(monitor.estimates[-1].t)
    )
    against = objections(before, carried, monitor.events)
    for event in monitor.events:
        console.print(f"Found: {_event_text(event, monitor.truth)}", highlight=False)
    if against:
        console.print("[bold red]The estimate was not right:[/bold red] " + " ".join(against), highlight=False, soft_wrap=True)
    else:
        console.print("[bold green]The estimate was right.[/bold green] " + CRITERION, highlight=False, soft_wrap=True)
    console.print(f"Plot: {plot}", highlight=False, soft_wrap=True)
    return 1 if against else 0


def _event_text(event: PayloadEvent, truth: Sequence[TruthSegment]) -> str:
    nearest = min((s.start for s in truth[1:]), key=lambda start: abs(start - event.t), default=None)
    off = "" if nearest is None else f", dated {1e3 * (event.t - nearest):+.0f} ms off"
    return f"{event.kind} at {event.t - truth[0].start:.2f} s, {event.mass_before:.2f} → {event.mass_after:.2f} kg{off}"


def main() -> int:
    """Run the demo; its exit code."""
    # a shell starts background jobs with SIGINT ignored, and children would inherit that
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(_TERMINATED))
    try:
        return int(demo.main(standalone_mode=False) or 0)
    except click.ClickException as error:
        error.show()
    except SysidError as error:
        click.echo(f"Error: {error}", err=True)
    except (click.Abort, KeyboardInterrupt):
        click.echo("Interrupted; both nodes are stopped.", err=True)
        return _INTERRUPTED
    return 2


if __name__ == "__main__":
    sys.exit(main())
