"""DeePC on a simulated joint with friction beside PD and computed torque, and on noise-free linear data beside the model's MPC.

    python benchmarks/deepc.py [--seeds 10] [--json FILE]

One joint with gravity, viscous and Coulomb friction and an encoder follows a sum of sines. PD knows nothing, computed torque the
inertia and gravity but no friction, and DeePC has what PD recorded in 8 s with noise added to its torque. The time of a step is
processor time of the whole law.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table

# in place of this folder, in which another benchmark has the name of a peer
sys.path[0] = str(Path(__file__).resolve().parent)

from verdict import Target, conclude  # noqa: E402

from sysid_ros.blackbox import Series, StateSpace  # noqa: E402
from sysid_ros.control.data_enabled import DeePC, PredictiveSettings, SubspacePredictive  # noqa: E402
from sysid_ros.simulation.friction_joint import follow  # noqa: E402


def equivalence(systems: int) -> tuple[float, float]:
    """Largest difference of inputs from DeePC and from the model's predictive control on noise-free data, with limits and
    without; and the longest processor time of a step [s]."""
    worst, slowest = 0.0, 0.0
    for seed in range(systems):
        rng = np.random.default_rng(seed)
        A = rng.standard_normal((4, 4))
        A *= 0.9 / max(abs(np.linalg.eigvals(A)))
        B, C = rng.standard_normal((4, 1)), rng.standard_normal((1, 4))
        model = StateSpace(A, B, C, np.zeros((1, 1)), np.zeros((4, 1)), 0.1, np.zeros((4, 0)), np.zeros((1, 1)))
        u = rng.standard_normal((300, 1))
        data = Series(u, model.simulate(u, rng.standard_normal(4)), 0.1)
        given = data.u[50:56], data.y[50:56], rng.standard_normal((12, 1))
        for limit in (0.3, np.inf):
            settings = PredictiveSettings(past=6, horizon=12, input_weight=0.1, limit=limit, solver="CLARABEL")
            law, other = DeePC([data], settings), SubspacePredictive(model, settings)
            worst = max(worst, float(np.max(np.abs(law.inputs(*given) - other.inputs(*given)))))
            times = []
            for _ in range(20):
                began = time.thread_time()
                law.inputs(*given)
                times.append(time.thread_time() - began)
            slowest = max(slowest, float(np.median(times)))
    return worst, slowest


@click.command()
@click.option("--seeds", default=10, show_default=True)
@click.option("--seed-base", default=100, show_default=True)
@click.option("--json", "json_path", type=click.Path(path_type=Path))
def main(seeds: int, seed_base: int, json_path: Path | None) -> None:
    """Tracking errors and times."""
    errors: dict[str, list[float]] = {}
    slowest = 0.0
    for seed in range(seed_base, seed_base + seeds):
        for run in follow(seed):
            errors.setdefault(run.law, []).append(1e3 * run.rms)
            slowest = max(slowest, run.step) if run.law == "deepc" else slowest
    same, limited = equivalence(20)
    table = Table(title="Tracking error of a joint with friction, rms [mrad]", title_justify="left")
    for column in ("law", "median", "worst"):
        table.add_column(column)
    for name, values in errors.items():
        table.add_row(name, f"{np.median(values):.3g}", f"{np.max(values):.3g}")
    Console(width=130).print(table)
    ratio = float(np.median(errors["deepc"]) / np.median(errors["computed_torque"]))
    targets = [
        Target("inputs of DeePC less those of the model's predictive control, noise-free, largest", same, high=1e-6),
        Target("error of DeePC over that of computed torque, median", ratio, high=1.0),
        Target("processor time of a step of the joint, 99 % of them [ms]", 1e3 * slowest, high=5.0),
        Target(
            "processor time of a step with active limits (Clarabel), median of the slowest system [ms]", 1e3 * limited, high=5.0
        ),
    ]
    raise SystemExit(conclude("deepc", targets, {"errors_mrad": errors}, json_path))


if __name__ == "__main__":
    main()
