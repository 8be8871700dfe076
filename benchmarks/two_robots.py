"""Arms on one machine, each with an estimator and a controller of its own in a namespace of its own.

Each arm follows motions, picks up a payload that nobody tells it, and follows more. Judged are the distance from its motion,
before and from 2 s after the pick on, of positions and references of one stamp, and the mass that its estimator tells at last.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.

Examples:
    python benchmarks/two_robots.py --json two_robots.json
    python benchmarks/two_robots.py --robots 1 --rate 500 --seconds 3 --seed 3
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
from sensor_msgs.msg import JointState  # noqa: E402
from verdict import Target, conclude  # noqa: E402

from sysid_ros.sample import FloatArray  # noqa: E402

_NAMES = ("left", "right", "third", "fourth")


class OneRobot(FaultBench):
    """One of them; nothing stands between its states and its controller."""

    states, payload_from = "joint_states", "live"

    def _on_states(self, message: JointState) -> None:
        super()._on_states(message)
        self._measured[_stamp(message)] = self._seen[-1][1]

    def _on_reference(self, message: JointState) -> None:
        super()._on_reference(message)
        self._references[_stamp(message)] = np.array(message.position)

    def follow(self, seconds: float) -> dict[str, float]:
        """Motion after motion for so long; rms of the distance from it, over joints and time, and that of the tip."""
        self._measured.clear()
        self._references.clear()
        while seconds > 0.0:
            goal = np.array(self.home) + self._rng.uniform(-0.5, 0.5, self.robot.n)
            duration = max(1.2, 2.2 * float(np.abs(goal - self._seen[-1][1]).max()))
            self._begin_motion(goal, duration)
            self._spin(duration)
            seconds -= duration
        pairs = [(wanted, self._measured[at]) for at, wanted in self._references.items() if at in self._measured]
        away = np.array([wanted - q for wanted, q in pairs])
        tip = [self._tip(wanted) - self._tip(q) for wanted, q in pairs[::5]]
        return {"rad": float(np.sqrt(np.mean(away**2))), "m": float(np.sqrt(np.mean(np.sum(np.square(tip), axis=1))))}

    def _tip(self, q: FloatArray) -> FloatArray:
        return self.robot.frame_placement(q, self.robot.flange)[1]

    def measure(self, seconds: float) -> dict[str, Any]:
        """One robot's figures."""
        self._measured: dict[int, FloatArray] = {}
        self._references: dict[int, FloatArray] = {}
        self._prepare()
        self.home = self._seen[-1][1]
        told: list[InertiaStamped] = []
        topic = "online_payload_estimator/payload_valid"
        kept = self.node.create_subscription(InertiaStamped, topic, told.append, 10)
        self.follow(2.0)
        empty = self.follow(seconds)
        self._call("simulated_robot/pick")
        self.follow(2.0)
        carrying = self.follow(seconds)
        self.node.destroy_subscription(kept)
        mass = told[-1].inertia.m if told else float("nan")
        of = {"empty": empty, "carrying": carrying}
        figures = {f"{when}_{unit}": value for when, found in of.items() for unit, value in found.items()}
        return {**figures, "mass_kg": mass, "true_kg": self.mass, "states_hz": self._rate_seen()}

    def _rate_seen(self) -> float:
        times = [seen[0] for seen in self._seen]
        return (len(times) - 1) / (times[-1] - times[0])


def _stamp(message: JointState) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


@click.command(context_settings={"show_default": True})
@click.option("--seed", default=0, help="Of the motions.")
@click.option("--seconds", default=12.0, help="Before the pick, and after it.")
@click.option("--rate", default=250, help="Joint states a second.")
@click.option("--delay", default=0.0, help="loop_delay [s]; 0: two periods of the joint states.")
@click.option("--mass", default=1.0, help="Of the payload [kg].")
@click.option("--robots", default=2, type=click.IntRange(1, len(_NAMES)), help="How many, each in its namespace.")
@click.option("--alone", default="", help="Run one robot in this namespace, and print its figures.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write the results there.")
def main(
    seed: int, seconds: float, rate: int, delay: float, mass: float, robots: int, alone: str, json_path: Path | None
) -> None:
    """Robots in namespaces."""
    delay = delay or 2.0 / rate
    if alone:
        with OneRobot("events", np.random.default_rng(seed), alone, rate, delay) as robot:
            robot.mass = mass
            print(json.dumps(robot.measure(seconds)))
        return
    command = [sys.executable, __file__, "--seconds", str(seconds), "--rate", str(rate), "--mass", str(mass)]
    command += ["--delay", str(delay)]
    names = _NAMES[:robots]
    running = [
        subprocess.Popen([*command, "--seed", str(seed + k), "--alone", name], stdout=subprocess.PIPE)
        for k, name in enumerate(names)
    ]
    found = {name: json.loads(p.communicate()[0].splitlines()[-1]) for name, p in zip(names, running, strict=True)}
    columns = ("robot", "empty (mrad)", "carrying (mrad)", "tip empty (mm)", "carrying (mm)", "mass (kg)", "states (Hz)")
    table = Table(*columns, title=f"{mass:g} kg, {rate} Hz", title_justify="left")
    for name, f in found.items():
        cells = [f"{1e3 * f[key]:.3f}" for key in ("empty_rad", "carrying_rad", "empty_m", "carrying_m")]
        table.add_row(name, *cells, f"{f['mass_kg']:.3f}", f"{f['states_hz']:.0f}")
    Console(width=130).print(table)
    # a mass that was not told is as wrong as can be
    off = [abs(f["mass_kg"] - f["true_kg"]) if np.isfinite(f["mass_kg"]) else float("inf") for f in found.values()]
    targets = [
        Target("mass off (kg)", max(off), high=0.05),
        *(
            Target(f"rms {what} from the motion, carrying over empty", max(_ratio(f, unit) for f in found.values()), high=1.5)
            for what, unit in (("of the joints", "rad"), ("of the tip", "m"))
        ),
        Target("joint states a second", min(f["states_hz"] for f in found.values()), low=0.98 * rate),
    ]
    sys.exit(conclude("two_robots", targets, found, json_path))


def _ratio(found: dict[str, Any], unit: str) -> float:
    return float(found[f"carrying_{unit}"] / found[f"empty_{unit}"])


if __name__ == "__main__":
    main()
