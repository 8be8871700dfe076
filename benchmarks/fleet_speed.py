"""How fast ``sysid batch`` is beside the same calls in one process, how it scales, and what its processes need.

    python benchmarks/fleet_speed.py --bags 2000 [--jobs track,replay] [--fleet FOLDER] [--sample 100] [--json out.json]
        [--so-far FILE]

Bags of 40 robots are simulated (``--fleet``: of `sysid simulate fleet`, made before). Then, each with processes that are warm:

1. the calls without Dask on a sample of the bags, in one process: the yardstick;
2. the same in two processes at once, half of the sample each, without Dask: what this machine's cores take from each other;
3. the batch on the sample with one worker and with two;
4. the batch on all bags with two workers, while memory is read every second;
5. a cluster of 100 workers, 10,000 names, see ``fleet_hundred.py``: two cores can't do the work of 100, so workers sleep for the
   processor time of a bag of the sample.

``--so-far``: a file that gets a line of JSON as each part ends, so that a run that is stopped has told what it measured.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any
from unittest import mock

import psutil
from fleet_hundred import many_workers
from fleet_watch import Watch
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.fleet import batch as driver
from sysid_ros.fleet.bags import find, stamp_of
from sysid_ros.fleet.batch import Batch
from sysid_ros.fleet.cluster import connected
from sysid_ros.fleet.jobs import Task, run
from sysid_ros.fleet.rules import Entry, Rules
from sysid_ros.fleet.store import Store

ROBOTS = 40


def used_by_all() -> float:
    """Processor time of this process and of all of its children that live [s]."""
    me = psutil.Process()
    times = [p.cpu_times() for p in (me, *me.children(recursive=True)) if p.is_running()]
    return float(sum(t.user + t.system for t in times))


def calls(bags: Sequence[str], robots: Path, jobs: tuple[str, ...]) -> tuple[float, list[float]]:
    """Time of the calls alone [s], and the processor time of each bag, in a process that is warm."""
    rules, each = Rules.read(robots), []
    warm(bags[0], rules.entries(bags[0]), jobs)
    began = time.perf_counter()
    for bag in bags:
        before = time.process_time()
        run(Task(bag, stamp_of(bag), jobs), tuple(rules.entries(bag)))
        each.append(time.process_time() - before)
    return time.perf_counter() - began, each


def side_by_side(bags: Sequence[str], robots: Path, jobs: tuple[str, ...]) -> tuple[float, float]:
    """The calls in two processes at once, without Dask: time [s] and processor time of all [s]."""
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        halves = [(bags[k::2], robots, jobs) for k in range(2)]
        found = pool.starmap(calls, halves, chunksize=1)
    return max(took for took, _ in found), sum(sum(each) for _, each in found)


def warm(bag: str, entries: list[Entry], jobs: tuple[str, ...]) -> None:
    """What a process loads and compiles once."""
    run(Task(bag, "", jobs), tuple(entries))


def through(
    bags: Sequence[str], robots: Path, jobs: tuple[str, ...], workers: int, store: Store, watch: Watch | None = None
) -> tuple[float, float, float]:
    """Time [s], processor time of the jobs and that of all processes [s], of the whole batch on warm workers."""
    rules, watch = Rules.read(robots), watch or Watch()

    def advance(bags: int) -> None:
        watch.through += bags

    with connected(workers=workers) as client, store.writing():
        client.wait_for_workers(workers, timeout=120)
        client.run(warm, bags[0], rules.entries(bags[0]), jobs)
        before, began = used_by_all(), time.perf_counter()
        with mock.patch.object(driver, "find", return_value=iter(bags)), watch.watching():
            counts = Batch(store, rules, jobs, client, advance).run(["bags"])
        return time.perf_counter() - began, counts.seconds, used_by_all() - before


def keep(file: Path | None, part: str, bags: int, found: Any) -> None:
    """A line in a file as a part of the benchmark ends."""
    if file is not None:
        with file.open("a") as lines:
            lines.write(json.dumps({"part": part, "bags": bags, "found": found}) + "\n")


def simulated(folder: Path, bags: int) -> Path:
    """A fleet of as many bags, and a few seconds."""
    robots = min(ROBOTS, bags)
    size = ["--robots", str(robots), "--weeks", str(-(-bags // robots))]
    command = [sys.executable, "-m", "sysid_ros.cli.main", "simulate", "fleet", "--bag", str(folder / "fleet"), *size]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return folder / "fleet"


def show(rows: list[tuple[str, int, float, float, int]]) -> None:
    """Of each run: bags, time, processor time, processes that work."""
    table = Table(title="fleet_speed", title_justify="left")
    for column in ("", "bags", "time s", "processor time s", "a bag s", "bags a second and core"):
        table.add_column(column, justify="left" if not column else "right")
    for name, count, took, used, cores in rows:
        table.add_row(name, str(count), f"{took:.1f}", f"{used:.1f}", f"{used / count:.3f}", f"{count / took / cores:.2f}")
    Console(width=130).print(table)


def asked() -> argparse.Namespace:
    """What is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fleet", type=Path)
    parser.add_argument("--bags", type=int, default=2000)
    parser.add_argument("--sample", type=int, default=100)
    parser.add_argument("--jobs", default="track,replay")
    parser.add_argument("--cluster-only", type=float, nargs="+", metavar="SECONDS", help="only the last part, with these times")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--so-far", type=Path, metavar="FILE")
    return parser.parse_args()


