"""What ``sysid identify`` finds of robots on legs in MuJoCo, from swaying and a trot, judged on a gait that was not recorded.

Each robot has links whose masses are off, a trunk whose centre of mass is, dry and viscous friction and rotors that nobody
tells, encoders with steps, and an IMU with a rate of its own, noise and a bias. It sways and trots; then its model and its URDF
predict the six rows of force and moment on the whole robot, free of the forces on the feet, and the torques of legs in the air,
in another gait.

Peers in the same run: the URDF as it is, and the URDF's links with friction, rotors, offsets, IMU and feet fitted to the same
bags.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.exceptions import SettingsError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.identification.free_effects import free_model_on_legs
from sysid_ros.identification.from_legs import identify_on_legs, learned
from sysid_ros.identification.result import Identification
from sysid_ros.input_gate import gate_for
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.simulation.legged_record import LeggedRecord, simulate_legged
from sysid_ros.simulation.legged_scenario import LeggedScenario
from sysid_ros.simulation.legged_simulation import LeggedSimulation
from sysid_ros.simulation.quadruped_record import QuadrupedRecord

START = 1000.0
ROTORS = {"solo12": 5e-4, "anymal": 0.04}


@dataclass(frozen=True, slots=True)
class Trial:
    """One robot: rms error over that of the URDF on the other gait, of force and moment on the robot and of legs in the air, the
    same of the URDF's links with the rest fitted; error of the trunk's com [m], of the total mass and the URDF's [kg]; median and
    worst part by which the dry friction of joints is off, and the part of joints off by more than 15 %; seconds."""

    seed: int
    base_force: float
    leg_torque: float
    links_base_force: float
    links_leg_torque: float
    trunk_com: float
    urdf_trunk_com: float
    mass: float
    urdf_mass: float
    friction: float
    worst_friction: float
    beyond: float
    seconds: float


def scenario(robot: str, gait: str, seed: int, seconds: float, mass_error: float) -> LeggedScenario:
    """The robot of a seed; what is hidden does not depend on the gait."""
    rng = np.random.default_rng([seed, len(robot)])
    rotor = ROTORS.get(robot, 0.01)
    dry = rng.uniform(0.1, 0.5) * (rotor / 0.01) ** 0.7
    bias = rng.normal(0.0, 0.03, 3)
    shift = rng.normal(0.0, 0.01, 3) * (2.0 if robot == "anymal" else 1.0)
    return LeggedScenario(
        robot=robot, gait=gait, seed=seed, duration=seconds, encoder_step=1e-4, imu_rate=250, leg_friction=dry,
        leg_damping=0.2 * dry, rotor_inertia=rotor, mass_error=mass_error, accelerometer_bias=tuple(bias), trunk_com=tuple(shift),
    )  # fmt: skip


def recorded(record: LeggedRecord | QuadrupedRecord, name: str) -> tuple[FloatingBase, Recording]:
    """What the input gate lets through of a recording."""
    base = FloatingBase(RobotModel.from_urdf(record.urdf))
    gate = gate_for(base.legs, base, OnlineSettings())
    return base, Recording.from_measurements(name, (m for x in record.records() for m in gate.take(x)))


def true_links(description: LeggedScenario) -> FloatArray:
    """Inertials of the simulated robot on its floating base, shape (10 n,)."""
    world = LeggedSimulation(description)
    root = ElementTree.fromstring(world.urdf)
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        factor = world.world.scale[str(link.get("name"))]
        if link.get("name") == world.legged.base.trunk:
            origin = inertial.find("origin")
            assert origin is not None
            place = np.array([float(x) for x in origin.get("xyz", "0 0 0").split()]) + description.trunk_com
            origin.set("xyz", " ".join(repr(float(x)) for x in place))
        for element in (inertial.find("mass"), inertial.find("inertia")):
            assert element is not None
            for key, value in element.attrib.items():
                element.set(key, repr(float(value) * factor))
    return FloatingBase(RobotModel.from_urdf(ElementTree.tostring(root, encoding="unicode"))).robot.pi


def errors(result: Identification) -> tuple[float, float, float, float]:
    """Error on the recordings that were not fitted over that of the URDF: of force and moment on the robot, each over the URDF's,
    and of legs in the air; then the same of the URDF's links with the rest fitted."""
    (e,) = result.validation
    parts = [x / np.maximum(e.nominal, 1e-9) for x in (e.residual, e.urdf_friction)]
    legs = e.nominal[FREE:] > 1e-6
    found: list[float] = []
    for part in parts:
        found += [float(np.sqrt(np.mean(x**2))) if x.size else np.nan for x in (part[:FREE], part[FREE:][legs])]
    return found[0], found[1], found[2], found[3]


