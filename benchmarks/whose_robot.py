"""Whose torques they are: right URDFs and those of other arms, on arms from a simulator that shares nothing with the package.

Arms of example-robot-data (``other_simulator.py``) are simulated by MuJoCo with everything a little wrong and one thing more,
30 s each. Each recording is judged with its own arm's URDF and with those of two other arms that have as many joints, the nearest
kin first: a UR5's torques with the URDFs of a UR3 and a UR10.
``refused``: nothing is said with that URDF. ``out-ranked``: among several URDFs the right one is likelier.
The peer is what a fit says: a URDF is refused where it leaves, with offset and friction of each joint fitted by least squares,
over half of the variance of most joints.

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

import click
import numpy as np
from mujoco_arm import KINDS, STYLES, Arm
from other_simulator import ARMS, text_of
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.diagnosis.whose.coarse_rows import CoarseRows
from sysid_ros.diagnosis.whose.robot_hypotheses import judge
from sysid_ros.diagnosis.whose.robot_likelihood import likeliest, probabilities
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording

_OTHERS = 2


@dataclass(frozen=True, slots=True)
class Trial:
    """One recording with one URDF."""

    seed: int
    arm: str
    hidden: str
    urdf: str
    probability: float
    refused: bool
    outranked: bool
    faults: tuple[str, ...]
    fit_refuses: bool
    seconds: float

    @property
    def right(self) -> bool:
        return self.arm == self.urdf


def joints_of(text: str) -> tuple[str, ...]:
    """Names of the joints that are simulated."""
    return tuple(Arm(text, "none", np.random.default_rng(0)).names)


def kin(arm: str, joints: int) -> list[str]:
    """Other arms with as many joints, of the same maker first."""
    others = [x for x in ARMS if x != arm and len(joints_of(text_of(x))) == joints]
    return sorted(others, key=lambda x: x[:2] != arm[:2])[:_OTHERS]


def fit_refuses(robot: RobotModel, rows: CoarseRows) -> bool:
    """The peer's answer."""
    model = robot.regressor_along(rows.q, rows.v, rows.a) @ robot.pi
    left = []
    for j in range(robot.n):
        X, y = rows.plain(j), rows.tau[:, j] - model[:, j]
        left.append(np.var(y - X @ np.linalg.lstsq(X, y, rcond=None)[0]) / np.var(rows.tau[:, j]))
    return bool(np.median(left) > 0.5)


def trials(seed: int) -> list[Trial]:
    """One recording with its own arm's URDF, then with others'."""
    rng = np.random.default_rng(seed)
    name, kind = str(rng.choice(ARMS)), KINDS[seed % len(KINDS)]
    arm = Arm(text_of(name), kind, rng)
    t, q, v, tau = arm.measured(arm.path(30.0, str(rng.choice(STYLES))), 100.0)
    recording, out, own = Recording(name="fit", t=t, q=q, v=v, tau=tau), [], None
    for urdf in (name, *kin(name, len(arm.names))):
        robot = RobotModel.from_urdf(text_of(urdf), joints_of(text_of(urdf)))
        begin = time.process_time()
        found, rows = judge(robot, [recording]), CoarseRows.of(robot, [recording])
        seconds = time.process_time() - begin
        assert found is not None
        assert rows is not None
        rows_of_it = likeliest(found.urdf)
        own = rows_of_it if own is None else own
        out.append(
            Trial(
                seed, name, kind, urdf, found.probability, found.refusal is not None,
                urdf != name and bool(probabilities([own, rows_of_it])[0] > 0.5),
                tuple(fault.effect.id for fault in found.faults), fit_refuses(robot, rows), seconds,
            )
        )  # fmt: skip
    return out


@click.command(help=(__doc__ or "").replace("\n\n", "\n\n\b\n", 1))
@click.option("--cases", default=50, show_default=True, help="How many recordings.")
@click.option("--first-seed", default=0, show_default=True)
@click.option("--jobs", default=2, show_default=True, help="Processes.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), default=None)
def main(cases: int, first_seed: int, jobs: int, json_path: Path | None) -> None:
    found: list[Trial] = []
    with ProcessPoolExecutor(jobs) as pool:
        for each in pool.map(trials, range(first_seed, first_seed + cases)):
            found += each
            for x in (x for x in each if x.refused is x.right):
                print(f"seed {x.seed}: {x.arm}, {x.hidden}, {x.urdf}: {x.probability:.3f} {', '.join(x.faults)}", flush=True)
    right, wrong = [x for x in found if x.right], [x for x in found if not x.right]
    table = Table(title="Arms of another simulator, with their own and with other URDFs", title_justify="left")
    for column in ("arm", "right", "refused", "a fit refuses", "others", "refused", "out-ranked", "a fit refuses"):
        table.add_column(column, justify="left" if column == "arm" else "right")
    for name in (*ARMS, "all"):
        own, others = ([x for x in each if name in (x.arm, "all")] for each in (right, wrong))
        counts = [len(own), sum(x.refused for x in own), sum(x.fit_refuses for x in own), len(others)]
        counts += [sum(x.refused for x in others), sum(x.outranked for x in others), sum(x.fit_refuses for x in others)]
        table.add_row(name, *map(str, counts))
    Console(width=120).print(table)
    targets = [
        Target("right URDFs refused", sum(x.refused for x in right), high=0.0),
        Target("other URDFs refused or out-ranked", float(np.mean([x.refused or x.outranked for x in wrong])), low=0.95),
        Target("faults of the channels found with the right URDF", sum(bool(x.faults) for x in right), high=0.0),
    ]
    sys.exit(conclude("whose_robot", targets, {"trials": [asdict(x) for x in found]}, json_path))


if __name__ == "__main__":
    main()
