"""The live estimate on arms from a simulator that shares nothing with the package: wrong answers it is sure of, and events.

Arms of example-robot-data (five makes) are simulated by MuJoCo (``mujoco_arm.py``) with everything a little wrong. In turn they
are empty, carry something from the start, or pick it up after 12 s of 24 s; after those the same with efforts that the driver
has compensated for gravity by the nominal model, which nobody told the estimator. The URDF is given and nothing identified.
``wrong``: estimates called ``ok`` or ``no_payload`` whose mass is beyond three of their standard deviations, half a second
around the pick apart. ``false`` and ``missed``: events, of picks of 0.2 kg and more.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import mujoco
import numpy as np
from mujoco_arm import PICK, STYLES, Arm, FloatArray
from other_simulator import ARMS, text_of
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.input_gate import InputGate
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.replay import Replay, replay
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import JointStateRecord

KINDS = {"empty": "none", "carries": "payload", "picks": "payload_change"}
EFFORTS = ("whole", "compensated")
SECONDS, AROUND, SEEN, SMALL = 24.0, 0.5, 3.0, 0.2
"""Of a motion; around the pick nothing is judged; so soon its event is found [s]; lighter ones need not be found [kg]."""


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of one arm. ``sure``: estimates called ok or no_payload; ``wrong``: of those. ``worst``: of those, in standard
    deviations. ``error``, ``std``: at the end [kg]. ``statuses``: how many estimates had each."""

    seed: int
    arm: str
    kind: str
    efforts: str
    mass: float
    rate: float
    sure: int
    wrong: int
    worst: float
    error: float
    std: float
    false: int
    missed: int
    statuses: dict[str, int]


def gravity(arm: Arm, q: FloatArray) -> FloatArray:
    """What the nominal arm weighs on its joints, shape (N, n) [N m]."""
    data, out = mujoco.MjData(arm.nominal), np.empty_like(q)
    for place, row in zip(q, out, strict=True):
        data.qpos[:] = place
        mujoco.mj_forward(arm.nominal, data)
        row[:] = data.qfrc_bias
    return out


def run(urdf: str, arm: Arm, rng: np.random.Generator, efforts: str) -> tuple[Replay, float]:
    """The estimates along one motion, and how many messages come a second."""
    t, q, v, tau = arm.measured(arm.path(SECONDS, str(rng.choice(STYLES))), 100.0)
    if efforts == "compensated":
        tau = tau - gravity(arm, q)
    robot, settings = RobotModel.from_urdf(urdf, arm.names), OnlineSettings()
    speeds = np.empty((len(t), 0)) if v is None else v
    records = [
        JointStateRecord(at, at, robot.joint_names, place, speed, torque)
        for at, place, speed, torque in zip(t.tolist(), q, speeds, tau, strict=True)
    ]
    return replay(records, InputGate(robot, settings), OnlineEstimation(robot, settings)), 1.0 / (t[1] - t[0])


def trial(seed: int) -> Trial:
    """One arm, simulated and estimated."""
    rng = np.random.default_rng([seed, 11])
    name, kind = str(rng.choice(ARMS)), list(KINDS)[seed % len(KINDS)]
    efforts = EFFORTS[seed // len(KINDS) % len(EFFORTS)]
    urdf = text_of(name)
    arm = Arm(urdf, KINDS[kind], rng)
    result, rate = run(urdf, arm, rng, efforts)
    mass = arm.truth.size.get("mass", [0.0])[0]
    changes = [100.0 + PICK] if kind == "picks" else []
    judged = [
        (abs(float(e.theta[0]) - (mass if kind == "carries" or (kind == "picks" and e.t > 100.0 + PICK) else 0.0)) / e.mass_std)
        for e in result.series
        if e.status in ("ok", "no_payload") and all(abs(e.t - at) > AROUND for at in changes)
    ]
    found = [e.t for e in result.events]
    missed = sum(not any(-0.2 < t - at < SEEN for t in found) for at in changes if mass >= SMALL)
    false = sum(not any(-0.2 < t - at < SEEN for at in changes) for t in found)
    statuses: dict[str, int] = {}
    for e in result.series:
        statuses[e.status] = statuses.get(e.status, 0) + 1
    error = float(result.final.theta[0]) - mass
    return Trial(
        seed, name, kind, efforts, mass, rate, len(judged), sum(x > 3.0 for x in judged), max(judged, default=0.0),
        error, result.final.mass_std, false, missed, statuses,
    )  # fmt: skip


@click.command(help=(__doc__ or "").replace("\n\n", "\n\n\b\n", 1))
@click.option("--cases", default=48, show_default=True, help="How many arms.")
@click.option("--first-seed", default=0, show_default=True)
@click.option("--jobs", default=2, show_default=True, help="Processes.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), default=None)
def main(cases: int, first_seed: int, jobs: int, json_path: Path | None) -> None:
    table = Table(title="The live estimate on arms of another simulator", title_justify="left")
    for column in (
        "seed",
        "arm",
        "",
        "efforts",
        "kg",
        "Hz",
        "sure",
        "wrong",
        "worst",
        "error",
        "std",
        "false",
        "missed",
        "statuses",
    ):
        table.add_column(column)
    with ProcessPoolExecutor(jobs) as pool:
        trials = list(pool.map(trial, range(first_seed, first_seed + cases)))
    for x in trials:
        said = " ".join(f"{n} {status}" for status, n in x.statuses.items())
        row = x.seed, x.arm, x.kind, x.efforts, f"{x.mass:.2f}", f"{x.rate:.0f}", x.sure, x.wrong, f"{x.worst:.1f}"
        table.add_row(*map(str, row), f"{x.error:+.2f}", f"{x.std:.2f}", str(x.false or ""), str(x.missed or ""), said)
    Console(width=190).print(table)
    whole = [x for x in trials if x.efforts == "whole"]
    hidden = [x for x in trials if x.efforts == "compensated"]
    sure = max(sum(x.sure for x in whole), 1)
    estimates = max(sum(sum(x.statuses.values()) for x in hidden), 1)
    targets = [
        Target("sure and beyond 3 std, of whole efforts", sum(x.wrong for x in whole) / sure, high=0.01),
        Target("arms with whole efforts that were ever sure", sum(x.sure > 0 for x in whole) / max(len(whole), 1), low=0.9),
        Target(
            "sure and beyond 3 std, of all estimates of compensated efforts", sum(x.wrong for x in hidden) / estimates, high=0.01
        ),
        Target("false events an arm, whole efforts", sum(x.false for x in whole) / max(len(whole), 1), high=0.05),
        Target("picks missed, whole efforts", sum(x.missed for x in whole) / max(len(whole), 1), high=0.05),
    ]
    sys.exit(conclude("other_simulator_live", targets, {"trials": [asdict(x) for x in trials]}, json_path))


if __name__ == "__main__":
    main()
