"""``sysid simulate arm``: record a bag of a simulated arm, with the truth beside it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from sysid_ros.cli import options as opt
from sysid_ros.cli.simulate_hidden import record_hidden
from sysid_ros.cli.simulate_output import conclude, payload_rows, prepare, recorder_of, simulated
from sysid_ros.simulation import ArmScenario, simulate_arm
from sysid_ros.simulation.arm_record import write_recording


@click.command()
@opt.NEW_BAG
@opt.number("--duration", default=15.0, help="[s]")
@opt.number("--rate", default=1000, help="Messages a second, a divisor of 1000. [Hz]")
@opt.SEED
@opt.STORAGE
@click.option("--velocity/--no-velocity", default=True, show_default=True, help="The messages hold velocities.")
@click.option("--payload-mass", type=float, metavar="KG", help="Without it the arm is empty.")
@opt.vector("--payload-com", default=(0.03, -0.02, 0.08), help="Centre of mass in the tip link's frame. [m]")
@opt.vector("--payload-size", help="Edges of the box whose inertia it has. [m]")
@opt.vector("--payload-rpy", metavar="R P Y", default=(0.0, 0.0, 0.0), help="How the box is turned in that frame. [rad]")
@click.option("--pick", "pick_time", type=float, metavar="T", help="Picked up after T s; without it carried from the start.")
@click.option("--drop", "drop_time", type=float, metavar="T", help="Dropped after T s; without it never.")
@click.option("--controller-knows-payload", is_flag=True, help="The controller's model has the payload while it is carried.")
@opt.number("--base-frequency", default=0.2, help="Of the exciting motion, which has 5 harmonics. [Hz]")
@opt.number("--encoder-noise", default=1e-5, help="Standard deviation of the positions. [rad]")
@opt.number("--torque-noise", default=0.1, help="Standard deviation of the efforts. [N m]")
@opt.number("--velocity-noise", default=1e-3, help="Standard deviation of the velocities. [rad/s]")
@opt.each_joint("--viscous-friction", help="For all joints, or one a joint. [N m s/rad]")
@opt.each_joint("--coulomb-friction", help="For all joints, or one a joint. [N m]")
@opt.each_joint("--rotor-inertia", help="Seen at the joint, for all joints, or one a joint. [kg m^2]")
@opt.each_joint("--torque-offset", help="What the sensors show too much, for all joints, or one a joint. [N m]")
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
@opt.number("--hide-seed", default=0, help="Of what is hidden; --seed draws another motion of the same robot.")
@opt.JSON
@opt.FORCE
def command(bag: Path, storage: str, json_path: Path | None, force: bool, **options: Any) -> None:
    """Record a 7-joint arm (KUKA LBR iiwa in PyBullet) in an exciting motion, with a payload that it picks up and drops.

    The bag holds /joint_states and /robot_description; BAG.truth.json tells the payload, the times and all that was added.

    \b
    Examples:
      sysid simulate arm --bag pick_and_drop --payload-mass 1.5 --payload-com 0.03 -0.02 0.08 --pick 4 --drop 10
      sysid simulate arm --bag empty --duration 60 --viscous-friction 0.5 --coulomb-friction 0.6,0.6,0.4,0.4,0.2,0.2,0.1
      sysid simulate arm --bag worn --hide stribeck_friction@lbr_iiwa_joint_4 --hide-value vs=0.08

    Exit codes: 0 done; 2 bad input or usage.
    """
    prepare(bag, json_path, force)
    if options["hide"]:
        record_hidden(bag, storage, json_path, options)
        return
    for name in ("hide", "hide_value", "hide_seed"):
        del options[name]
    began = time.perf_counter()
    record = simulated(ArmScenario, simulate_arm, options)
    truth = record.truth
    with recorder_of(bag, storage, truth) as recorder:
        write_recording(record, recorder)
    noise = truth["noise"]
    more = [*payload_rows(truth), ("noise", f"effort {noise['torque']:g} N m, position {noise['encoder']:g} rad")]
    more += [(name.replace("_", " "), ", ".join(f"{x:g}" for x in v)) for name, v in truth["effects"].items() if any(v)]
    conclude(bag, json_path, len(record.t), time.perf_counter() - began, truth, more)
