"""Two arms on one machine, each with an estimator and a controller of its own in a namespace of its own.

Each arm follows motions, picks up 1 kg that nobody tells it, and follows more. Judged are the distance from its motion, before
and from 2 s after the pick on, and the mass that its estimator tells at the end.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.

Example: python benchmarks/two_robots.py --json two_robots.json
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(os.getpid() % 100))
os.environ.setdefault("ROS_LOG_DIR", tempfile.mkdtemp(prefix="two_robots_"))

import click  # noqa: E402
import numpy as np  # noqa: E402
from fault_bench import FaultBench  # noqa: E402
from geometry_msgs.msg import InertiaStamped  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.table import Table  # noqa: E402
from verdict import Target, conclude  # noqa: E402

MASS = 1.0


class OneRobot(FaultBench):
    """One of the two."""

    def follow(self, seconds: float) -> float:
        """Motion after motion for so long; rms of the distance from it, over joints and time [rad]."""
        away: list[float] = []
        while seconds > 0.0:
            goal = np.array(self.home) + self._rng.uniform(-0.5, 0.5, self.robot.n)
            duration = max(1.2, 2.2 * float(np.abs(goal - self._seen[-1][1]).max()))
            begin = len(self._away)
            self._begin_motion(goal, duration)
            self._spin(duration)
            away += self._away[begin:]
            seconds -= duration
        return float(np.sqrt(np.mean(np.square(away))))

    def measure(self, seconds: float) -> dict[str, Any]:
        """One robot's figures."""
        self._prepare()
        self.home = self._seen[-1][1]
        told: list[InertiaStamped] = []
        topic = "online_payload_estimator/payload_valid"
        kept = self.node.create_subscription(InertiaStamped, topic, told.append, 10)
        empty = self.follow(seconds)
        self._call("simulated_robot/pick")
        self.follow(2.0)
        carrying = self.follow(seconds)
        self.node.destroy_subscription(kept)
        mass = told[-1].inertia.m if told else None
        return {"empty_rad": empty, "carrying_rad": carrying, "mass_kg": mass, "states_hz": self._rate_seen()}

    def _rate_seen(self) -> float:
        times = [seen[0] for seen in self._seen]
        return (len(times) - 1) / (times[-1] - times[0])


@click.command(context_settings={"show_default": True})
@click.option("--seed", default=0, help="Of the motions.")
@click.option("--seconds", default=12.0, help="Before the pick, and after it.")
@click.option("--rate", default=250, help="Joint states a second.")
@click.option("--alone", default="", help="Run one robot in this namespace, and print its figures.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write the results there.")
def main(seed: int, seconds: float, rate: int, alone: str, json_path: Path | None) -> None:
    """Two robots in two namespaces."""
    if alone:
        with OneRobot("events", np.random.default_rng(seed), alone, rate, 2.0 / rate) as robot:
            print(json.dumps(robot.measure(seconds)))
        return
    command = [sys.executable, __file__, "--seconds", str(seconds), "--rate", str(rate)]
    names = ("left", "right")
    running = [
        subprocess.Popen([*command, "--seed", str(seed + k), "--alone", name], stdout=subprocess.PIPE)
        for k, name in enumerate(names)
    ]
    found = {name: json.loads(p.communicate()[0].splitlines()[-1]) for name, p in zip(names, running, strict=True)}
    table = Table(
        "robot", "empty (mrad)", "carrying (mrad)", "mass (kg)", "states (Hz)", title=f"1 kg, {rate} Hz", title_justify="left"
    )
    for name, f in found.items():
        mass = "-" if f["mass_kg"] is None else f"{f['mass_kg']:.3f}"
        table.add_row(name, f"{1e3 * f['empty_rad']:.2f}", f"{1e3 * f['carrying_rad']:.2f}", mass, f"{f['states_hz']:.0f}")
    Console(width=130).print(table)
    off = [abs(f["mass_kg"] - MASS) if f["mass_kg"] is not None else float("inf") for f in found.values()]
    targets = [
        Target("mass off (kg)", max(off), high=0.05),
        Target(
            "rms from the motion, carrying over empty", max(f["carrying_rad"] / f["empty_rad"] for f in found.values()), high=1.5
        ),
        Target("joint states a second", min(f["states_hz"] for f in found.values()), low=0.98 * rate),
    ]
    sys.exit(conclude("two_robots", targets, found, json_path))


if __name__ == "__main__":
    main()
