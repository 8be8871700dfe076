"""``sysid demo``: a simulated robot and the estimator as two ROS 2 processes, estimate against truth in the terminal, a plot."""

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

from sysid_ros.cli.demo_display import CRITERION, EVENT_DELAY, Display, Picture, compare, comparison_table, objections
from sysid_ros.cli.demo_processes import DemoProcess, ProcessFailed, ros_arguments, write_urdf
from sysid_ros.exceptions import SysidError
from sysid_ros.files import check_folder
from sysid_ros.online.payload_estimate import PayloadEvent
from sysid_ros.pages import TruthSegment, write_payload_plot
from sysid_ros.pages.payload_curves import event_text

if TYPE_CHECKING:
    from sysid_ros.nodes.demo_monitor import DemoMonitor, Listener

ROBOT_MODULE = "sysid_ros.nodes.simulated_robot"
ESTIMATOR_MODULE = "sysid_ros.nodes.online_payload_estimator"
_PICK, _DROP = 0.3, 0.75
_PATIENCE = 25.0
_START_PATIENCE = 120.0
_PICTURE_PERIOD = 0.1
_INTERRUPTED = 130


@click.command(context_settings={"help_option_names": ["-h", "--help"]}, epilog=f"The demo's question: {CRITERION}")
@click.option("--robot", type=click.Choice(["arm", "quadruped"]), default="arm", show_default=True)
@click.option("--gait", type=click.Choice(["stand", "sway", "trot"]), default="sway", show_default=True, help="Of the quadruped.")
@click.option("--payload-mass", type=click.FloatRange(0.3, 4.0), default=1.5, show_default=True, help="[kg]")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the motion and of the noise.")
@click.option("--duration", type=click.FloatRange(20.0, 50.0), default=30.0, show_default=True, help="Of the motion. [s]")
@click.option("--rate", type=click.Choice(["100", "250", "500", "1000"]), default="250", show_default=True,
              help="Joint states a second; 1000 needs an idle machine. [Hz]")  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("demo"), show_default=True,
              help="Folder of the plot and of the logs.")  # fmt: skip
def demo(robot: str, gait: str, payload_mass: float, seed: int, duration: float, rate: str, out: Path) -> int:
    """Watch a payload being estimated live: simulated robot and estimator are two real ROS 2 nodes.

    The robot moves, picks the payload up after 30 % of the time, drops it after 75 %, and the demo ends with a plot. What an
    earlier demo wrote into the folder is overwritten.

    \b
    Example:
      sysid demo --robot arm --payload-mass 2.5 --seed 3
      sysid demo --robot quadruped --gait sway --payload-mass 3

    Exit codes: 0 the estimate was right by the criterion below; 1 it was not; 2 bad input, or a process failed.
    """
    _require_packages()
    _heed_signals()
    check_folder(out, (), True, "--out")
    out.mkdir(parents=True, exist_ok=True)
    console = Console()
    environment = ros_environment(out)
    robot_parameters: dict[str, object] = {
        "seed": seed,
        "rate": rate,
        "duration": float(duration),
        "payload_mass": payload_mass,
        "pick_time": round(_PICK * duration, 3),
        "drop_time": round(_DROP * duration, 3),
    }
    if robot == "quadruped":
        robot_parameters |= {"robot": robot, "gait": gait}
    urdf = out / f"{robot}.urdf"
    write_urdf(urdf, robot)
    estimator_parameters: dict[str, object] = {"estimate_friction": False}
    _explain(console, environment, robot_parameters, estimator_parameters)

    from sysid_ros.nodes.demo_monitor import Listener

    started = os.environ | environment
    # by hand the URDF comes from /robot_description; here the estimator has it before the robot moves
    with_urdf = estimator_parameters | {"urdf_path": str(urdf.resolve())}
    with (
        Listener(environment) as listener,
        Display(console) as display,
        DemoProcess(ESTIMATOR_MODULE, with_urdf, started, out / "online_payload_estimator.log") as estimator,
    ):
        # the first start on a machine compiles; the robot waits for it, so that the whole motion is seen
        _wait_for(estimator, listener, display)
        with DemoProcess(ROBOT_MODULE, robot_parameters, started, out / "simulated_robot.log") as simulated:
            _watch(listener, (estimator, simulated), display, duration)
    return _conclude(console, listener.monitor, out, f"Simulated {robot} picks up and drops {payload_mass:g} kg, estimated live")


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


def _heed_signals() -> None:
    """Leave by an exception, which lets the nodes be stopped."""
    # a shell starts background jobs with SIGINT ignored, and children would inherit that
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # a closed terminal sends SIGHUP
    for sign in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(sign, lambda number, _: sys.exit(128 + number))


