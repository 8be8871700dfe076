"""Whether `sysid batch` loses or repeats anything where workers, its scheduler, the disk and bags fail.

    python benchmarks/fleet_faults.py [--bags 200] [--seed 1] [--json out.json]

A scheduler and two workers in processes of their own, over TCP; simulated bags, of which one in twenty is broken. Workers are
killed at random 20 times (SIGKILL, while their nannies start them again), the disk is full once (a write ends with ENOSPC after
half of its bytes), the scheduler is killed once; after each of the two last the same command is given again. The store must be
that of a run without faults. Nothing may be begun again whose result the command had, in the same run, or in the store when it
was given again; the workers themselves note what they begin. What was at work or on its way when something died is done again.
"""

from __future__ import annotations

import argparse
import errno
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.exceptions import ClusterError, OutputError
from sysid_ros.fleet import batch as driver
from sysid_ros.fleet.batch import Batch, Counts
from sysid_ros.fleet.cluster import connected
from sysid_ros.fleet.jobs import Task
from sysid_ros.fleet.jobs import run as run_task
from sysid_ros.fleet.rules import Entry, Rules
from sysid_ros.fleet.schema import TABLES
from sysid_ros.fleet.store import Results, Store

KILLS, WORKERS = 20, 2
BROKEN = 20
"""One bag in so many is cut."""
JOURNAL = "SYSID_BENCHMARK_JOURNAL"


def noted(task: Task, entries: tuple[Entry, ...]) -> list[Results]:
    """The job, which says in a file of this process when it begins."""
    with open(Path(os.environ[JOURNAL]) / f"{os.getpid()}.txt", "a", encoding="utf-8") as journal:
        journal.write(f"{time.time()} {task.bag}\n")
    return run_task(task, entries)


class Watched(Batch):
    """A batch that notes when it has the results of a bag.

    Attributes:
        had: bag to the time [s].
    """

    had: dict[str, float]

    def _take(self, found: list[Results]) -> None:
        if found:
            self.had[found[0].bag["bag"]] = time.time()
        super()._take(found)


@dataclass
class Faults:
    """What is broken when, by the number of bags that are through.

    Attributes:
        kill: numbers at which a worker dies. disk, scheduler: numbers at which the disk is full and the scheduler dies.
        killed, through: workers and bags so far. full: whether the disk is full. again: bags that were begun although the command
            had their result.
    """

    kill: set[int]
    disk: int
    scheduler: int
    killed: int = 0
    through: int = 0
    full: bool = False
    again: list[str] = field(default_factory=list)


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, Callable[[], None]]]:
    """Address of a scheduler with two workers, and what kills the scheduler."""
    with ExitStack() as stack:

        def start(module: str, *arguments: str) -> subprocess.Popen[bytes]:
            here = os.pathsep.join([str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])])
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{module}", *arguments],
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
                env=os.environ | {"PYTHONPATH": here},
            )  # fmt: skip
            stack.callback(ended, process)
            return process

        file = folder / f"scheduler_{time.monotonic_ns()}.json"
        first = start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
        address = ""
        while not address:
            with suppress(OSError, ValueError, KeyError):
                address = str(json.loads(file.read_text())["address"])
            time.sleep(0.1)
        for _ in range(WORKERS):
            start("dask_worker", address, "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")
        yield address, lambda: os.killpg(first.pid, signal.SIGKILL)


