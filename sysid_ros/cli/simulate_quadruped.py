"""``sysid simulate quadruped``: record a bag of a simulated quadruped with a box on its back."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from sysid_ros.cli import options as opt
from sysid_ros.cli.simulate_legged import hidden_rows, legged_options, record_legged, with_hidden, without_own
from sysid_ros.cli.simulate_output import conclude, payload_rows, prepare, recorder_of, simulated
from sysid_ros.simulation.quadruped_record import simulate_quadruped, write_quadruped
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario


@click.command()
@opt.NEW_BAG
@opt.number("--duration", default=10.0, help="[s]")
@opt.number("--rate", default=500, help="Messages a second, a divisor of 1000. [Hz]")
@opt.SEED
@opt.STORAGE
@click.option(
    "--simulator",
    type=click.Choice(["pybullet", "mujoco"]),
    default="pybullet",
    show_default=True,
    help="PyBullet: torques are controlled, an A1; MuJoCo: joints hold positions, any robot, hard impacts.",
)
@click.option(
    "--gait",
    default="stand",
    show_default=True,
    help="stand, sway (the trunk over planted feet), trot or turn (on the spot); in MuJoCo also step, crawl, flying_trot, mixed.",
)
@opt.number("--extent", default=1.0, help="Factor on the sway's amplitudes.")
@opt.number("--speed", default=0.2, help="Of the trot. [m/s]")
@opt.number("--slope", default=0.0, help="Of the ground, up to 10. [deg]")
@opt.number("--slope-heading", default=0.0, help="Ascent: 0 ahead, 90 to the left. [deg]")
@opt.number("--grip", default=0.8, help="Friction coefficient of the feet.")
@opt.number("--sink", default=0.0, help="How far a foot that carries a quarter of the robot sinks into soft ground. [m]")
@click.option("--payload-mass", type=float, metavar="KG", help="Without it nothing is put on the back.")
@opt.vector("--payload-com", default=(0.03, -0.02, 0.1), help="Centre of mass in the trunk's frame. [m]")
@opt.vector("--payload-size", help="Edges of the box. [m]")
@opt.vector("--payload-rpy", metavar="R P Y", default=(0.0, 0.0, 0.0), help="How the box is turned. [rad]")
@click.option("--pick", "pick_time", type=float, metavar="T", help="Put on after T s; without it carried from the start.")
@click.option("--drop", "drop_time", type=float, metavar="T", help="Taken off after T s; without it never.")
@click.option(
    "--controller-knows-payload/--controller-ignorant",
    default=True,
    show_default=True,
    help="The controller's model has the box while it is on.",
)
@click.option("--hoist", "hoist_time", type=float, metavar="T", help="Lifted off the ground by ropes after T s.")
@opt.number("--hoist-duration", default=4.0, help="Until it is set down and free. [s]")
@click.option("--lifted-foot", default="", metavar="LINK", help="A foot that is held in the air all along.")
@opt.vector("--imu-xyz", default=(0.0, 0.0, 0.0), help="Where the IMU sits in the trunk. [m]")
@opt.vector("--imu-rpy", metavar="R P Y", default=(0.0, 0.0, 0.0), help="How the IMU is turned. [rad]")
@opt.number("--encoder-noise", default=2e-5, help="Standard deviation of the positions. [rad]")
@opt.number("--velocity-noise", default=1e-3, help="Of the velocities. [rad/s]")
@opt.number("--torque-noise", default=0.1, help="Of the efforts. [N m]")
@opt.number("--gyro-noise", default=0.005, help="Of the angular velocity. [rad/s]")
@opt.number("--accelerometer-noise", default=0.05, help="Of the specific force. [m/s^2]")
@opt.vector("--gyro-bias", default=(0.0, 0.0, 0.0), help="[rad/s]")
@opt.vector("--accelerometer-bias", default=(0.0, 0.0, 0.0), help="[m/s^2]")
@opt.number("--contact-error", default=0.0, help="Share of messages that tell one foot's contact wrong.")
@click.option("--imu/--no-imu", default=True, show_default=True, help="Record /imu.")
@click.option("--contacts/--no-contacts", default=True, show_default=True, help="Record /contacts.")
@click.option(
    "--hide",
    multiple=True,
    metavar="EFFECT[@JOINT][=SIZE]",
    help="A cause that the URDF does not tell, or tells wrongly, repeatable: coulomb_friction, imu_tilt=0.03, "
    "torque_scale@FL_calf_joint=0.2. A joint and a size are drawn; of several numbers each has the size, with a drawn sign.",
)
@opt.number("--hide-seed", default=0, help="Of what is hidden; --seed draws another motion of the same robot.")
@legged_options
@opt.JSON
@opt.FORCE
def command(
    bag: Path, storage: str, json_path: Path | None, force: bool, imu: bool, contacts: bool, simulator: str,
    hide: tuple[str, ...], hide_seed: int, **options: Any,
) -> None:  # fmt: skip
    """Record a quadruped that stands, sways or trots, with a box put on its back and taken off.

    The bag holds /joint_states, /imu, /contacts and /robot_description; BAG.truth.json tells the box, the times, the noise and
    what is hidden.

    \b
    Examples:
      sysid simulate quadruped --bag stand --payload-mass 3 --pick 4 --drop 8
      sysid simulate quadruped --bag hard --simulator mujoco --robot go2 --gait trot --payload-mass 2 --leg-friction 0.2
      sysid simulate quadruped --bag climb --simulator mujoco --gait trot --stairs 0.04 --speed 0.4 --payload-mass 2 --shift 5
      sysid simulate quadruped --bag turned --gait sway --hide imu_tilt=0.03 --hide coulomb_friction
      sysid simulate quadruped --bag trot --gait trot --slope 8 --payload-mass 2 --payload-com 0.05 0.02 0.12 --duration 15

    Exit codes: 0 done; 2 bad input or usage.
    """
    prepare(bag, json_path, force)
    if simulator == "mujoco":
        record_legged(bag, storage, json_path, imu, contacts, options, (hide, hide_seed))
        return
    options = without_own(options)
    began = time.perf_counter()
    record = with_hidden(simulated(QuadrupedScenario, simulate_quadruped, options), hide, hide_seed)
    truth = record.truth
    with recorder_of(bag, storage, truth) as recorder:
        write_quadruped(record, recorder, imu, contacts)
    ground = f"a slope of {truth['slope']:g} deg" if truth["slope"] else "the flat"
    noise = truth["noise"]
    more = [
        *payload_rows(truth),
        *hidden_rows(truth),
        ("motion", f"{truth['gait']} on {ground}"),
        ("noise", f"effort {noise['torque']:g} N m, position {noise['encoder']:g} rad, gyro {noise['gyro']:g} rad/s"),
    ]
    conclude(bag, json_path, len(record.measured), time.perf_counter() - began, truth, more)