def _explain(
    console: Console, environment: dict[str, str], robot_parameters: dict[str, object], estimator_parameters: dict[str, object]
) -> None:
    """Say what happens, and how to do it by hand."""
    domain = environment["ROS_DOMAIN_ID"]
    mass, pick, drop = (robot_parameters[name] for name in ("payload_mass", "pick_time", "drop_time"))
    on_legs = robot_parameters.get("robot") == "quadruped"
    what = "quadruped" if on_legs else "7-joint arm"
    inputs = "/joint_states, /imu and /contacts" if on_legs else "/joint_states"
    console.print(
        f"[bold]A simulated {what} moves, picks up {mass} kg after {pick} s and drops it after {drop} s.[/bold]\n"
        f"The estimator is told neither the payload nor when: it gets {inputs} (with noise)\n"
        "and the URDF of the empty robot. The joints have no friction here, so none is estimated. By hand it is:\n",
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


def _wait_for(estimator: DemoProcess, listener: Listener, display: Display) -> None:
    """Wait until the estimator is active.

    Raises:
        ProcessFailed: it ended, or did not become active.
    """
    began = time.monotonic()
    while not listener.monitor.estimator_is_active:
        listener.listen(_PICTURE_PERIOD)
        estimator.check()
        waited = time.monotonic() - began
        if waited > _START_PATIENCE:
            raise ProcessFailed(f"The estimator was not active after {waited:.0f} s. {_silence(listener.monitor, [estimator])}")
        display.wait(f"Starting the estimator, {waited:.0f} s (the first start on a machine compiles) ...")


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
            raise ProcessFailed(f"No estimate came within {_PATIENCE:.0f} s. {_silence(monitor, processes)}")
        if not monitor.truth or not monitor.estimates:
            display.wait("The robot starts to move; waiting for the first estimate ...")
        else:
            display.show(_picture(monitor, duration))
            end = monitor.truth[0].start + duration
            # a slow machine simulates slower than the clock runs; it gets some seconds more
            if monitor.estimates[-1].t > end - 0.2 or time.time() > end + 8.0:
                return


def _silence(monitor: DemoMonitor, processes: Sequence[DemoProcess]) -> str:
    said = "; ".join(f"{name}: {values['message']}" for name, values in monitor.diagnostics.items()) or "nothing"
    logs = "\n".join(f"{process.name}: {process.last_words()}" for process in processes)
    return f"/diagnostics says: {said}.\n{logs}"


def _picture(monitor: DemoMonitor, duration: float) -> Picture:
    start, estimate = monitor.truth[0].start, monitor.estimates[-1]
    return Picture(estimate.t - start, duration, start, estimate, monitor.truth[-1], monitor.events)


def _conclude(console: Console, monitor: DemoMonitor, out: Path, title: str) -> int:
    """Show the comparison before the drop, write the plot, and answer the question."""
    carried = next((s for s in monitor.truth if s.mass > 0.0), None)
    if carried is None:
        raise ProcessFailed("The simulated robot never said that it picked the payload up; the logs are in " + str(out))
    before = next((e for e in reversed(monitor.estimates) if carried.start < e.t < carried.end), None)
    if before is not None:
        console.print(comparison_table(compare(before, carried), "The last estimate before the drop"))
    plot = out / "payload.png"
    write_payload_plot(
        plot, monitor.estimates, monitor.events, monitor.joint_names, title, monitor.truth_until(monitor.estimates[-1].t)
    )
    against = objections(before, carried, monitor.events)
    if heard := monitor.diagnostics.get("online_payload_estimator: input"):
        console.print(
            "Joint states at the estimator: {received} received, {rejected} rejected, {gaps} gaps.".format(**heard),
            highlight=False,
        )
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
    said = f"{event_text(event)} at {event.t - truth[0].start:.2f} s"
    if nearest is None or abs(event.t - nearest) > EVENT_DELAY:
        return f"{said}; nothing happened then"
    return f"{said}; its time is {1e3 * abs(event.t - nearest):.0f} ms too {'late' if event.t > nearest else 'early'}"


command = demo


def main() -> int:
    """Run the demo; its exit code."""
    try:
        return int(demo.main(standalone_mode=False) or 0)
    except click.ClickException as error:
        error.show()
    except (SysidError, OSError) as error:
        click.echo(f"Error: {error}", err=True)
    except (click.Abort, KeyboardInterrupt):
        click.echo("Interrupted; both nodes are stopped.", err=True)
        return _INTERRUPTED
    return 2


if __name__ == "__main__":
    sys.exit(main())
