"""How much faster than real time a bag is replayed.

Writes 60 s of the simulated 7-joint arm at 1 kHz, with a pick and a drop, as a bag in each storage, and times on one core

- the library: open the bag, read, check and estimate (``BagSource``, ``InputGate``, ``OnlineEstimation``), compiled and warm;
- the command ``sysid replay --json --series`` as a process of its own, from start to exit: interpreter, imports and compiled
  code from the cache included; the first of the repetitions may have to compile and is left out.

The targets are for the best of the repetitions: other work on the machine only makes it slower. The processor time of the best
is shown beside it.

``--profile`` shows instead where the time of the library goes.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import cProfile
import pstats
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.input_gate import InputGate
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.replay import Replay, replay
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation import ArmScenario, simulate_arm
from sysid_ros.simulation.arm_record import START_TIME, write_recording
from sysid_ros.sources import BagRecorder, BagSource

_COMMAND = "from sysid_ros.cli.main import main; main()"


def replay_bag(path: Path) -> tuple[Replay, float, float]:
    """What the command does, without start-up and output; with the time and the processor time that it took [s]."""
    start, start_processor = perf_counter(), process_time()
    source = BagSource(path)
    settings = OnlineSettings()
    robot = RobotModel.for_messages(source.robot_description or "", source.joint_names)
    result = replay(source, InputGate(robot, settings), OnlineEstimation(robot, settings))
    return result, perf_counter() - start, process_time() - start_processor


def run_command(path: Path, folder: Path) -> tuple[float, float]:
    """Time and processor time of the whole command [s]."""
    arguments = ["replay", str(path), "--json", str(folder / "out.json"), "--series", str(folder / "out.csv"), "--force"]
    start, start_processor = perf_counter(), _children()
    subprocess.run([sys.executable, "-c", _COMMAND, *arguments], check=True, capture_output=True)
    return perf_counter() - start, _children() - start_processor


def _children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


@click.command(help=__doc__.split("\n")[0])
@click.option("--duration", default=60.0, show_default=True, help="Of the recording [s].")
@click.option("--repeat", default=3, show_default=True, help="Repetitions that count; one more warms up.")
@click.option("--profile", is_flag=True, help="Show where the time goes, with the profiler's own burden, and stop.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write the result for machines.")
def main(duration: float, repeat: int, profile: bool, json_path: Path | None) -> None:
    scenario = ArmScenario(
        seed=3, duration=duration, payload_mass=1.5, pick_time=0.3 * duration, drop_time=0.7 * duration, velocity=True
    )
    record = simulate_arm(scenario, start_time=START_TIME)
    results: dict[str, dict[str, Any]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for storage in ("mcap", "sqlite3"):
            path = folder / storage
            with BagRecorder(path, storage) as recorder:
                write_recording(record, recorder)
            replay_bag(path)
            if profile:
                _profile(path)
                continue
            runs = [replay_bag(path) for _ in range(repeat)]
            library = np.array([times for _, *times in runs])
            command = np.array([run_command(path, folder) for _ in range(repeat + 1)])[1:]
            read = perf_counter()
            count = sum(1 for _ in BagSource(path))
            results[storage] = {
                "messages": count,
                "megabytes": sum(f.stat().st_size for f in path.iterdir()) / 1e6,
                "read_only_s": perf_counter() - read,
                "library_s": library[:, 0].tolist(),
                "library_processor_s": library[:, 1].tolist(),
                "command_s": command[:, 0].tolist(),
                "command_processor_s": command[:, 1].tolist(),
                "final_mass": runs[-1][0].final.mass,
                "events": [e.kind for e in runs[-1][0].events],
            }
    if profile:
        return
    table = Table(title=f"Replay of {duration:g} s, 1 kHz, 7 joints: seconds and times real time", title_justify="left")
    for column in ("", "best", "median", "processor, best"):
        table.add_column(column, justify="right" if column else "left")
    for storage, r in results.items():
        table.add_row(f"{storage}, {r['megabytes']:.1f} MB: only reading", _cell(duration, r["read_only_s"]), "", "")
        for what in ("library", "command"):
            wall, processor = r[f"{what}_s"], r[f"{what}_processor_s"]
            table.add_row(
                f"{storage}: {what}", *(_cell(duration, x) for x in (min(wall), float(np.median(wall)), min(processor)))
            )
    Console(width=130).print(table)
    targets = [
        Target(f"{storage}, {what}: times real time, best", duration / min(r[key]), low=20.0)
        for storage, r in results.items()
        for what, key in (("library", "library_s"), ("command with start-up", "command_s"))
    ]
    targets += [
        Target(f"{storage}: pick and drop found, nothing else (1: yes)", float(r["events"] == ["pick", "drop"]), low=1.0)
        for storage, r in results.items()
    ]
    sys.exit(conclude("replay_speed", targets, results, json_path))


def _cell(duration: float, seconds: float) -> str:
    return f"{seconds:.2f} s ({duration / seconds:.0f}x)"


def _profile(path: Path) -> None:
    profiler = cProfile.Profile()
    profiler.enable()
    replay_bag(path)
    profiler.disable()
    print(f"-- {path.name}")
    pstats.Stats(profiler).sort_stats("tottime").print_stats(28)


if __name__ == "__main__":
    main()
