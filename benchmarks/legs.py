"""What the live estimator says of robots on legs that are not as their description says, in MuJoCo and in PyBullet.

Each recording is of a robot whose joints hold positions (MuJoCo: hard impacts) or whose torques are controlled (PyBullet); a load
is carried, from the start or put on and taken off. In MuJoCo legs have dry friction of 0.1 to 0.5 N m (on 16 kg; more on larger
ones), viscous friction and rotors that nobody tells, encoders have steps of 1e-4 rad, and the IMU has its own rate and a bias.
Conditions add what else is wrong, see ``legs_trial.py``: feet that no description tells, an IMU that is tilted, elsewhere, late
or aliased, contact flags that are late, wrong, inverted or absent, links of other mass, a push.

A row of the table is a simulator, robot, gait and condition. ``near`` are masses within what is asked: of a load 2 % (standing,
swaying, stepping), 4 % (flying trot) or 2.5 %, or 80 g if more, half again as much without spheres; of an empty robot 80 g or
0.7 % of it, or 30 g after a tare; ``but links``, masses that would be if it were known by how much the links are off, which
nothing tells from a load without a tare. ``within`` are places of the load within 8 mm across gravity. ``bad ok`` are estimates
more than 3 s after the begin, and 1 s after a change, whose status is ok and whose mass is beyond 3 standard deviations.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path

import click
import numpy as np
from legs_trial import COM, CONDITIONS, Task, Trial, run
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

_HEADS = (
    "", "mass %", "most", "std g", "near", "but\nlinks", "com mm", "within", "95 %", "ok %", "bad ok", "in runs", "worst",
    "events\nfalse/missed", "late s", "names\nIMU",
)  # fmt: skip


def _row(name: str, trials: list[Trial]) -> tuple[str, ...]:
    part = [100.0 * abs(t.error) / (t.mass or t.robot) for t in trials]
    ok, count, bad = sum(t.ok for t in trials), sum(t.count for t in trials), sum(t.bad for t in trials)
    late = [x for t in trials for x in t.late]
    return (
        name,
        f"{np.median(part):.2f}",
        f"{max(part):.2f}",
        f"{1e3 * float(np.median([t.std for t in trials])):.0f}",
        f"{sum(t.near for t in trials)}/{len(trials)}",
        f"{sum(t.beside for t in trials)}/{len(trials)}",
        f"{1e3 * float(np.median([t.com for t in trials])):.1f}",
        f"{sum(t.com <= COM for t in trials)}/{len(trials)}",
        f"{sum(t.inside for t in trials)}/{len(trials)}",
        f"{100 * ok / max(count, 1):.0f}",
        f"{bad}",
        f"{sum(t.bad > 0 for t in trials)}",
        f"{max(t.worst for t in trials):.1f}",
        f"{sum(t.false for t in trials)}/{sum(t.missed for t in trials)}",
        f"{max(late):.2f}" if late else "",
        f"{sum(bool(t.named) for t in trials)}",
    )


def _told(t: Trial) -> str:
    mass = f"{t.mass:6.2f} kg {1e3 * t.error:+6.0f} g (links {1e3 * t.links:+5.0f}) std {1e3 * t.std:5.0f} g"
    events = f"events false {t.false} missed {t.missed}"
    said = f"com {1e3 * t.com:5.1f} mm {'near' if t.near else 'far '}{'' if t.inside else ' OUTSIDE'} {t.status:12}"
    told = f"bad ok {t.bad}/{t.ok} worst {t.worst:.1f} {events} {t.named[:60]}"
    return f"{t.task.line:44} seed {t.task.seed:4}: {mass} {said} {told}"


def _every(tasks: list[Task], jobs: int) -> Iterator[Trial | str]:
    if jobs == 1:
        yield from map(run, tasks)
        return
    with ProcessPoolExecutor(jobs) as pool:
        for future in as_completed([pool.submit(run, task) for task in tasks]):
            yield future.result()


def _targets(every: list[Trial]) -> list[Target]:
    loaded = [t for t in every if t.mass > 0.0]
    targets = [
        Target(
            "estimates that are ok and beyond 3 std, of all that are ok",
            sum(t.bad for t in every) / max(sum(t.ok for t in every), 1),
            high=0.01,
        ),
        Target("masses as near as is asked", float(np.mean([t.near for t in every])), low=0.9),
        Target("masses inside their 95 % intervals", float(np.mean([t.inside for t in every])), low=0.9, high=0.99),
        Target("false events a recording", sum(t.false for t in every) / len(every), high=0.05),
        Target("changes that were missed", float(sum(t.missed for t in every)), high=0.05 * len(every)),
    ]
    if loaded:
        targets.append(Target("coms within 8 mm across gravity", float(np.mean([t.com <= COM for t in loaded])), low=0.9))
    return targets


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--simulator", type=click.Choice(["mujoco", "pybullet", "both"]), default="both", show_default=True)
@click.option("--robots", default="go2,a1,anymal", show_default=True, help="By name; PyBullet has a1.")
@click.option("--gaits", default="stand,sway,step,trot,flying_trot", show_default=True)
@click.option("--conditions", default=",".join(CONDITIONS), help="Some of the conditions; all of them without.")
@click.option("--seeds", type=click.IntRange(1), default=3, show_default=True, help="Recordings a row.")
@click.option("--first-seed", type=int, default=0, show_default=True)
@click.option("--seconds", type=click.FloatRange(0.0), default=0.0, help="Of a recording; that of the condition without. [s]")
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Processes.")
@click.option("--json", "json_path", type=click.Path(path_type=Path, dir_okay=False), help="Write the results.")
def main(
    simulator: str, robots: str, gaits: str, conditions: str, seeds: int, first_seed: int, seconds: float, jobs: int,
    json_path: Path | None,
) -> int:  # fmt: skip
    """Robots on legs that are not as they are told to be; a recording takes 10 s.

    \b
    Examples:
      python benchmarks/legs.py --simulator mujoco --conditions "links 2 %" --seeds 20 --first-seed 900 --jobs 2
      python benchmarks/legs.py --robots go2 --gaits trot --conditions "plain,no sphere" --seeds 5
    """
    unknown = sorted(set(conditions.split(",")) - set(CONDITIONS))
    if unknown:
        raise click.UsageError(f"conditions has {', '.join(unknown)}; it has some of {', '.join(CONDITIONS)}.")
    simulators = ("mujoco", "pybullet") if simulator == "both" else (simulator,)
    tasks = [
        Task(condition, each, robot, gait, seed, seconds)
        for condition in conditions.split(",")
        for gait in gaits.split(",")
        for each in simulators
        for robot in robots.split(",")
        for seed in range(first_seed, first_seed + seeds)
    ]
    tasks = [task for task in tasks if task.possible]
    console = Console(width=190)
    rows: dict[str, list[Trial]] = {task.line: [] for task in tasks}
    for outcome in _every(tasks, jobs):
        told = outcome if isinstance(outcome, str) else _told(outcome)
        console.print(told, highlight=False, soft_wrap=True)
        if isinstance(outcome, Trial):
            rows[outcome.task.line].append(outcome)
    table = Table(title="A load on a robot with legs", title_justify="left")
    for head in _HEADS:
        table.add_column(head, justify="left" if not head else "right")
    for name, trials in rows.items():
        if trials:
            table.add_row(*_row(name, trials))
    console.print(table)
    every = [t for trials in rows.values() for t in trials]
    if not every:
        raise click.UsageError("no recording is left: each robot fell, or the simulator has no such robot, gait or condition.")
    return conclude("legs", _targets(every), {name: [asdict(t) for t in trials] for name, trials in rows.items()}, json_path)


if __name__ == "__main__":
    sys.exit(main(standalone_mode=False))
