"""Tracking while a payload is picked up that no law knows, beside computed torque without and with the truth.

Each seed draws another motion, payload (0.5 to 4 kg, up to 0.1 m off the flange) and noise; all laws follow the same. Three arms:
an ideal one; one with friction that the URDF does not tell; the same with the model that 'sysid identify' made of 40 s without
payload.

    python benchmarks/tracking.py --seeds 10 --json tracking.json
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from sysid_ros.cli.main import run
from sysid_ros.control.tracking_run import TrackingRun
from sysid_ros.simulation import ArmScenario
from sysid_ros.simulation.tracking import TRACKED, track
from sysid_ros.torque.model_file import ModelFile

PICK, DROP, END = 6.0, 12.0, 15.0
PHASES = {
    "empty": (1.0, PICK),
    "just picked up": (PICK, PICK + 2.0),
    "carrying": (PICK + 2.0, DROP),
    "dropped": (DROP + 2.0, END),
}
FRICTION = {"viscous_friction": (2.0, 2.0, 1.5, 1.5, 0.5, 0.5, 0.3), "coulomb_friction": (3.0, 3.0, 2.0, 2.0, 0.6, 0.6, 0.4)}


def identified(folder: Path) -> ModelFile:
    """The model of an empty run with the same friction, of a seed that is not among those judged."""
    values = [f"--{name.replace('_', '-')}={','.join(map(str, value))}" for name, value in FRICTION.items()]
    bag, model = folder / "empty", folder / "model.yaml"
    assert run(["simulate", "arm", "--bag", str(bag), "--duration", "40", "--seed", "1000", *values]) == 0
    assert run(["identify", str(bag), "--out", str(model)]) == 0
    return ModelFile.read(model)


def scenario(seed: int, friction: dict[str, Any]) -> ArmScenario:
    draw = np.random.default_rng(seed)
    com = (*draw.uniform(-0.07, 0.07, 2), draw.uniform(0.02, 0.1))
    mass = float(draw.uniform(0.5, 4.0))
    return ArmScenario(seed=seed, duration=END, payload_mass=mass, payload_com=com, pick_time=PICK, drop_time=DROP, **friction)


def believed(run: TrackingRun) -> float:
    """Mean mass that the law believes in while it carries the payload and has had time to learn [kg]."""
    begin, end = PHASES["carrying"]
    return float(run.mass[(run.t >= begin) & (run.t < end)].mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    out: dict[str, Any] = {"seeds": arguments.seeds, "first": arguments.first, "arms": {}}
    with tempfile.TemporaryDirectory() as folder:
        known = identified(Path(folder))
    arms = {"ideal": ({}, None), "friction unknown": (FRICTION, None), "friction identified": (FRICTION, known)}
    for arm, (friction, model) in arms.items():
        cases = [scenario(seed, friction) for seed in range(arguments.first, arguments.first + arguments.seeds)]
        title = f"{arm}: tip from its path, rms in mm, median and worst of {arguments.seeds} seeds"
        table = Table("law", title=title, title_justify="left")
        for name in (*PHASES, "mass error while carrying, %", "lost"):
            table.add_column(name, justify="right")
        rows = {}
        for law in TRACKED:
            runs = [(case, track(law, case, known=model)) for case in cases]
            kept = [(case, r) for case, r in runs if r.lost is None]
            errors = {name: [1e3 * r.tip_rms(*phase) for _, r in kept] for name, phase in PHASES.items()}
            masses = [abs(believed(r) / float(case.payload_mass or 1.0) - 1.0) for case, r in kept]
            rows[law] = {"tip_rms_mm": errors, "relative_mass_error": masses, "lost": len(runs) - len(kept)}
            cells = [f"{np.median(e):.2f}, {max(e):.2f}" if e else "-" for e in errors.values()]
            table.add_row(law, *cells, f"{100 * float(np.median(masses)):.1f}" if masses else "-", str(len(runs) - len(kept)))
        Console(width=150).print(table)
        out["arms"][arm] = rows
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
