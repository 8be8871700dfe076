"""What the live estimator says of robots on legs that are not as their description says, in MuJoCo and in PyBullet.

Each recording is of a robot whose joints hold positions (MuJoCo: hard impacts) or whose torques are controlled (PyBullet); a load
is carried, from the start or put on and taken off. In MuJoCo legs have dry friction of 0.1 to 0.5 N m (on 16 kg; more on larger
ones), viscous friction and rotors that nobody tells, encoders have steps of 1e-4 rad, and the IMU has its own rate and a bias.
Conditions add what else is wrong: feet that no description tells, an IMU that is tilted, elsewhere, late or aliased, contact
flags that are late, wrong or absent, links of other mass, a push.

A row of the table is one recording, or with --summary one condition. ``bad ok`` are estimates more than 3 s after the begin, and
1 s after a change, whose status is ok and whose mass is beyond 3 standard deviations.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.exceptions import SettingsError
from sysid_ros.input_gate import gate_for
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.legged_record import LeggedRecord, simulate_legged
from sysid_ros.simulation.legged_scenario import LeggedScenario
from sysid_ros.simulation.quadruped_record import QuadrupedRecord, simulate_quadruped
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario

START = 1000.0
WARM, SETTLED, SEEN = 3.0, 1.0, 0.75
"""Time from the begin and from a change after which estimates count, and within which an event belongs to a change [s]."""
LOADS = {"solo12": (0.1, 0.6, 0.06), "anymal": (3.0, 15.0, 0.2)}
"""Load from, to [kg] and how far from the middle of the back it is put [m]; others carry 0.5 to 5 kg at up to 0.12 m."""
ROTORS = {"solo12": 5e-4, "anymal": 0.04}
NAMED = ("IMU shows", "IMU is turned", "IMU sits", "ms late against", "ms early against")
"""What a status says of the IMU where that is what is wrong, beside advice to check it."""
PICKED = {"pick_time": 6.0, "drop_time": 10.0, "duration": 13.0}
CONDITIONS: dict[str, tuple[dict[str, Any], bool]] = {
    # what is simulated otherwise, and whether contacts are told
    "plain": ({}, True),
    "picked": (PICKED, True),
    "no sphere": ({"foot_spheres": False}, True),
    "links 2 %": ({"mass_error": 0.02}, True),
    "IMU tilted 3 deg": ({"imu_tilt": (0.04, -0.035, 0.0)}, True),
    "IMU 3 cm away": ({"imu_lever": (0.03, 0.0, 0.02)}, True),
    "IMU 10 ms late": ({"imu_delay": 0.01}, True),
    "IMU bias": ({"accelerometer_bias": (0.1, -0.1, 0.2), "gyro_bias": (0.01, 0.01, -0.01)}, True),
    "IMU aliased": ({"imu_low_pass": False}, True),
    "no contacts": ({}, False),
    "contacts late": ({"contact_delay": 0.03}, True),
    "contacts wrong": ({"contact_error": 0.3}, True),
    "push": ({"push_time": 7.0}, True),
}


@dataclass(frozen=True, slots=True)
class Trial:
    """One recording: part by which the mass is wrong at the end, error [kg] and its standard deviation, error of the com across
    gravity [m], status, estimates that count, of those with status ok, of those beyond 3 std, and events."""

    seed: int
    mass: float
    error: float
    std: float
    com: float
    status: str
    count: int
    ok: int
    bad: int
    false: int
    missed: int
    named: str

    @property
    def inside(self) -> bool:
        return abs(self.error) < 1.96 * self.std


def legged(robot: str, gait: str, seed: int, **more: Any) -> LeggedRecord:
    """The recording of a seed; one that falls is tried with the next load.

    Raises:
        SettingsError: it always falls.
    """
    for attempt in range(8):
        rng = np.random.default_rng([seed, attempt, len(gait), len(robot)])
        low, high, reach = LOADS.get(robot, (0.5, 5.0, 0.12))
        rotor = ROTORS.get(robot, 0.01)
        dry = rng.uniform(0.1, 0.5) * (rotor / 0.01) ** 0.7
        values: dict[str, Any] = {
            "payload_mass": rng.uniform(low, high),
            "payload_com": (*rng.uniform(-0.4, 0.4, 2) * reach, rng.uniform(0.4, 1.0) * reach),
            "leg_friction": dry,
            "leg_damping": 0.2 * dry,
            "rotor_inertia": rotor,
            "accelerometer_bias": tuple(rng.normal(0.0, 0.02, 3)),
        }
        settings = {"duration": 12.0, "encoder_step": 1e-4, "imu_rate": 250} | values | more
        try:
            return simulate_legged(
                LeggedScenario(robot=robot, gait=gait, seed=seed + 10_000 * attempt, **settings), start_time=START
            )
        except SettingsError as error:
            fallen = error
    raise fallen


def bullet(gait: str, seed: int, **more: Any) -> QuadrupedRecord:
    """The same of the torque-controlled quadruped of PyBullet, whose description is right."""
    rng = np.random.default_rng([seed, len(gait)])
    place = rng.uniform(-0.12, 0.12), rng.uniform(-0.07, 0.07), rng.uniform(0.07, 0.2)
    own = {name: value for name, value in more.items() if name in ("accelerometer_bias", "gyro_bias", "contact_error", *PICKED)}
    settings = {"duration": 12.0, "encoder_noise": 1e-4} | own
    scenario = QuadrupedScenario(gait=gait, seed=seed, payload_mass=rng.uniform(0.5, 5.0), payload_com=place, **settings)
    return simulate_quadruped(scenario, start_time=START)


def estimated(record: LeggedRecord | QuadrupedRecord, contacts: bool) -> tuple[list[PayloadEstimate], list[PayloadEvent]]:
    """All estimates of a recording, and the events."""
    legs, settings = RobotModel.from_urdf(record.urdf), OnlineSettings(contact_frames=tuple(record.truth["contact_frames"]))
    estimation = OnlineEstimation(legs, settings)
    gate = gate_for(legs, estimation.base, settings)
    series = []
    for message in record.records(contacts=contacts):
        for measurement in gate.take(message):
            estimate = estimation.step(measurement)
            if estimate is not None:
                series.append(estimate)
    return series, estimation.events


def judged(record: LeggedRecord | QuadrupedRecord, seed: int, contacts: bool) -> Trial:
    """What became of a recording."""
    series, events = estimated(record, contacts)
    theta = np.array(record.truth["payload"]["theta"])
    truth = record.truth
    happened = [e["t"] for e in truth["events"] if e["t"] > START + 0.5]
    drop = truth["drop_time"] or np.inf
    pick = truth["pick_time"] or -np.inf

    def carried(t: float) -> float:
        return float(theta[0]) if pick <= t < drop else 0.0

    def counts(e: PayloadEstimate) -> bool:
        return e.t > START + WARM and all(not 0.0 <= e.t - t < SETTLED for t in happened)

    counted = [e for e in series if counts(e)]
    ok = [e for e in counted if e.status in ("ok", "no_payload")]
    bad = [e for e in ok if abs(e.theta[0] - carried(e.t)) > 3.0 * e.mass_std]
    found = [e.t for e in events]
    missed = sum(not any(abs(t - x) < SEEN for x in found) for t in happened)
    false = sum(not any(abs(t - x) < SEEN for t in happened) for x in found)
    loaded = [e for e in counted if carried(e.t) > 0.0]
    last = loaded[-1]
    com = float(np.abs(last.com[:2] - theta[1:3] / theta[0]).max())
    return Trial(
        seed, float(theta[0]), float(last.theta[0] - theta[0]), last.mass_std, com, last.status, len(counted), len(ok), len(bad),
        false, missed, last.reason if any(x in last.reason for x in NAMED) else "",
    )  # fmt: skip


def _row(name: str, trials: list[Trial]) -> tuple[str, ...]:
    part = [100.0 * abs(t.error) / t.mass for t in trials]
    ok, count, bad = sum(t.ok for t in trials), sum(t.count for t in trials), sum(t.bad for t in trials)
    return (
        name,
        f"{np.median(part):.2f}",
        f"{max(part):.2f}",
        f"{1e3 * float(np.median([t.std for t in trials])):.0f}",
        f"{1e3 * float(np.median([t.com for t in trials])):.1f}",
        f"{sum(t.inside for t in trials)}/{len(trials)}",
        f"{100 * ok / count:.0f}",
        f"{bad}",
        f"{sum(t.bad > 0 for t in trials)}",
        f"{sum(t.false for t in trials)}/{sum(t.missed for t in trials)}",
        f"{sum(bool(t.named) for t in trials)}",
    )


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--simulator", type=click.Choice(["mujoco", "pybullet", "both"]), default="both", show_default=True)
@click.option("--robots", default="go2,anymal", show_default=True, help="Of MuJoCo, by name.")
@click.option("--gaits", default="stand,sway,trot", show_default=True)
@click.option("--conditions", default=",".join(CONDITIONS), help="Some of the conditions; all of them without.")
@click.option("--seeds", type=click.IntRange(1), default=3, show_default=True, help="Recordings a row.")
@click.option("--first-seed", type=int, default=0, show_default=True)
@click.option("--json", "json_path", type=click.Path(path_type=Path, dir_okay=False), help="Write the results.")
def main(simulator: str, robots: str, gaits: str, conditions: str, seeds: int, first_seed: int, json_path: Path | None) -> int:
    """Robots on legs that are not as they are told to be; a recording takes 10 s.

    \b
    Example:
      python benchmarks/legs.py --robots go2 --gaits trot --conditions "plain,no sphere" --seeds 5
    """
    unknown = sorted(set(conditions.split(",")) - set(CONDITIONS))
    if unknown:
        raise click.UsageError(f"conditions has {', '.join(unknown)}; it has some of {', '.join(CONDITIONS)}.")
    console = Console(width=150)
    table = Table(title="A load on a robot with legs", title_justify="left")
    for column in (
        "",
        "mass %",
        "most",
        "std g",
        "com mm",
        "95 %",
        "ok %",
        "bad ok",
        "in runs",
        "events false/missed",
        "names IMU",
    ):
        table.add_column(column, justify="left" if not column else "right")
    rows: dict[str, list[Trial]] = {}
    for condition in conditions.split(","):
        settings, contacts = CONDITIONS[condition]
        for gait in gaits.split(","):
            for robot in robots.split(",") if simulator != "pybullet" else ():
                name = f"MuJoCo {robot} {gait}: {condition}"
                for seed in range(first_seed, first_seed + seeds):
                    try:
                        record: LeggedRecord | QuadrupedRecord = legged(robot, gait, seed, **settings)
                    except SettingsError as error:
                        console.print(f"{name}, seed {seed}: {error}")
                        continue
                    rows.setdefault(name, []).append(judged(record, seed, contacts))
                _show(console, name, rows)
            told = set(settings) <= {"accelerometer_bias", "gyro_bias", "contact_error", *PICKED}
            if simulator != "mujoco" and told and gait in ("stand", "sway", "trot"):
                name = f"PyBullet {gait}: {condition}"
                for seed in range(first_seed, first_seed + seeds):
                    rows.setdefault(name, []).append(judged(bullet(gait, seed, **settings), seed, contacts))
                _show(console, name, rows)
    for name, trials in rows.items():
        table.add_row(*_row(name, trials))
    console.print(table)
    every = [t for trials in rows.values() for t in trials]
    targets = [
        Target(
            "estimates that are ok and beyond 3 std, of all that are ok",
            sum(t.bad for t in every) / max(sum(t.ok for t in every), 1),
            high=0.01,
        ),
        Target("false events a recording", sum(t.false for t in every) / len(every), high=0.05),
        Target("changes that were missed", float(sum(t.missed for t in every)), high=0.05 * len(every)),
        Target("masses inside their 95 % intervals", float(np.mean([t.inside for t in every])), low=0.9),
    ]
    return conclude("legs", targets, {name: [asdict(t) for t in trials] for name, trials in rows.items()}, json_path)


def _show(console: Console, name: str, rows: dict[str, list[Trial]]) -> None:
    for t in rows.get(name, []):
        mass = f"{t.mass:6.2f} kg {100 * t.error / t.mass:+6.2f} % std {1e3 * t.std:5.0f} g com {1e3 * t.com:5.1f} mm"
        events = f"events false {t.false} missed {t.missed}"
        inside = "inside " if t.inside else "OUTSIDE"
        text = f"{name:36} seed {t.seed:4}: {mass} {inside} {t.status:12} bad ok {t.bad}/{t.ok} {events} {t.named[:60]}"
        console.print(text, highlight=False, soft_wrap=True)


if __name__ == "__main__":
    sys.exit(main(standalone_mode=False))
