"""``sysid simulate``: record a bag of a simulated robot, with the truth beside it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from sysid_ros.exceptions import SysidError
from sysid_ros.sources import BagRecorder

try:
    from sysid_ros.cli.simulate_hidden import record_hidden
    from sysid_ros.cli.simulate_output import conclude, prepare, simulated
    from sysid_ros.cli.simulate_quadruped import quadruped
    from sysid_ros.simulation import ArmScenario, simulate_arm
    from sysid_ros.simulation.bag_and_truth import write_recording
except ModuleNotFoundError as missing:
    if not (missing.name or "").startswith("pybullet"):
        raise
    raise SysidError(
        "PyBullet is not installed; the simulation needs it. Install it with: pip install 'sysid_ros[sim]'"
    ) from missing


def joint_values(ctx: click.Context, param: click.Parameter, value: str) -> tuple[float, ...]:
    """Numbers with commas between them, one for all joints or one a joint."""
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
    callback=joint_values,
    metavar="X[,X...]",
    default="0",
    help="For all joints, or one a joint. [N m s/rad]",
)
@click.option(
    "--coulomb-friction", callback=joint_values, metavar="X[,X...]", default="0", help="For all joints, or one a joint. [N m]"
)
@click.option(
    "--rotor-inertia",
    callback=joint_values,
    metavar="X[,X...]",
    default="0",
    help="Seen at the joint, for all joints, or one a joint. [kg m^2]",
)
@click.option(
    "--torque-offset",
    callback=joint_values,
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
    recorder = BagRecorder(bag, storage)
    began = time.perf_counter()
    record = simulated(ArmScenario, simulate_arm, options)
    with recorder:
        write_recording(record, recorder)
    truth = record.truth
    noise = truth["noise"]
    more = [("noise", f"effort {noise['torque']:g} N m, position {noise['encoder']:g} rad")]
    more += [(name.replace("_", " "), ", ".join(f"{x:g}" for x in v)) for name, v in truth["effects"].items() if any(v)]
    conclude(bag, json_file, len(record.t), time.perf_counter() - began, truth, more)
