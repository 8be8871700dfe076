"""sysid batch on Dask as it is used: a scheduler and workers in processes of their own, over TCP, also where they are killed."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from fleet_bags import write_fleet
from test_fleet_batch import RULES, content, done

pytest.importorskip("pyarrow", reason="the extra fleet is not installed")
pytest.importorskip("distributed", reason="the extra fleet is not installed")

from sysid_ros.exceptions import ClusterError
from sysid_ros.fleet.batch import Batch
from sysid_ros.fleet.cluster import CALM, connected
from sysid_ros.fleet.store import Store

pytestmark = pytest.mark.slow


@contextmanager
def ended(process: subprocess.Popen[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    """A process with its children, which ends with the block."""
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def start(module: str, *arguments: str) -> subprocess.Popen[bytes]:
    command, quiet = [sys.executable, "-m", f"distributed.cli.{module}", *arguments], subprocess.DEVNULL
    return subprocess.Popen(command, stdout=quiet, stderr=quiet, start_new_session=True)


def scheduler(folder: Path) -> tuple[subprocess.Popen[bytes], str]:
    import json

    file = folder / f"scheduler_{time.monotonic_ns()}.json"
    process = start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        with suppress(OSError, ValueError, KeyError):
            return process, str(json.loads(file.read_text())["address"])
        time.sleep(0.1)
    raise TimeoutError("the scheduler does not start")


def worker(address: str) -> subprocess.Popen[bytes]:
    return start("dask_worker", address, "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four robots of five bags; one in twenty is broken."""
    folder = tmp_path_factory.mktemp("fleet")
    write_fleet(folder, robots=4, bags=5, broken=(7,))
    return folder


@pytest.fixture(scope="module")
def expected(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The store of one process."""
    import distributed

    store = tmp_path_factory.mktemp("expected") / "store"
    with distributed.Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as client:
        done(store, fleet, client)
    return store


def test_processes_on_this_machine_keep_free_memory() -> None:
    """Dask has the C library give back all but 64 kB: each larger array of a job would be fetched anew."""
    name = "MALLOC_TRIM_THRESHOLD_"
    with connected(workers=1) as client:
        assert list(client.run(os.environ.get, name).values()) == [str(CALM[f"distributed.nanny.pre-spawn-environ.{name}"])]


def test_processes_of_their_own_give_the_same_values(tmp_path: Path, fleet: Path, expected: Path) -> None:
    process, address = scheduler(tmp_path)
    with ended(process), ended(worker(address)), ended(worker(address)), connected(address) as client:
        client.wait_for_workers(2, timeout=60)
        counts = done(tmp_path / "store", fleet, client)
    assert (counts.done, counts.failed) == (19, 1)
    assert content(tmp_path / "store") == content(expected)


def test_workers_and_the_scheduler_are_killed_and_nothing_is_lost(tmp_path: Path, fleet: Path, expected: Path) -> None:
    """Workers' processes die at random while their nannies start them again; then the scheduler dies, and the command is given
    again with another one."""
    rng, through = random.Random(1), 0
    process, address = scheduler(tmp_path)

    def fault(bags: int) -> None:
        nonlocal through
        through += bags
        if through == 12:
            os.killpg(process.pid, signal.SIGKILL)
        elif through % 3 == 0 and through < 12:
            pids = list(client.run(os.getpid, on_error="ignore").values())  # one of before may die just now
            if pids:
                os.kill(rng.choice(pids), signal.SIGKILL)

    store = Store(tmp_path / "store", create=True)
    with ended(process), ended(worker(address)), ended(worker(address)), connected(address) as client:
        client.wait_for_workers(2, timeout=60)
        with store.writing(), pytest.raises(ClusterError, match="same command again"):
            Batch(store, RULES, ["track"], client, fault).run([str(fleet)])
    kept = len(store.read("bags"))
    assert kept >= 11
    process, address = scheduler(tmp_path)
    with ended(process), ended(worker(address)), connected(address) as client:
        rest = done(tmp_path / "store", fleet, client)
    assert rest.skipped == kept
    assert content(tmp_path / "store") == content(expected)
