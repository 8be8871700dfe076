"""Identification of a simulated arm: errors, honesty of the intervals and time, against figaroh and MuJoCo's sysid.

Each trial simulates 30 s of the 7-joint arm in an exciting motion at 250 Hz, with friction, rotor inertia and torque offsets of
random size, encoder noise of 1e-5 rad and no velocities. The torque noise of 0.3 N m is white in one variant and AR(1) with 0.98
a sample in the other. All see the same recording:

- sysid_ros gets a URDF whose links are up to 15 % too light or too heavy, and finds base parameters of links, friction, rotors
  and offsets;
- figaroh finds the same from its own regressor by its double QR, least squares and ``relative_stdev``;
- MuJoCo's sysid, which knows no base parameters, gets the true links and finds friction, rotors and offsets.

Coverage is the part of the true values inside the stated 95 % intervals: of all base parameters, and of viscous and Coulomb
friction alone.

Tools that are not installed are left out, and that is said: ``pip install 'sysid_ros[peers]'`` brings them.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import importlib.util
import logging
import sys
import time
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import click
import numpy as np
from peers_identification import Estimate, figaroh_estimate, mujoco_estimate, prepare
from rich.console import Console
from rich.table import Table
from scipy import signal
from verdict import Target, conclude

from sysid_ros.identification import Recording, free_model, identify_recordings
from sysid_ros.identification.base_groups import group_matrix
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation import ArmScenario, simulate_arm

RATE = 250
NOISE = 0.3
COLOURS = {"white": 0.0, "AR(0.98)": 0.98}
FRICTION = ("viscous_friction", "coulomb_friction")


def simulated(seed: int, seconds: float) -> tuple[Recording, str, FloatArray]:
    """A recording without torque noise, the URDF of the arm, and its parameters, shape (14 n,)."""
    rng = np.random.default_rng([seed, 31])
    n = 7
    found = {
        "viscous_friction": rng.uniform(0.3, 2.0, n),
        "coulomb_friction": rng.uniform(0.3, 1.5, n),
        "rotor_inertia": rng.uniform(0.02, 0.5, n),
        "torque_offset": rng.normal(0.0, 0.3, n),
    }
    told: dict[str, Any] = {name: tuple(values.tolist()) for name, values in found.items()}
    record = simulate_arm(ArmScenario(seed=seed, duration=seconds, rate=RATE, velocity=False, torque_noise=0.0, **told))
    truth = np.concatenate([RobotModel.from_urdf(record.urdf).pi, *found.values()])
    return Recording(f"seed {seed}", record.t, record.q, None, record.tau), record.urdf, truth


def with_noise(recording: Recording, seed: int, colour: float) -> Recording:
    """Torque noise of the same power, white or of first order."""
    white = np.random.default_rng([seed, 98]).normal(size=(len(recording.t) + 500, recording.tau.shape[1]))
    noise = signal.lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white, axis=0)[500:]
    return Recording(recording.name, recording.t, recording.q, recording.v, recording.tau + NOISE * noise)


def mistaken(urdf: str, seed: int) -> str:
    """The URDF with every link up to 15 % too light or too heavy."""
    rng, root = np.random.default_rng([seed, 15]), ElementTree.fromstring(urdf)
    for inertial in root.iter("inertial"):
        factor = rng.uniform(0.85, 1.15)
        for tag, names in (("mass", ("value",)), ("inertia", ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))):
            element = inertial.find(tag)
            assert element is not None
            for name in names:
                element.set(name, repr(factor * float(element.get(name, "0"))))
    return ElementTree.tostring(root, encoding="unicode")


def own_estimate(recording: Recording, urdf: str, truth: FloatArray) -> Estimate:
    """Base parameters of ``sysid identify`` with its default settings."""
    robot = RobotModel.from_urdf(urdf)
    result = identify_recordings(robot, [recording], [], {})
    order = {g.name: g for g in result.groups}
    effects = {p.name: p.effect for p in result.parameters}
    names = [result.names[i] for i in result.base.independent]
    # a term that was taken for needed and that the arm does not have is zero
    known = dict(zip(free_model(robot).parameter_names, truth, strict=True))
    true = group_matrix(result.base) @ np.array([known.get(name, 0.0) for name in result.names])
    kinds = tuple("link" if effects[name] == "link_inertia" else effects[name] for name in names)
    values = np.array([order[name].value for name in names])
    return Estimate(values, 1.96 * np.array([order[name].std for name in names]), true, kinds)


def trial(seed: int, seconds: float) -> dict[str, Any]:
    """All tools on one motion with each kind of noise."""
    warnings.simplefilter("ignore")
    logging.disable(logging.WARNING)
    clean, urdf, truth = simulated(seed, seconds)
    wrong = mistaken(urdf, seed)
    out: dict[str, Any] = {}
    for name, colour in COLOURS.items():
        recording = with_noise(clean, seed, colour)
        robot = RobotModel.from_urdf(urdf)
        tools: dict[str, Callable[[], Estimate]] = {
            "sysid_ros": lambda r=recording: own_estimate(r, wrong, truth),  # type: ignore[misc]
            "figaroh": lambda r=recording, m=robot: figaroh_estimate(m, prepare(r.q, r.tau, RATE), truth),  # type: ignore[misc]
            "mujoco sysid": lambda r=recording, m=robot: mujoco_estimate(m, prepare(r.q, r.tau, RATE), truth),  # type: ignore[misc]
        }
        for tool, estimate in tools.items():
            if tool in missing():
                continue
            start = time.process_time()
            found = estimate()
            out[f"{tool}, {name}"] = {**scored(found), "seconds": time.process_time() - start}
    return out


def missing() -> list[str]:
    """Tools that are not installed."""
    packages = {"figaroh": "figaroh", "mujoco sysid": "mujoco.sysid"}
    return [tool for tool, package in packages.items() if not _installed(package)]


def _installed(package: str) -> bool:
    try:
        return importlib.util.find_spec(package) is not None
    except ModuleNotFoundError:
        return False


def scored(found: Estimate) -> dict[str, Any]:
    """Which values lie inside their intervals, the errors in standard deviations, and of friction relative to the truth."""
    error = found.value - found.truth
    rubs = np.isin(found.kind, FRICTION)
    return {
        "inside": (np.abs(error) <= found.half_width).tolist(),
        "friction_inside": (np.abs(error) <= found.half_width)[rubs].tolist(),
        "z": (1.96 * error / np.maximum(found.half_width, 1e-300)).tolist(),
        "friction_error": np.abs(error[rubs] / found.truth[rubs]).tolist(),
    }


def summary(trials: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """A row for each tool and noise."""
    out = {}
    for key in trials[0]:
        rows = [t[key] for t in trials]

        def every(field: str, rows: list[dict[str, Any]] = rows) -> FloatArray:
            return np.concatenate([np.asarray(r[field], dtype=float) for r in rows])

        out[key] = {
            "parameters": len(rows[0]["inside"]),
            "coverage": float(every("inside").mean()),
            "coverage_friction": float(every("friction_inside").mean()),
            "median_z": float(np.median(np.abs(every("z"))) / 0.6745),
            "friction_error": float(np.median(every("friction_error"))),
            "seconds": float(np.median([r["seconds"] for r in rows])),
        }
    return out


@click.command(help=__doc__)
@click.option("--seeds", default=4, show_default=True, help="Motions; 100 for the full run.")
@click.option("--first", default=0, show_default=True, help="First seed.")
@click.option("--seconds", default=30.0, show_default=True, help="Length of a recording. [s]")
@click.option("--jobs", default=1, show_default=True, help="Processes.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write the results for machines.")
def main(seeds: int, first: int, seconds: float, jobs: int, json_path: Path | None) -> None:
    for tool in missing():
        print(f"{tool} is not installed and left out; pip install 'sysid_ros[peers]' brings it.", file=sys.stderr)
    trials = []
    with ProcessPoolExecutor(jobs) as pool:
        for k, found in enumerate(pool.map(trial, range(first, first + seeds), [seconds] * seeds), start=1):
            trials.append(found)
            print(f"\r{k} of {seeds} motions", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    results = summary(trials)
    table = Table(title=f"Identification of a simulated arm, {seeds} motions of {seconds:g} s", title_justify="left")
    heads = ("", "parameters", "coverage", "of friction", "error / std", "friction error %", "CPU s")
    for column in heads:
        table.add_column(column, justify="right" if column else "left")
    for key in sorted(results, key=lambda k: k.split(", ")[1], reverse=True):
        r = results[key]
        cells = (r["coverage"], r["coverage_friction"], r["median_z"], 100.0 * r["friction_error"], r["seconds"])
        table.add_row(key, f"{r['parameters']:.0f}", *(f"{x:.3g}" for x in cells))
    Console(width=130).print(table)
    targets = [
        Target(f"coverage of {what}, {colour}", results[f"sysid_ros, {colour}"][field], 0.90, 0.98)
        for colour in COLOURS
        for what, field in (("all base parameters", "coverage"), ("friction", "coverage_friction"))
    ]
    sys.exit(conclude("identify_peers", targets, results, json_path))


if __name__ == "__main__":
    main()
