"""How fast ``sysid batch`` is beside the same calls in one process, how it scales, and what its driver needs.

    sysid simulate fleet --bag fleet --robots 40 --weeks 50
    python benchmarks/fleet_speed.py --fleet fleet --bags 2000 --jobs track,replay

The last part is a cluster of 100 workers that sleep for the time a bag took here, with 10,000 names, through the same driver.
"""

from __future__ import annotations

import argparse
import resource
import shutil
import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any
from unittest import mock

from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros import __version__
from sysid_ros.fleet import batch as driver
from sysid_ros.fleet.bags import find, stamp_of
from sysid_ros.fleet.batch import Batch
from sysid_ros.fleet.cluster import connected
from sysid_ros.fleet.jobs import Task, run
from sysid_ros.fleet.rules import Entry, Rules
from sysid_ros.fleet.store import Results, Store

NAMES, WORKERS = 10_000, 100


def peak() -> float:
    """Memory of this process at its largest [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def alone(bags: Sequence[str], rules: Rules, jobs: tuple[str, ...]) -> tuple[float, list[float]]:
    """Processor time of the calls in this process [s], and that of each bag."""
    each = []
    for bag in bags:
        began = time.process_time()
        run(Task(bag, stamp_of(bag), jobs), tuple(rules.entries(bag)))
        each.append(time.process_time() - began)
    return sum(each), each


def through(bags: Sequence[str], rules: Rules, jobs: tuple[str, ...], workers: int, folder: Path) -> tuple[float, float, float]:
    """Time [s], processor time of the jobs [s] and growth of the driver's memory [MB], of the whole batch on warm workers."""
    store = Store(folder / f"store_{workers}", create=True)
    with connected(workers=workers) as client, store.writing():
        client.run(warm, bags[0], rules.entries(bags[0]), jobs)
        before, began = peak(), time.perf_counter()
        with mock.patch.object(driver, "find", return_value=iter(bags)):
            counts = Batch(store, rules, jobs, client).run(["bags"])
        return time.perf_counter() - began, counts.seconds, peak() - before


def warm(bag: str, entries: list[Entry], jobs: tuple[str, ...]) -> None:
    """What a process loads and compiles once."""
    run(Task(bag, "", jobs), tuple(entries))


def asleep(task: Task, entries: Sequence[Entry]) -> list[Results]:
    """A job that takes its time and no processor."""
    seconds = float(entries[0].kind)
    time.sleep(seconds)
    row = {
        "bag": task.bag,
        "stamp": "",
        "hash": task.bag,
        "model": entries[0].digest,
        "version": __version__,
        "job": task.jobs[0],
    }
    return [Results({**row, "robot": "r", "kind": "k", "status": "ok", "reason": "", "seconds": seconds})]


def names(count: int) -> Iterator[str]:
    return (f"/nowhere/bag_{k}" for k in range(count))


def many_workers(seconds: float, folder: Path) -> tuple[float, float]:
    """Part of the time that 100 workers are busy, and by how much the driver grows from a tenth of 10,000 names to all [MB]."""
    import distributed

    rules, at_a_tenth, through = Rules({"robots": [{"robot": "r", "kind": str(seconds)}]}, Path()), 0.0, 0

    def advance(bags: int) -> None:
        nonlocal at_a_tenth, through
        through += bags
        if through == NAMES // 10:
            at_a_tenth = peak()

    store = Store(folder / "asleep", create=True)
    with (
        distributed.Client(
            processes=False, n_workers=WORKERS, threads_per_worker=1, memory_limit=0, dashboard_address=None
        ) as client,
        store.writing(),
        mock.patch.object(driver, "find", return_value=names(NAMES)),
        mock.patch.object(driver, "run", asleep),
    ):
        began = time.perf_counter()
        Batch(store, rules, ["track"], client, advance).run(["bags"])
        took = time.perf_counter() - began
    return NAMES * seconds / (WORKERS * took), peak() - at_a_tenth


def show(rows: list[tuple[str, float, float, float]], count: int) -> None:
    table = Table(title=f"{count} bags", title_justify="left")
    for column in ("", "time s", "processor time of the jobs s", "bags a second"):
        table.add_column(column, justify="left" if not column else "right")
    for name, took, used, _ in rows:
        table.add_row(name, f"{took:.1f}", f"{used:.1f}", f"{count / took:.2f}")
    Console(width=130).print(table)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleet", type=Path, required=True)
    parser.add_argument("--bags", type=int, default=2000)
    parser.add_argument("--jobs", default="track,replay")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    jobs, rules = tuple(options.jobs.split(",")), Rules.read(options.fleet / "robots.yaml")
    bags = list(islice(find([str(options.fleet)]), options.bags))
    folder = Path(tempfile.mkdtemp(prefix="sysid_fleet_"))
    try:
        warm(bags[0], rules.entries(bags[0]), jobs)
        used, each = alone(bags, rules, jobs)
        one, two = (through(bags, rules, jobs, workers, folder) for workers in (1, 2))
        values = [Store(folder / f"store_{w}").read("joints").drop_columns(["covariance"]) for w in (1, 2)]
        busy, grown = many_workers(round(statistics.median(each), 3), folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    show([("one process", used, used, 0.0), ("1 worker", *one), ("2 workers", *two)], len(bags))
    targets = [
        Target("processor time of the jobs on 2 workers over that in one process", two[1] / used, high=1.15),
        Target("time on 1 worker over that on 2", one[0] / two[0], 1.8),
        Target("median processor time of a bag [s]", statistics.median(each), high=0.5 if jobs == ("track",) else float("inf")),
        Target("stores of 1 and 2 workers with other values", float(not values[0].equals(values[1])), high=0.0),
        Target("100 workers, part of the time busy", busy, 0.9),
        Target("driver's memory, from 1,000 to 10,000 names [MB]", grown, high=50.0),
    ]
    results: dict[str, Any] = {"bags": len(bags), "one process": used, "1 worker": one, "2 workers": two, "each": each}
    return conclude("fleet_speed", targets, results, options.json)


if __name__ == "__main__":
    raise SystemExit(main())
