"""A cluster of 100 workers on a machine that has not the cores for their work: the part of ``fleet_speed.py`` about scaling.

What a user would run is here as it is: the package's driver in this process, a real ``dask scheduler`` in another, messages over
TCP. Only the workers are pretended: 20 live in a process, and sleep for the processor time that a bag took. With all 100 in one
they wait for that process's interpreter a tenth of their time, which no cluster does.
"""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.context import SpawnProcess
from pathlib import Path
from unittest import mock

import psutil
from fleet_watch import Watch
from rich.console import Console
from rich.table import Table
from verdict import Target

from sysid_ros import __version__
from sysid_ros.fleet import batch as driver
from sysid_ros.fleet.batch import Batch
from sysid_ros.fleet.cluster import CALM, connected
from sysid_ros.fleet.jobs import Task
from sysid_ros.fleet.rules import Entry, Rules
from sysid_ros.fleet.store import Results, Store

NAMES, WORKERS, PROCESSES = 10_000, 100, 5


def asleep(task: Task, entries: Sequence[Entry]) -> list[Results]:
    """A job that takes a measured time and no processor."""
    times = entries[0].kind.split()
    seconds = float(times[int(task.bag.rpartition("_")[2]) % len(times)])
    time.sleep(seconds)
    key = {
        "bag": task.bag,
        "stamp": "",
        "hash": task.bag,
        "model": entries[0].digest,
        "version": __version__,
        "job": task.jobs[0],
    }
    return [Results({**key, "robot": "r", "kind": "k", "status": "ok", "reason": "", "seconds": seconds})]


def workers_of(address: str, count: int) -> None:
    """A process that is some workers of a scheduler, until it is ended."""
    import dask
    from distributed import Worker

    async def work() -> None:
        team = await asyncio.gather(*(Worker(address, nthreads=1, memory_limit=0, dashboard=False) for _ in range(count)))
        await asyncio.gather(*(worker.finished() for worker in team))

    with dask.config.set(CALM):
        asyncio.run(work())


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, dict[str, list[psutil.Process]]]]:
    """Address of a scheduler with the workers, and the processes of both."""
    file = folder / "scheduler.json"
    options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    path = os.pathsep.join([str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    scheduler = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_scheduler", *options],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=os.environ | {"PYTHONPATH": path},
    )  # fmt: skip
    teams: list[SpawnProcess] = []
    try:
        address = ""
        while not address:
            with suppress(OSError, ValueError, KeyError):
                address = str(json.loads(file.read_text())["address"])
            time.sleep(0.1)
        for _ in range(PROCESSES):
            teams.append(get_context("spawn").Process(target=workers_of, args=(address, WORKERS // PROCESSES), daemon=True))
            teams[-1].start()
        yield address, {"scheduler": [psutil.Process(scheduler.pid)], "workers": [psutil.Process(t.pid) for t in teams]}
    finally:
        for team in teams:
            team.kill()
            team.join()
        scheduler.kill()
        scheduler.wait()


def many_workers(times: Sequence[float], folder: Path) -> tuple[list[Target], dict[str, float]]:
    """What 100 workers must hold that take these times, and the processor time of each process a task [s]."""
    rules, watch = Rules({"robots": [{"robot": "r", "kind": " ".join(f"{t:.4f}" for t in times)}]}, Path()), Watch()

    def advance(bags: int) -> None:
        watch.through += bags

    store, names = Store(folder / "asleep", create=True), (f"/nowhere/bag_{k}" for k in range(NAMES))
    with (
        cluster(folder) as (address, others),
        connected(address) as client,
        store.writing(),
        mock.patch.object(driver, "find", return_value=names),
        mock.patch.object(driver, "run", asleep),
    ):
        client.wait_for_workers(WORKERS, timeout=120)
        processes = {"driver": [psutil.Process()], **others}
        before = {name: used_by(some) for name, some in processes.items()}
        with watch.watching():
            began = time.perf_counter()
            Batch(store, rules, ["track"], client, advance).run(["bags"])
            took = time.perf_counter() - began
        used = {name: (used_by(some) - before[name]) / NAMES for name, some in processes.items()}
    work = float(sum(round(times[k % len(times)], 4) for k in range(NAMES)))
    title = f"{NAMES} names on {WORKERS} workers: {took:.1f} s, {work / WORKERS:.1f} s of work for each"
    table = Table("", "processor time a task [ms]", "of its core", title=title, title_justify="left")
    for name, seconds in used.items():
        table.add_row(name, f"{1e3 * seconds:.2f}", f"{100.0 * seconds * NAMES / took / len(processes[name]):.0f} %")
    Console(width=130).print(table)
    targets = [
        Target("100 workers, part of the time busy", work / (WORKERS * took), 0.9),
        Target("memory of the driver of 100 workers, second to last quarter of 10,000 names [MB]", watch.growth()[0], high=50.0),
    ]
    return targets, used


def used_by(processes: Sequence[psutil.Process]) -> float:
    """Processor time of some processes [s]."""
    return float(sum(sum(process.cpu_times()[:2]) for process in processes))
