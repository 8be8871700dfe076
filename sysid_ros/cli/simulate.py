"""``sysid simulate``: record a bag of a simulated robot, with the truth beside it."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from sysid_ros.exceptions import SettingsError, SysidError
from sysid_ros.sources import BagRecorder

try:
    from sysid_ros.cli.simulate_hidden import record_hidden
    from sysid_ros.cli.simulate_output import Bar, named_option, prepare
    from sysid_ros.cli.simulate_quadruped import quadruped
    from sysid_ros.simulation import ArmRecord, ArmScenario, simulate_arm
    from sysid_ros.simulation.recording import START_TIME, truth_path, write_recording, write_truth
except ModuleNotFoundError as missing:
    if not (missing.name or "").startswith("pybullet"):
        raise
    raise SysidError(
        "PyBullet is not installed; the simulation needs it. Install it with: pip install 'sysid_ros[sim]'"
    ) from missing


def _joint_values(ctx: click.Context, param: click.Parameter, value: str) -> tuple[float, ...]:
    try:
        return tuple(float(x) for x in value.split(","))
    except ValueError:
        raise click.BadParameter(
            f"{value!r} is not one number or numbers with commas between them, such as 0.5 or 1,1,0.8,0.8,0.4,0.4,0.2."
        ) from None


@click.group()
def command() -> None:
    """Record a bag of a simulated robot, with the truth beside it.

    \b
    Example:
      sysid simulate arm --bag pick_and_drop --payload-mass 1.5 --pick 4 --drop 10
      sysid simulate quadruped --bag trot --gait trot --payload-mass 3 --pick 4 --drop 8
    """


command.add_command(quadruped)


@command.command()
@click.option("--bag", required=True, type=click.Path(path_type=Path), help="Folder to create; the truth goes to BAG.truth.json.")
@click.option("--duration", type=float, default=15.0, show_default=True, help="[s]")
@click.option("--rate", type=int, default=1000, show_default=True, help="Messages a second, a divisor of 1000. [Hz]")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the motion and of the noise.")
@click.option("--storage", type=click.Choice(["mcap", "sqlite3"]), default="mcap", show_default=True)
@click.option("--velocity/--no-velocity", default=True, show_default=True, help="The messages hold velocities.")
@click.option("--payload-mass", type=float, metavar="KG", help="Without it the arm is empty.")
@click.option(
    "--payload-com", type=float, nargs=3, metavar="X Y Z", default=(0.03, -0.02, 0.08), show_default=True,
    help="Centre of mass in the tip link's frame. [m]",
)  # fmt: skip
@click.option("--payload-size", type=float, nargs=3, metavar="X Y Z", help="Edges of the box whose inertia it has. [m]")
@click.option(
    "--payload-rpy", type=float, nargs=3, metavar="R P Y", default=(0.0, 0.0, 0.0), show_default=True,
    help="How the box is turned in the tip link's frame. [rad]",
)  # fmt: skip
@click.option("--pick", "pick_time", type=float, metavar="T", help="Picked up after T s; without it carried from the start.")
@click.option("--drop", "drop_time", type=float, metavar="T", help="Dropped after T s; without it never.")
@click.option("--controller-knows-payload", is_flag=True, help="The controller's model has the payload while it is carried.")
@click.option(
    "--base-frequency", type=float, default=0.2, show_default=True, help="Of the exciting motion, which has 5 harmonics. [Hz]"
)
@click.option("--encoder-noise", type=float, default=1e-5, show_default=True, help="Standard deviation of the positions. [rad]")
@click.option("--torque-noise", type=float, default=0.1, show_default=True, help="Standard deviation of the efforts. [N m]")
@click.option(
    "--velocity-noise", type=float, default=1e-3, show_default=True, help="Standard deviation of the velocities. [rad/s]"
)
@click.option(
    "--viscous-friction",
    callback=_joint_values,
    metavar="X[,X...]",
    default="0",
    help="For all joints, or one a joint. [N m s/rad]",
)
@click.option(
    "--coulomb-friction", callback=_joint_values, metavar="X[,X...]", default="0", help="For all joints, or one a joint. [N m]"
)
@click.option(
    "--rotor-inertia",
    callback=_joint_values,
    metavar="X[,X...]",
    default="0",
    help="Seen at the joint, for all joints, or one a joint. [kg m^2]",
)
@click.option(
    "--torque-offset",
    callback=_joint_values,
    metavar="X[,X...]",
    default="0",
    help="What the sensors show too much, for all joints, or one a joint. [N m]",
)
@click.option(
    "--hide",
    multiple=True,
    metavar="EFFECT[@JOINT]",
    help="Hide a cause that the URDF lacks, by its id in the reports of sysid diagnose (an unknown one lists all); joint and "
    "size are drawn. Repeatable.",
)
@click.option(
    "--hide-value", multiple=True, metavar="NAME=X[,X,X]", help="A size of what is hidden that is not drawn, such as Fc=2.5."
)
@click.option(
    "--hide-seed",
    type=int,
    default=0,
    show_default=True,
    help="Of what is hidden; --seed draws another motion of the same robot.",
)
@click.option("--json", "json_file", type=click.Path(path_type=Path, dir_okay=False), help="Write the summary for machines.")
def arm(bag: Path, storage: str, json_file: Path | None, **options: Any) -> None:
    """Record a 7-joint arm (KUKA LBR iiwa in PyBullet) in an exciting motion, with a payload that it picks up and drops.

    The bag holds /joint_states and /robot_description; BAG.truth.json tells the payload, the times and all that was added.

    \b
    Examples:
      sysid simulate arm --bag pick_and_drop --payload-mass 1.5 --payload-com 0.03 -0.02 0.08 --pick 4 --drop 10
      sysid simulate arm --bag empty --duration 60 --viscous-friction 0.5 --coulomb-friction 0.6,0.6,0.4,0.4,0.2,0.2,0.1
      sysid simulate arm --bag worn --hide stribeck_friction@lbr_iiwa_joint_4 --hide-value vs=0.08

    Exit codes: 0 done; 2 bad input or usage.
    """
    prepare(bag, json_file)
    if options["hide"]:
        record_hidden(bag, storage, json_file, options)
        return
    for name in ("hide", "hide_value", "hide_seed"):
        del options[name]
    truth_file = truth_path(bag)
    recorder = BagRecorder(bag, storage)
    began = time.perf_counter()
    record = _simulate(options)
    with recorder:
        write_recording(record, recorder)
    write_truth(record.truth, truth_file)
    elapsed = time.perf_counter() - began
    summary = {
        "bag": str(bag),
        "truth_file": str(truth_file),
        "messages": len(record.t),
        "realtime_factor": record.truth["duration"] / elapsed,
        "truth": record.truth,
    }
    if json_file is not None:
        json_file.write_text(json.dumps(summary, indent=2) + "\n")
    _show(summary)


def _simulate(options: dict[str, Any]) -> ArmRecord:
    """The recording that the options ask for; messages about a setting name its option."""
    try:
        scenario = ArmScenario(**options)
        if math.isinf(scenario.duration):
            raise SettingsError("duration is inf; a bag must end. Give a number of seconds.")
        with Bar(round(scenario.duration * scenario.rate)) as advance:
            return simulate_arm(scenario, advance, START_TIME)
    except SettingsError as error:
        raise named_option(error, options) from None


def _show(summary: dict[str, Any]) -> None:
    truth = summary["truth"]
    table = Table(title=f"Simulated {truth['robot']}", show_header=False)
    table.add_column(style="bold")
    table.add_column()
    table.add_row("bag", summary["bag"])
    table.add_row("truth", summary["truth_file"])
    table.add_row("messages", f"{summary['messages']} at {truth['rate']} Hz, {truth['duration']:g} s")
    table.add_row("speed", f"{summary['realtime_factor']:.1f} times real time")
    payload = truth["payload"]
    if payload is None:
        table.add_row("payload", "none")
    else:
        com = ", ".join(f"{x:g}" for x in payload["com"])
        table.add_row("payload", f"{payload['mass']:g} kg at [{com}] m in {truth['frame']}")
        for event in truth["events"]:
            table.add_row(event["kind"], f"at {event['t'] - truth['start_time']:.3f} s (stamp {event['t']:.3f})")
    noise = truth["noise"]
    table.add_row("noise", f"effort {noise['torque']:g} N m, position {noise['encoder']:g} rad")
    for name, values in truth["effects"].items():
        if any(values):
            table.add_row(name.replace("_", " "), ", ".join(f"{x:g}" for x in values))
    Console().print(table)
