"""Are the intervals of ``track`` honest? Simulated arms; friction, offsets, gains, zeros, rotors, delays and payload are drawn.

    python benchmarks/fleet_track.py --bags 40 --first-seed 9000

Each bag is 20 s at 250 Hz of a 7-joint arm (PyBullet). The peer is the same least squares with the covariance of rows that are
taken for independent, as ordinary least squares states it. Targets: of the 95 % intervals 92 to 98 % hold the truth, for each
kind of parameter at least 90 %; processor time of a bag at most 0.5 s.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.fleet.known_robot import KnownRobot
from sysid_ros.fleet.payload_steps import with_changes
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.fleet.track import Tracked, cutoff_of, track
from sysid_ros.fleet.track_rows import EACH, TrackRows
from sysid_ros.identification.rows import SmoothRecording
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.simulation import ArmScenario, simulate_arm

_NORMAL = 1.96


@dataclass
class Counts:
    """How often intervals held the truth, and standardised errors, by parameter."""

    errors: dict[str, list[float]] = field(default_factory=dict)
    peer: dict[str, list[float]] = field(default_factory=dict)
    untold: dict[str, int] = field(default_factory=dict)


def drawn(seed: int) -> tuple[Recording, FloatArray, float, KnownRobot]:
    """A recording, the truth of its joints (8, 7), its payload's mass [kg], and the robot as it is known."""
    rng = np.random.default_rng(seed)
    n = 7
    friction, viscous = rng.uniform(0.05, 1.5, n), rng.uniform(0.1, 1.0, n)
    rotor, offset = rng.uniform(0.02, 0.3, n), rng.normal(0.0, 0.3, n)
    mass = float(rng.uniform(0.2, 3.0)) if rng.random() < 0.6 else None
    scenario = ArmScenario(seed=seed, duration=20.0, rate=1000, payload_mass=mass, base_frequency=float(rng.uniform(0.1, 0.25)))
    record = simulate_arm(scenario)
    # friction and rotors are added to the torque of a motion that the controller holds: PyBullet's act half a step ahead
    step = record.t[1] - record.t[0]
    v, a = np.gradient(record.exact_q, step, axis=0), np.zeros_like(record.exact_q)
    a[1:-1] = np.diff(record.exact_q, 2, axis=0) / step**2
    exact = record.exact_tau + friction * np.sign(v) + viscous * v + rotor * a
    gain, zero = 1.0 + rng.normal(0.0, 0.03, n), rng.normal(0.0, 0.006, n)
    delay, noise = rng.uniform(0.0, 0.006, n), rng.uniform(0.05, 0.3, n)
    late = np.stack([np.interp(record.t - d, record.t, exact[:, j]) for j, d in enumerate(delay)], axis=1)[10::4]
    tau = gain * late + offset + noise * rng.standard_normal(late.shape)
    q = record.exact_q[10::4] + zero + float(rng.choice([1e-5, 5e-5])) * rng.standard_normal(late.shape)
    robot = RobotModel.from_urdf(record.urdf)
    recording = Recording(f"seed {seed}", record.t[10::4] + 1.7e9, q, None, tau)
    truth = np.stack([friction, viscous, offset, gain, zero, rotor, delay, noise])
    return recording, truth, mass or 0.0, KnownRobot(robot, None, record.truth["frame"], np.zeros(10))


def peer_std(known: KnownRobot, recording: Recording) -> FloatArray:
    """Of the joints' parameters by rows that are taken for independent, shape (7, n)."""
    fit = with_changes(TrackRows.of(known, SmoothRecording.of(known.robot, recording, "", cutoff_of(recording))))
    moving = fit.rows.rows.moving
    variance = (moving * fit.left**2).sum(axis=0) / np.maximum(moving.sum(axis=0), 1)
    information = np.diag(1.0 / fit.prior_std**2) + np.einsum("tjp,tj,tjq->pq", fit.Y, moving / variance, fit.Y, optimize=True)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information)))[: EACH * known.robot.n].reshape(EACH, -1))


def add(counts: Counts, found: Tracked, truth: FloatArray, mass: float, peer: FloatArray) -> None:
    for i, name in enumerate(JOINT_PARAMETERS):
        told = np.isfinite(found.values[i])
        error = found.values[i] - truth[i]
        counts.errors.setdefault(name, []).extend((error / found.std[i])[told].tolist())
        counts.untold[name] = counts.untold.get(name, 0) + int((~told).sum())
        if i < EACH:
            counts.peer.setdefault(name, []).extend((error / peer[i])[told].tolist())
    if len(found.carried) == 1:
        body = found.carried[0]
        counts.errors.setdefault("payload mass", []).append((body.theta[0] - mass) / float(np.sqrt(body.covariance[0, 0])))


def show(counts: Counts) -> None:
    table = Table(title="intervals of track", title_justify="left")
    for column in ("parameter", "intervals", "not told", "in 95 %", "in 50 %", "std of error / std", "peer: in 95 %"):
        table.add_column(column, justify="left" if column == "parameter" else "right")
    for name, errors in counts.errors.items():
        e, peer = np.abs(errors), np.abs(counts.peer.get(name, []))
        table.add_row(
            name, str(len(e)), str(counts.untold.get(name, 0)), f"{100 * np.mean(e < _NORMAL):.1f} %",
            f"{100 * np.mean(e < 0.6745):.1f} %", f"{np.std(errors):.2f}",
            f"{100 * np.mean(peer < _NORMAL):.1f} %" if len(peer) else "",
        )  # fmt: skip
    Console(width=130).print(table)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bags", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=9000)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    counts, seconds, changed = Counts(), [], 0
    for seed in range(options.first_seed, options.first_seed + options.bags):
        recording, truth, mass, known = drawn(seed)
        began = time.thread_time()
        found = track(known, recording)
        seconds.append(time.thread_time() - began)
        changed += len(found.carried) > 1
        add(counts, found, truth, mass, peer_std(known, recording))
    show(counts)
    every = np.abs(np.concatenate([np.asarray(e) for e in counts.errors.values()]))
    worst = min(float(np.mean(np.abs(e) < _NORMAL)) for e in counts.errors.values())
    targets = [
        Target("95 % intervals that hold the truth, all parameters", float(np.mean(every < _NORMAL)), 0.92, 0.98),
        Target("the same of the worst kind of parameter", worst, 0.90),
        Target("bags in which a change of the payload is told that is none", changed, high=0.0),
        Target("processor time of a bag without reading, median [s]", float(np.median(seconds)), high=0.5),
    ]
    return conclude("fleet_track", targets, {"errors": counts.errors, "peer": counts.peer, "seconds": seconds}, options.json)


if __name__ == "__main__":
    raise SystemExit(main())