def ended(process: subprocess.Popen[bytes]) -> None:
    """A process and its children end."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextmanager
def full_disk(faults: Faults) -> Iterator[None]:
    """Writes of tables fail after half of their bytes while ``faults.full``."""
    from pyarrow import parquet

    real = parquet.write_table

    def write_table(table: Any, path: Any, **more: Any) -> None:
        real(table, path, **more)
        if faults.full:
            os.truncate(path, os.path.getsize(path) // 2)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with mock.patch.object(parquet, "write_table", write_table):
        yield


def one_run(store: Store, rules: Rules, fleet: Path, folder: Path, faults: Faults, rng: random.Random) -> Counts | None:
    """The command once on a cluster of its own; None where a fault ended it."""
    began, counts = time.time(), None
    there = set(store.read("bags", ["bag"]).column("bag").to_pylist())
    with cluster(folder) as (address, kill_scheduler), connected(address) as client, full_disk(faults):
        client.wait_for_workers(WORKERS, timeout=120)

        def advance(bags: int) -> None:
            faults.through += bags
            if any(at <= faults.through for at in faults.kill):
                pids: list[int] = []
                with suppress(OSError):  # the one that died last may still be on the list
                    pids = list(client.run(os.getpid).values())
                if pids:
                    faults.killed += 1
                    faults.kill.remove(min(faults.kill))
                    with suppress(ProcessLookupError):
                        os.kill(rng.choice(pids), signal.SIGKILL)
            if faults.through == faults.disk:
                faults.full, faults.disk = True, -1
            if faults.through == faults.scheduler:
                faults.scheduler = -1
                kill_scheduler()

        with store.writing(), mock.patch.object(driver, "run", noted):
            work = Watched(store, rules, ["track"], client, advance)
            work.had = dict.fromkeys(there, began)
            try:
                counts = work.run([str(fleet)])
            except (OutputError, ClusterError) as error:
                Console().print(f"after {faults.through} bags: {error}", soft_wrap=True)
    faults.full = False
    faults.again += [bag for when, bag in begun() if when > max(began, work.had.get(bag, np.inf))]
    return counts


def begun() -> list[tuple[float, str]]:
    """When each bag was begun, as often as it was."""
    lines = [line for file in Path(os.environ[JOURNAL]).glob("*.txt") for line in file.read_text().splitlines()]
    return [(float(when), bag) for when, bag in (line.split(" ", 1) for line in lines)]


def content(path: Path) -> dict[str, Any]:
    """All values but the time that they took; NaN as text, for it equals nothing."""
    rows = {table: Store(path).read(table).to_pylist() for table in TABLES}
    return {table: [{k: repr(v) for k, v in row.items() if k != "seconds"} for row in rows[table]] for table in TABLES}


def simulated(folder: Path, bags: int) -> Path:
    """A fleet's bags, one in twenty without its first half: one that lacks its end is read as far as it goes."""
    robots = max(1, bags // 20)
    command = ["simulate", "fleet", "--bag", str(folder / "fleet"), "--robots", str(robots), "--weeks", str(bags // robots)]
    subprocess.run([sys.executable, "-m", "sysid_ros.cli.main", *command], check=True, stdout=subprocess.DEVNULL)
    for k, file in enumerate(sorted((folder / "fleet").rglob("*.mcap"))):
        if k % BROKEN == BROKEN // 2:
            content = file.read_bytes()
            file.write_bytes(content[len(content) // 2 :])
    return folder / "fleet"


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bags", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    folder, rng = Path(tempfile.mkdtemp(prefix="sysid_faults_")), random.Random(options.seed)
    try:
        fleet = simulated(folder, options.bags)
        rules, whole, store = Rules.read(fleet / "robots.yaml"), Store(folder / "whole", True), Store(folder / "broken", True)
        with connected(workers=WORKERS) as client, whole.writing():
            Batch(whole, rules, ["track"], client).run([str(fleet)])
        (folder / "journal").mkdir()
        os.environ[JOURNAL] = str(folder / "journal")
        status = whole.read("bags").column("status").to_pylist()
        count = len(status)
        faults = Faults(set(rng.sample(range(1, int(0.9 * count)), KILLS)), disk=count // 3, scheduler=2 * count // 3)
        runs, counts = 0, None
        while counts is None:
            runs += 1
            counts = one_run(store, rules, fleet, folder, faults, rng)
        times = Counter(bag for _, bag in begun())
        same = content(folder / "whole") == content(folder / "broken")
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    results = {
        "bags": count, "failed": status.count("failed"), "runs": runs, "workers_killed": faults.killed,
        "begun": sum(times.values()), "more_than_once": sum(n > 1 for n in times.values()),
    }  # fmt: skip
    shown = Table("what", "number", title="sysid batch where things fail", title_justify="left")
    for name, value in results.items():
        shown.add_row(name.replace("_", " "), str(value))
    Console(width=130).print(shown)
    targets = [
        Target("workers that were killed at random", faults.killed, KILLS, KILLS),
        Target("times the command was given, with a full disk and a scheduler that died", runs, 3, 3),
        Target("bags that failed, of all", status.count("failed") / count, 0.04, 0.06),
        Target("stores that differ from that without faults", float(not same), high=0.0),
        Target("bags that were begun again although the command had their result", len(faults.again), high=0.0),
    ]
    return conclude("fleet_faults", targets, results, options.json)


if __name__ == "__main__":
    raise SystemExit(main())
