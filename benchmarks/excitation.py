"""How much more an exciting motion tells than random ones, within which limits, and what it costs to find.

For three arms of ``pybullet_data`` (KUKA LBR iiwa, Franka Panda without its fingers, xArm 6), or any given with ``--urdf``: a
motion of 10 s with 5 harmonics over a floor at the height of the base, as ``sysid excite`` finds it, against the random feasible
motions that it begins from. Of both, besides the criteria, what identification makes of them: torques of random parameters along
the motion at 100 Hz, noise of half a per cent of each joint's effort limit, weighted least squares on the base parameters, 200
times; the table shows how many times smaller the spread of a parameter is than with the random motion of median D (median over
the parameters).

Times are wall time of one process; the processor time, which other work on the machine hardly changes, stands beside it.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

from dataclasses import asdict
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import click
import numpy as np
import pybullet_data
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.excitation.arm_rows import ArmRows
from sysid_ros.excitation.criteria import ExcitationCriteria
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.excite import Excitation, excite
from sysid_ros.excitation.fourier_trajectory import FourierTrajectory
from sysid_ros.excitation.motion_limits import KINDS
from sysid_ros.identification import free_model
from sysid_ros.robot.collision_model import CollisionModel
from sysid_ros.robot.mesh_files import MeshFiles
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

ARMS = {
    "iiwa": ("kuka_iiwa/model.urdf", ()),
    "panda": ("franka_panda/panda.urdf", tuple(f"panda_joint{i}" for i in range(1, 8))),
    "xarm6": ("xarm/xarm6_robot.urdf", ()),
}
_NOISE = 0.005
_RUNS = 200


def search(path: Path, joints: tuple[str, ...], settings: ExcitationSettings) -> tuple[Excitation, dict[str, Any]]:
    """The motion for one arm, and its row of the table."""
    start, start_processor = perf_counter(), process_time()
    robot = RobotModel.from_urdf(path.read_text(), joints)
    collision = CollisionModel(robot, MeshFiles(path.parent), settings.clearance, settings.floor)
    model = free_model(robot)
    result = excite(model, settings, collision=collision)
    row = {
        "time": perf_counter() - start,
        "processor_time": process_time() - start_processor,
        "after": asdict(result.criteria),
        "random": [asdict(c) for c in result.random],
        "base_parameters": len(result.parameters),
        "margin": {kind: float(1.0 - result.use.limits[k].max()) for k, kind in enumerate(KINDS)},
        "room": float(result.use.room.min()) if result.pairs else None,
        "pairs": len(result.pairs),
    }
    criteria = ExcitationCriteria(ArmRows(model, result.limits))
    usual = result.random_motions[len(result.random_motions) // 2]
    row["spread_ratio"] = float(np.median(spread(criteria, usual) / spread(criteria, result.trajectory)))
    return result, row


def spread(criteria: ExcitationCriteria, trajectory: FourierTrajectory) -> FloatArray:
    """Standard deviation of the identified base parameters over runs with other noise, shape (r,)."""
    random = np.random.default_rng(0)
    Y = criteria.rows(*trajectory.sample(trajectory.grid(0.01)))
    theta = random.normal(size=Y.shape[2])
    noise = _NOISE / criteria.weight
    rows = (Y / noise[:, None]).reshape(-1, Y.shape[2])
    solve = np.linalg.pinv(rows)
    exact = rows @ theta
    found = np.array([solve @ (exact + random.normal(size=len(rows))) for _ in range(_RUNS)])
    return np.asarray(found.std(axis=0))


@click.command(help=__doc__.split("\n")[0])
@click.option("--arm", "arms", multiple=True, type=click.Choice(list(ARMS)), help="Only this arm; several may be given.")
@click.option("--urdf", "urdfs", multiple=True, type=click.Path(path_type=Path, exists=True), help="Another arm besides.")
@click.option("--seed", default=0, show_default=True)
@click.option("--starts", default=3, show_default=True, help="Local searches.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write the result for machines.")
def main(arms: tuple[str, ...], urdfs: tuple[Path, ...], seed: int, starts: int, json_path: Path | None) -> None:
    data = Path(pybullet_data.getDataPath())
    chosen = {name: (data / ARMS[name][0], ARMS[name][1]) for name in arms or (() if urdfs else ARMS)}
    chosen |= {path.stem: (path, ()) for path in urdfs}
    settings = ExcitationSettings(seed=seed, starts=starts, floor=0.0)
    table = Table(title="10 s, 5 harmonics, floor at 0; random: feasible motions", title_justify="left")
    for column in ("arm", "base\nparam.", "D random\nmedian", "D random\nbest", "D\nfound", "cond.\nrandom", "cond.\nfound",
                   "cond.\nunweighted", "spread\nratio", "time\ns", "proc.\ns"):  # fmt: skip
        table.add_column(column, justify="left" if column == "arm" else "right")
    margins = Table(title="Margin to each limit, at 1 ms", title_justify="left")
    for column in ("arm", *(f"{kind}\n%" for kind in KINDS), "pairs", "room\nmm"):
        margins.add_column(column, justify="left" if column == "arm" else "right")
    targets, results = [], {}
    for name, (path, joints) in chosen.items():
        result, row = search(path, joints, settings)
        results[name] = row
        d, c = [r["d"] for r in row["random"]], [r["condition_number"] for r in row["random"]]
        after = row["after"]
        table.add_row(
            name, str(row["base_parameters"]), f"{np.median(d):.1f}", f"{max(d):.1f}", f"{after['d']:.1f}", f"{np.median(c):.0f}",
            f"{after['condition_number']:.1f}", f"{after['unweighted_condition_number']:.1f}", f"{row['spread_ratio']:.1f}",
            f"{row['time']:.0f}", f"{row['processor_time']:.0f}",
        )  # fmt: skip
        room = "" if row["room"] is None else f"{1e3 * row['room']:.1f}"
        margins.add_row(name, *(f"{100 * row['margin'][kind]:.2f}" for kind in KINDS), str(row["pairs"]), room)
        targets += [
            Target(f"{name}: condition number", after["condition_number"], high=100.0),
            Target(f"{name}: condition number, joints weighted alike", after["unweighted_condition_number"], high=100.0),
            Target(f"{name}: D above the best of {len(d)} random feasible motions", after["d"] - max(d), low=0.0),
            Target(f"{name}: least margin to a limit [%]", 100.0 * min(row["margin"].values()), low=0.0),
            Target(f"{name}: spread of parameters, random over found", row["spread_ratio"], low=1.0),
            Target(f"{name}: time [s]", row["time"], high=120.0),
        ]
        if row["room"] is not None:
            targets.append(Target(f"{name}: least room to a collision [mm]", 1e3 * row["room"], low=0.0))
        assert result.use.feasible
    console = Console(width=130)
    console.print(table)
    console.print(margins)
    raise SystemExit(conclude("excitation", targets, results, json_path))


if __name__ == "__main__":
    main()
