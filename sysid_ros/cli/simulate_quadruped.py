"""``sysid simulate quadruped``: record a bag of a simulated quadruped with a box on its back."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from sysid_ros.cli.simulate_output import conclude, prepare, simulated
from sysid_ros.simulation.quadruped_record import simulate_quadruped, write_quadruped
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario
from sysid_ros.sources import BagRecorder


@click.command()
@click.option("--bag", required=True, type=click.Path(path_type=Path), help="Folder to create; the truth goes to BAG.truth.json.")
@click.option("--duration", type=float, default=10.0, show_default=True, help="[s]")
@click.option("--rate", type=int, default=500, show_default=True, help="Messages a second, a divisor of 1000. [Hz]")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the motion and of the noise.")
@click.option("--storage", type=click.Choice(["mcap", "sqlite3"]), default="mcap", show_default=True)
@click.option("--gait", default="stand", show_default=True, help="stand, sway (the trunk over planted feet) or trot.")
@click.option("--extent", type=float, default=1.0, show_default=True, help="Factor on the sway's amplitudes.")
@click.option("--speed", type=float, default=0.2, show_default=True, help="Of the trot. [m/s]")
@click.option("--slope", type=float, default=0.0, show_default=True, help="Of the ground, up to 10. [deg]")
@click.option("--slope-heading", type=float, default=0.0, show_default=True, help="Ascent: 0 ahead, 90 to the left. [deg]")
@click.option("--payload-mass", type=float, metavar="KG", help="Without it nothing is put on the back.")
@click.option(
    "--payload-com", type=float, nargs=3, metavar="X Y Z", default=(0.03, -0.02, 0.1), show_default=True,
    help="Centre of mass in the trunk's frame. [m]",
)  # fmt: skip
@click.option("--payload-size", type=float, nargs=3, metavar="X Y Z", help="Edges of the box. [m]")
@click.option(
    "--payload-rpy", type=float, nargs=3, metavar="R P Y", default=(0.0, 0.0, 0.0), show_default=True,
    help="How the box is turned. [rad]",
)  # fmt: skip
@click.option("--pick", "pick_time", type=float, metavar="T", help="Put on after T s; without it carried from the start.")
@click.option("--drop", "drop_time", type=float, metavar="T", help="Taken off after T s; without it never.")
@click.option(
    "--controller-knows-payload/--controller-ignorant", default=True, show_default=True,
    help="The controller's model has the box while it is on.",
)  # fmt: skip
@click.option("--hoist", "hoist_time", type=float, metavar="T", help="Lifted off the ground by ropes after T s.")
@click.option("--hoist-duration", type=float, default=4.0, show_default=True, help="Until it is set down and free. [s]")
@click.option("--lifted-foot", default="", metavar="LINK", help="A foot that is held in the air all along.")
@click.option(
    "--imu-xyz", type=float, nargs=3, metavar="X Y Z", default=(0.0, 0.0, 0.0), show_default=True,
    help="Where the IMU sits in the trunk. [m]",
)  # fmt: skip
@click.option(
    "--imu-rpy", type=float, nargs=3, metavar="R P Y", default=(0.0, 0.0, 0.0), show_default=True,
    help="How the IMU is turned. [rad]",
)  # fmt: skip
@click.option("--encoder-noise", type=float, default=2e-5, show_default=True, help="Standard deviation of the positions. [rad]")
@click.option("--velocity-noise", type=float, default=1e-3, show_default=True, help="Of the velocities. [rad/s]")
@click.option("--torque-noise", type=float, default=0.1, show_default=True, help="Of the efforts. [N m]")
@click.option("--gyro-noise", type=float, default=0.005, show_default=True, help="Of the angular velocity. [rad/s]")
@click.option("--accelerometer-noise", type=float, default=0.05, show_default=True, help="Of the specific force. [m/s^2]")
@click.option("--gyro-bias", type=float, nargs=3, metavar="X Y Z", default=(0.0, 0.0, 0.0), show_default=True, help="[rad/s]")
@click.option(
    "--accelerometer-bias", type=float, nargs=3, metavar="X Y Z", default=(0.0, 0.0, 0.0), show_default=True, help="[m/s^2]"
)
@click.option(
    "--contact-error", type=float, default=0.0, show_default=True, help="Share of messages that tell one foot's contact wrong."
)
@click.option("--imu/--no-imu", default=True, show_default=True, help="Record /imu.")
@click.option("--contacts/--no-contacts", default=True, show_default=True, help="Record /contacts.")
@click.option("--json", "json_file", type=click.Path(path_type=Path, dir_okay=False), help="Write the summary for machines.")
def quadruped(bag: Path, storage: str, json_file: Path | None, imu: bool, contacts: bool, **options: Any) -> None:
    """Record a quadruped (Unitree A1 in PyBullet) that stands, sways or trots, with a box put on its back and taken off.

    The bag holds /joint_states, /imu, /contacts and /robot_description; BAG.truth.json tells the box, the times and the noise.

    \b
    Examples:
      sysid simulate quadruped --bag stand --payload-mass 3 --pick 4 --drop 8
      sysid simulate quadruped --bag trot --gait trot --slope 8 --payload-mass 2 --payload-com 0.05 0.02 0.12 --duration 15

    Exit codes: 0 done; 2 bad input or usage.
    """
    prepare(bag, json_file)
    recorder = BagRecorder(bag, storage)
    began = time.perf_counter()
    record = simulated(QuadrupedScenario, simulate_quadruped, options)
    with recorder:
        write_quadruped(record, recorder, imu, contacts)
    truth = record.truth
    ground = f"a slope of {truth['slope']:g} deg" if truth["slope"] else "the flat"
    noise = truth["noise"]
    more = [
        ("motion", f"{truth['gait']} on {ground}"),
        ("noise", f"effort {noise['torque']:g} N m, position {noise['encoder']:g} rad, gyro {noise['gyro']:g} rad/s"),
    ]
    conclude(bag, json_file, len(record.told), time.perf_counter() - began, truth, more)
