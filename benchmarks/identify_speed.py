"""Time and memory of ``sysid identify`` on a long recording: ten minutes of a 7-joint arm at 1 kHz by default.

Writes the recording as a bag: exact torques of the KUKA LBR iiwa of ``pybullet_data`` along sums of sines, its links up to 15 %
lighter or heavier than the URDF says, with friction, rotor inertia, offsets, white torque noise of 0.3 N m and encoder noise of
1e-5 rad. Then runs the command as a process of its own, from start to exit, and reads what the system says that it took.

The targets are processor time and the largest resident memory; wall time, which other work on the machine makes longer, stands
beside them. How right the friction is that it finds stands in the table too.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.simulation.arm_record import START_TIME
from sysid_ros.simulation.description import arm_description
from sysid_ros.sources import BagRecorder

_COMMAND = "from sysid_ros.cli.main import main; main()"
_CHUNK = 10_000
_SYMBOLS = ("b", "Fc", "J", "offset")
_SECONDS, _GIGABYTES = 60.0, 2.0


def hidden(robot: RobotModel, seed: int) -> tuple[FloatArray, FloatArray]:
    """Factors of the links, shape (n,), and viscous, Coulomb, rotors, offsets, shape (4, n)."""
    rng, n = np.random.default_rng([seed, 7]), robot.n
    joints = [rng.uniform(0.3, 2.0, n), rng.uniform(0.3, 1.5, n), rng.uniform(0.02, 0.5, n), rng.normal(0.0, 0.3, n)]
    return rng.uniform(0.85, 1.15, n), np.array(joints)


def records(robot: RobotModel, seconds: float, rate: float, seed: int) -> Iterator[JointStateRecord]:
    """The messages, received at their stamps."""
    rng, n = np.random.default_rng(seed), robot.n
    links, (b, Fc, J, offset) = hidden(robot, seed)
    pi = (robot.pi.reshape(n, 10) * links[:, None]).ravel()
    w = 2.0 * np.pi * rng.uniform(0.05, 0.4, (4, n))
    phase = rng.uniform(0.0, 2.0 * np.pi, (4, n))
    reach = 0.15 * np.minimum(robot.position_upper - robot.position_lower, 4.0)
    centre = 0.5 * (robot.position_upper + robot.position_lower)
    for first in range(0, round(seconds * rate), _CHUNK):
        t = np.arange(first, min(first + _CHUNK, round(seconds * rate))) / rate
        angle = w * t[:, None, None] + phase
        q = centre + reach * np.sum(np.sin(angle), axis=1)
        v = reach * np.sum(w * np.cos(angle), axis=1)
        a = -reach * np.sum(w**2 * np.sin(angle), axis=1)
        tau = robot.regressor_along(q, v, a) @ pi + b * v + Fc * np.tanh(v / 0.02) + J * a + offset
        tau += 0.3 * rng.normal(size=tau.shape)
        q += 1e-5 * rng.normal(size=q.shape)
        for k, stamp in enumerate((START_TIME + t).tolist()):
            yield JointStateRecord(stamp, stamp, robot.joint_names, q[k], (), tau[k])


def run(bag: Path, folder: Path, options: list[str]) -> tuple[dict[str, Any], dict[str, float]]:
    """The command's JSON, and what it took: wall and processor time [s], largest resident memory [GB]."""
    arguments = [
        "identify",
        str(bag),
        "--out",
        str(folder / "model.yaml"),
        "--json",
        str(folder / "out.json"),
        "--force",
        *options,
    ]
    start = perf_counter()
    process = subprocess.Popen([sys.executable, "-c", _COMMAND, *arguments], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    wall = perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise click.ClickException(f"sysid identify ended with exit code {process.returncode}.")
    took = {"wall_s": wall, "processor_s": usage.ru_utime + usage.ru_stime, "memory_GB": usage.ru_maxrss * 1024 / 1e9}
    return json.loads((folder / "out.json").read_text()), took


@click.command(help=__doc__.split("\n")[0])
@click.option("--seconds", default=600.0, show_default=True, help="Of the recording [s].")
@click.option("--rate", default=1000.0, show_default=True, help="Messages a second [Hz].")
@click.option("--seed", default=1, show_default=True, help="Of motion, arm and noise.")
@click.option(
    "--form", type=click.Choice(["acceleration", "momentum"]), multiple=True, default=["acceleration"], show_default=True
)
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write the result for machines.")
def main(seconds: float, rate: float, seed: int, form: tuple[str, ...], json_path: Path | None) -> None:
    urdf = arm_description()
    robot = RobotModel.from_urdf(urdf)
    _, truth = hidden(robot, seed)
    results: dict[str, Any] = {}
    table = Table(title=f"sysid identify, {seconds:g} s, {rate:g} Hz, {robot.n} joints", title_justify="left")
    for column in ("form", "wall s", "processor s", "memory GB", "error / interval, median", "largest"):
        table.add_column(column, justify="left" if column == "form" else "right")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with BagRecorder(folder / "bag") as recorder:
            recorder.write_robot_description(urdf, START_TIME)
            recorder.write_joint_states(records(robot, seconds, rate, seed))
        for which in form:
            document, took = run(folder / "bag", folder, ["--form", which])
            found = {p["name"]: p for p in document["parameters"]}
            # the rotor of the first joint can't be told from its link
            ratio = [
                abs(found[key]["value"] - truth[k, j]) / (1.96 * found[key]["std"])
                for k, symbol in enumerate(_SYMBOLS)
                for j, joint in enumerate(robot.joint_names)
                if (key := f"{symbol}[{joint}]") in found and (symbol != "J" or j > 1)
            ]
            results[which] = {**took, "error_over_interval": ratio}
            numbers = (took["wall_s"], took["processor_s"], took["memory_GB"], float(np.median(ratio)), max(ratio))
            table.add_row(which, *(f"{x:.3g}" for x in numbers))
    Console(width=130).print(table)
    part = max(seconds * rate / 6e5, 1e-9)
    targets = [Target(f"{w}: processor time [s]", r["processor_s"], high=_SECONDS * max(part, 0.2)) for w, r in results.items()]
    targets += [Target(f"{w}: memory [GB]", r["memory_GB"], high=_GIGABYTES) for w, r in results.items()]
    results["settings"] = {"seconds": seconds, "rate": rate, "seed": seed}
    sys.exit(conclude("identify_speed", targets, results, json_path))


if __name__ == "__main__":
    main()
