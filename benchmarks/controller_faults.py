"""What becomes of a moving arm when something goes wrong: random faults of the three nodes, each a process of its own.

The simulated arm moves under ``adaptive_controller``, with ``online_payload_estimator`` beside it. The joint states reach the
controller through this process, which may lose, delay, or spoil them. Each run begins a motion, lets one fault happen at a random
moment of it, and watches the arm itself for two seconds:

- a limit passed: efforts beyond the URDF's, or a joint faster than it allows;
- how far the joint that moved furthest went after the fault, and by how much a joint became faster than it was; where the motion
  may go on, how far the arm was from it instead;
- whether it came to rest within 2 s, where the motion leads or elsewhere, and whether it reached the end of its motion;
  whether ``/diagnostics`` or a node's output name the cause.

A histogram of the distances stands at the end. Exit codes: 0 every target held; 1 one was missed; 2 bad usage.

Example: python benchmarks/controller_faults.py --runs 200 --json controller_faults.json
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(os.getpid() % 100))
os.environ.setdefault("ROS_LOG_DIR", tempfile.mkdtemp(prefix="controller_faults_"))

from collections import Counter  # noqa: E402

import click  # noqa: E402
import numpy as np  # noqa: E402
from fault_bench import FAULTS, FaultBench, Outcome  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.progress import track  # noqa: E402
from rich.table import Table  # noqa: E402
from verdict import Target, conclude  # noqa: E402

MOST_MOVED, MOST_FASTER = 0.15, 0.5


@click.command(context_settings={"show_default": True})
@click.option("--runs", default=40, help="How many faults.")
@click.option("--seed", default=0, help="Of motions, faults and moments.")
@click.option("--only", default="", help="This fault alone.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write the results there.")
def main(runs: int, seed: int, only: str, json_path: Path | None) -> None:
    """Random faults while an arm moves."""
    if only and only not in {fault.name for fault in FAULTS}:
        raise click.UsageError(f"--only is {only!r}; it must be one of {', '.join(fault.name for fault in FAULTS)}.")
    rng = np.random.default_rng(seed)
    faults = [fault for fault in FAULTS if only in ("", fault.name)]
    console = Console(width=130)
    outcomes: list[Outcome] = []
    order = [faults[k % len(faults)] for k in range(runs)]
    rng.shuffle(order)
    half = (runs + 1) // 2
    for executor, part in (("events", order[:half]), ("single", order[half:])):
        if part:
            with FaultBench(executor, rng) as bench:
                outcomes += [bench.run(fault) for fault in track(part, f"{executor} executor", disable=not console.is_terminal)]
    show(console, outcomes)
    sys.exit(conclude("controller_faults", targets(outcomes), {"runs": [o._asdict() for o in outcomes]}, json_path))


def targets(outcomes: list[Outcome]) -> list[Target]:
    """What the arm must never do."""
    return [
        Target("runs in which a limit of torque or speed was passed", sum(o.limit_passed for o in outcomes), high=0),
        Target("furthest that a joint moved after the fault (rad)", max(o.moved for o in outcomes), high=MOST_MOVED),
        Target("most that a joint became faster (rad/s)", max(o.faster for o in outcomes), high=MOST_FASTER),
        Target("runs without rest or recovery within 2 s", sum(not o.settled for o in outcomes), high=0),
        Target("runs in which nobody named the cause", sum(not o.named for o in outcomes), high=0),
        Target("stacks printed", sum(o.stacks for o in outcomes), high=0),
    ]


def show(console: Console, outcomes: list[Outcome]) -> None:
    """A row a fault, and the histogram."""
    table = Table(title="Worst of each fault", title_justify="left")
    for column in ("fault", "runs", "moved (rad)", "faster (rad/s)", "settled", "reached", "named", "said"):
        table.add_column(column, justify="left" if column in ("fault", "said") else "right", overflow="ellipsis")
    for name in dict.fromkeys(o.fault for o in outcomes):
        of = [o for o in outcomes if o.fault == name]
        counts = [str(len(of)), f"{max(o.moved for o in of):.3f}", f"{max(o.faster for o in of):.2f}"]
        counts += [f"{sum(o.settled for o in of)}", f"{sum(o.reached for o in of)}", f"{sum(o.named for o in of)}"]
        table.add_row(name, *counts, of[-1].said[:60])
    console.print(table)
    edges = np.arange(0.0, 0.21, 0.02)
    bins: Counter[int] = Counter(min(int(o.moved / 0.02), len(edges) - 1) for o in outcomes)
    for k, low in enumerate(edges):
        console.print(f"{low:5.2f} rad  {'#' * bins[k]} {bins[k]}", highlight=False)


if __name__ == "__main__":
    main()