def main() -> int:
    """Run it."""
    options = asked()
    if options.cluster_only:
        with tempfile.TemporaryDirectory(prefix="sysid_fleet_") as alone:
            cluster, a_task = many_workers(options.cluster_only, Path(alone))
        return conclude("fleet_speed", cluster, {"a task": a_task}, options.json)
    jobs, folder = tuple(options.jobs.split(",")), Path(tempfile.mkdtemp(prefix="sysid_fleet_"))
    try:
        fleet = options.fleet or simulated(folder, options.bags)
        robots, bags = fleet / "robots.yaml", list(islice(find([str(fleet)]), options.bags))
        sample = bags[:: max(1, len(bags) // options.sample)][: options.sample]
        stores = {name: Store(folder / name, create=True) for name in ("one", "two", "all")}
        so_far, n, watch = options.so_far, len(sample), Watch()
        took, each = calls(sample, robots, jobs)
        keep(so_far, "calls in one process", n, [took, sum(each)])
        pair, pair_used = side_by_side(sample, robots, jobs)
        keep(so_far, "calls in two processes", n, [pair, pair_used])
        one = through(sample, robots, jobs, 1, stores["one"])
        keep(so_far, "batch, 1 worker", n, one)
        two = through(sample, robots, jobs, 2, stores["two"])
        keep(so_far, "batch, 2 workers", n, two)
        full = through(bags, robots, jobs, 2, stores["all"], watch)
        keep(so_far, "batch, all bags, 2 workers", len(bags), [*full, *watch.growth()])
        values = [stores[name].read("joints").drop_columns(["covariance"]) for name in ("one", "two")]
        cluster, a_task = many_workers(each, folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    used = sum(each)
    show(
        [
            ("calls in one process", n, took, used, 1), ("calls in two processes", n, pair, pair_used, 2),
            ("batch, 1 worker, all processes", n, one[0], one[2], 1), ("batch, 2 workers, all processes", n, two[0], two[2], 2),
            ("batch, all bags, 2 workers, all processes", len(bags), full[0], full[2], 2),
        ]
    )  # fmt: skip
    mine, workers = watch.growth()
    targets = [
        Target("processor time of all processes, 1 worker, over that of the calls in one process", one[2] / used, high=1.15),
        Target("the same, 2 workers, over that of the calls in two processes at once", two[2] / pair_used, high=1.15),
        Target(
            "the same, all bags on 2 workers, a bag, over that of the calls in one process",
            full[2] / len(bags) / (used / n),
            high=1.15,
        ),
        Target("time on 1 worker over that on 2", one[0] / two[0], 1.8),
        Target("stores of 1 and 2 workers with other values", float(not values[0].equals(values[1])), high=0.0),
        Target("memory of driver and scheduler, second to last quarter of all bags [MB]", mine, high=50.0),
        Target("memory of the largest worker, second to last quarter of all bags [MB]", workers, high=50.0),
        *cluster,
    ]
    results: dict[str, Any] = {
        "bags": len(bags), "jobs": list(jobs), "calls": [took, used], "side by side": [pair, pair_used], "1 worker": one,
        "2 workers": two, "all": full, "each": each, "memory": watch.rows, "scaling of this machine": took / pair,
        "a task": a_task,
    }  # fmt: skip
    return conclude("fleet_speed", targets, results, options.json)


if __name__ == "__main__":
    raise SystemExit(main())