def trial(robot: str, other: str, seed: int, seconds: float, mass_error: float) -> Trial:
    """Simulate, identify and judge one robot.

    Raises:
        SettingsError: it falls.
    """
    gaits = [scenario(robot, gait, seed, seconds, mass_error) for gait in ("sway", "trot")]
    runs = [recorded(simulate_legged(x, start_time=START), x.gait) for x in gaits]
    judged = simulate_legged(scenario(robot, other, seed, 12.0, mass_error), start_time=START)
    base, check = recorded(judged, other)
    began = time.perf_counter()
    result = identify_on_legs(base, [run for _, run in runs], [check], {})
    spent = time.perf_counter() - began
    truth = true_links(scenario(robot, "stand", seed, 1.0, mass_error))
    _, known = learned(free_model_on_legs(base), result.theta)
    trunk = slice(10 * (FREE - 1), 10 * FREE)
    com, true_com, said = (x[trunk][1:4] / x[trunk][0] for x in (known.links(), truth, base.robot.pi))
    friction = np.array(judged.truth["hidden"]["leg_friction"])
    off = np.abs(known.dry_friction()[FREE:] / friction - 1.0)
    mass, said_mass = (float(np.sum(x[::10] - truth[::10])) for x in (known.links(), base.robot.pi))
    force, torque, force_links, torque_links = errors(result)
    return Trial(
        seed, force, torque, force_links, torque_links, float(np.linalg.norm(com - true_com)),
        float(np.linalg.norm(said - true_com)), mass, said_mass, float(np.median(off)), float(off.max()),
        float(np.mean(off > 0.15)), spent,
    )  # fmt: skip


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--robots", default="go2", show_default=True, help="By name.")
@click.option("--other", default="flying_trot", show_default=True, help="Gait that is judged on.")
@click.option("--seconds", default=60.0, show_default=True, help="Of swaying, and of the trot.")
@click.option("--mass-error", default=0.03, show_default=True, help="Standard deviation of the links' masses, as a part.")
@click.option("--seeds", type=click.IntRange(1), default=3, show_default=True, help="Robots a row.")
@click.option("--first-seed", type=int, default=400, show_default=True)
@click.option("--json", "json_path", type=click.Path(path_type=Path, dir_okay=False), help="Write the results.")
def main(robots: str, other: str, seconds: float, mass_error: float, seeds: int, first_seed: int, json_path: Path | None) -> int:
    """Identify robots on legs; one with 60 s of each gait takes about five minutes.

    \b
    Example:
      python benchmarks/legs_identify.py --robots go2 --seconds 20 --seeds 3
    """
    console = Console(width=150)
    table = Table(title=f"From swaying and a trot to '{other}': error over the URDF's", title_justify="left")
    for column in (
        "",
        "base force",
        "legs in the air",
        "URDF's links: base",
        "legs",
        "com mm (URDF)",
        "mass g (URDF)",
        "friction %",
    ):
        table.add_column(column, justify="left" if not column else "right")
    rows: dict[str, list[Trial]] = {}
    for robot in robots.split(","):
        for seed in range(first_seed, first_seed + seeds):
            try:
                t = trial(robot, other, seed, seconds, mass_error)
            except SettingsError as error:
                console.print(f"{robot} {seed}: {error}")
                continue
            rows.setdefault(robot, []).append(t)
            table.add_row(
                f"{robot} {seed}", f"{t.base_force:.2f}", f"{t.leg_torque:.2f}", f"{t.links_base_force:.2f}",
                f"{t.links_leg_torque:.2f}", f"{1e3 * t.trunk_com:.1f} ({1e3 * t.urdf_trunk_com:.1f})",
                f"{1e3 * t.mass:+.0f} ({1e3 * t.urdf_mass:+.0f})", f"{100 * t.friction:.0f}, worst {100 * t.worst_friction:.0f}",
            )  # fmt: skip
    console.print(table)
    every = [t for trials in rows.values() for t in trials]
    if not every:
        raise click.UsageError("every robot has fallen; take other seeds.")
    targets = [
        Target("force and moment on the robot over the URDF's error", float(np.median([t.base_force for t in every])), high=0.6),
        Target("torque of legs in the air over the URDF's error", float(np.nanmedian([t.leg_torque for t in every])), high=0.6),
        Target("error of the trunk's centre of mass [m]", float(np.median([t.trunk_com for t in every])), high=3e-3),
        Target("dry friction off by, of a usual joint", float(np.median([t.friction for t in every])), high=0.15),
        Target("joints whose dry friction is off by more than 15 %", float(np.mean([t.beyond for t in every])), high=0.1),
    ]
    return conclude("legs_identify", targets, {name: [asdict(t) for t in trials] for name, trials in rows.items()}, json_path)


if __name__ == "__main__":
    sys.exit(main(standalone_mode=False))
