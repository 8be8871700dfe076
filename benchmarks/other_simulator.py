"""Diagnosis of arms from a simulator that shares nothing with the package: what is named, how large, and what is claimed beside.

Arms of example-robot-data (five makes) are simulated by MuJoCo (``mujoco_arm.py``) with everything a little wrong and one thing
more, 30 s to fit and 20 s of another motion to judge on. ``named``: the hidden effect is told with a probability above one half,
on its joint. ``inside``: its sizes are in their 95 % intervals. ``beside``: effects that are claimed so and were not hidden; what
every joint has (friction, rotors, offsets, a delay of 0.5 to 2 ms) is not counted.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from mujoco_arm import KINDS, STYLES, Arm, bare
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel

ARMS = ("panda", "ur3_robot", "ur5_robot", "ur10_robot", "kinova", "xarm7", "z1")
TOLD_AS = {"coulomb_friction": {"coulomb_friction", "stribeck_friction"}}
"""What else a hidden effect may be told as: dry friction is higher at low speed on every joint here."""
EVERY_JOINTS = {
    "coulomb_friction",
    "viscous_friction",
    "stribeck_friction",
    "asymmetric_coulomb_friction",
    "presliding_hysteresis",
    "rotor_inertia",
    "torque_offset",
    "time_delay",
}


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of one arm. ``left``: part of the held-out error that stays above the noise."""

    seed: int
    arm: str
    kind: str
    verdict: str
    named: bool
    inside: int
    sizes: int
    beside: tuple[str, ...]
    left: float
    seconds: float


def text_of(arm: str) -> str:
    """The arm's URDF without friction and meshes."""
    path = packaged(arm)
    if path is None:
        raise click.ClickException("example-robot-data is not installed: pip install '.[dev]'")
    return bare(path.read_text())


def trial(seed: int) -> Trial:
    """One arm, simulated and diagnosed."""
    from sysid_ros.diagnosis import diagnose
    from sysid_ros.signals.recording import Recording

    rng = np.random.default_rng(seed)
    name, kind = str(rng.choice(ARMS)), KINDS[seed % len(KINDS)]
    urdf = text_of(name)
    arm = Arm(urdf, kind, rng)
    recordings = []
    for what, seconds, start in (("fit", 30.0, 100.0), ("judge", 20.0, 160.0)):
        t, q, v, tau = arm.measured(arm.path(seconds, str(rng.choice(STYLES))), start)
        recordings.append(Recording(name=what, t=t, q=q, v=v, tau=tau))
    begin = time.process_time()
    found = diagnose(RobotModel.from_urdf(urdf, arm.names), recordings[:1], recordings[1:], simulator="mujoco").as_dict()
    seconds = time.process_time() - begin
    told = [e for e in found["effects"] if e["evidence"]["heldout_gain"] is not None and (e["probability"] or 0.0) > 0.5]
    own = [e for e in told if e["name"] in TOLD_AS.get(kind, {kind}) and arm.names[arm.truth.joint] in e["joints"]]
    inside = [x for e in own[:1] for x in _inside(arm, e)]
    beside = tuple(sorted({e["name"] for e in told} - EVERY_JOINTS - {kind}))
    named = bool(own) or kind == "none"
    left = found["unexplained_fraction"]
    return Trial(
        seed, name, kind, found["verdict"], named, sum(inside), len(inside), beside, np.nan if left is None else left, seconds
    )


def _inside(arm: Arm, effect: dict[str, Any]) -> list[bool]:
    """Whether each size that was hidden is in the interval that is told."""
    out = []
    for parameter in effect["parameters"]:
        if parameter["name"] in arm.truth.size and parameter["joint"] in (None, arm.names[arm.truth.joint]):
            low, high = (np.atleast_1d(x) for x in parameter["ci95"])
            out += [bool(a <= x <= b) for x, a, b in zip(arm.truth.size[parameter["name"]], low, high, strict=True)]
    return out


@click.command(help=(__doc__ or "").replace("\n\n", "\n\n\b\n", 1))
@click.option("--cases", default=26, show_default=True, help="How many arms, of each kind in turn.")
@click.option("--first-seed", default=0, show_default=True)
@click.option("--jobs", default=2, show_default=True, help="Processes.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), default=None)
def main(cases: int, first_seed: int, jobs: int, json_path: Path | None) -> None:
    table = Table(title="Arms of another simulator", title_justify="left")
    for column in ("seed", "arm", "hidden", "verdict", "named", "inside", "beside", "left", "s"):
        table.add_column(column)
    with ProcessPoolExecutor(jobs) as pool:
        trials = list(pool.map(trial, range(first_seed, first_seed + cases)))
    for x in trials:
        row = (x.seed, x.arm, x.kind, x.verdict, "yes" if x.named else "NO", f"{x.inside} of {x.sizes}", ", ".join(x.beside))
        table.add_row(*map(str, row), f"{x.left:.1%}", f"{x.seconds:.0f}")
    Console(width=150).print(table)
    sizes = max(sum(x.sizes for x in trials), 1)
    targets = [
        Target("right URDFs refused", sum(x.verdict == "refused" for x in trials), high=0.01 * cases),
        Target("hidden effect named", float(np.mean([x.named for x in trials])), low=0.95),
        Target("its sizes inside their 95 % interval", sum(x.inside for x in trials) / sizes, 0.90, 0.98),
        Target("effects claimed beside it, an arm", sum(len(x.beside) for x in trials) / cases, high=0.05),
    ]
    sys.exit(conclude("other_simulator", targets, {"trials": [asdict(x) for x in trials]}, json_path))


if __name__ == "__main__":
    main()
