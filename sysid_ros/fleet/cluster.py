"""The processes that do a fleet's jobs: Dask's, on this machine or wherever its scheduler is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from sysid_ros.exceptions import ClusterError, SettingsError, in_a_line

_PATIENCE = 10.0
"""Time for a scheduler to answer [s]."""
_OFTEN = 20
"""Workers that may die over a task before it is given up: on one machine, where they die of other things than the task."""
_KEPT = 64 * 2**20
"""Free memory that a worker keeps for what it does next, and half of it a piece [bytes]: about what the C library comes to by
itself. With Dask's 64 kB each larger array is fetched from the system anew and given back, and ``track`` takes 2.4 times as
long."""
CALM = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.admin.tick.interval": "1s",
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": _KEPT,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": _KEPT // 2,
}
"""What Dask's processes keep, and what they look at beside the work, how often: as it comes, up to a hundred times a second,
driver, scheduler and worker add 15 % to the processor time of ``track``, so 8 % (24 bags). Nothing here is copied: there are no
replicas to remove."""


def require_dask() -> Any:
    """The module ``distributed``.

    Raises:
        SettingsError: it is not installed.
    """
    try:
        import distributed
    except ImportError:
        raise SettingsError(
            "sysid batch runs on Dask, which is not installed. Install it: pip install 'sysid_ros[fleet]'"
        ) from None
    return distributed


@contextmanager
def connected(scheduler: str = "", workers: int = 0) -> Iterator[Any]:
    """A ``distributed.Client`` of the scheduler at an address, or of processes on this machine, one for each core or as many as
    are asked for, which end with the block.

    Raises:
        SettingsError: Dask is not installed. ClusterError: no scheduler answers, or the processes can't be started.
    """
    distributed = require_dask()
    import dask

    if scheduler:
        with _client(distributed, scheduler) as client:
            yield client
        return
    with dask.config.set(CALM | {"distributed.scheduler.allowed-failures": _OFTEN}):
        try:
            cluster = distributed.LocalCluster(
                n_workers=workers or None, threads_per_worker=1, processes=True, silence_logs="CRITICAL", host="127.0.0.1"
            )
        except Exception as error:
            raise ClusterError(f"Dask's processes can't be started on this machine: {in_a_line(error)}.") from error
        with cluster, _client(distributed, cluster) as client:
            yield client


@contextmanager
def _client(distributed: Any, where: Any) -> Iterator[Any]:
    try:
        client = distributed.Client(where, timeout=_PATIENCE)
    except (OSError, ValueError, TimeoutError) as error:
        raise ClusterError(
            f"no Dask scheduler answers at '{where}' ({in_a_line(error)}). Start one with `dask scheduler`, and give the address "
            "that it prints, such as tcp://host:8786."
        ) from error
    try:
        yield client
    finally:
        client.close(timeout=_PATIENCE)


def threads_of(client: Any) -> int:
    """How many tasks run at once now."""
    return sum(client.nthreads().values())


def dashboard_of(client: Any) -> str:
    """URL of Dask's dashboard; empty where it has none."""
    return str(client.dashboard_link) if find_spec("bokeh") else ""
