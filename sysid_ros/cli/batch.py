"""``sysid batch``: the same jobs on many bags of many robots, on Dask, into a store of Parquet files."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from sysid_ros.cli import batch_report
from sysid_ros.cli import options as opt
from sysid_ros.cli.output import check_outputs, note, report, table, warn, write_json
from sysid_ros.cli.progress import progress_bar
from sysid_ros.exceptions import SettingsError
from sysid_ros.fleet.jobs import JOBS


class _WithReport(click.Command):
    """The command, or ``report`` where that is its first argument: a bag is called by a path."""

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        """Of one or the other."""
        if args[:1] == ["report"]:
            return batch_report.command.make_context(f"{info_name} report", args[1:], parent, **extra)
        return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: click.Context) -> Any:
        """That whose context it is."""
        return super().invoke(ctx) if ctx.command is self else ctx.command.invoke(ctx)


@click.command(cls=_WithReport)
@click.argument("patterns", nargs=-1, required=True, metavar="PATTERN...")
@opt.path("--robots", required=True, metavar="YAML", help="Which robot a bag is of, and what is known of it: see docs/fleet.md.")
@opt.path("--out", required=True, metavar="STORE", help="Folder of the results, made where it is not there.")
@click.option("--jobs", default="track", show_default=True, metavar="JOB[,JOB]", help=f"Of {', '.join(JOBS)}.")
@click.option("--scheduler", default="", metavar="tcp://HOST:PORT", help="Of a Dask cluster; else processes on this machine.")
@click.option("--workers", type=click.IntRange(min=1), help="Processes on this machine.  [default: one a core]")
@click.option("--resume/--retry-failed", default=True, show_default=True, help="Leave what has failed, or try it again.")
@opt.JSON
@opt.FORCE
def command(
    patterns: tuple[str, ...],
    robots: Path,
    out: Path,
    jobs: str,
    scheduler: str,
    workers: int | None,
    resume: bool,
    json_path: Path | None,
    force: bool,
) -> int:
    """Do jobs on many bags and keep what they find, a row a bag, joint, payload and event.

    Bags are rosbag2 folders, .mcap and .db3 files: by folder, by glob in quotes, or by a URL of fsspec (s3://, gs://). What a
    store holds is not done again, so the same command goes on after any stop, and takes in new bags.

    \b
    Examples:
      sysid batch bags/ --robots robots.yaml --out store
      sysid batch 'bags/cell_*/**/*.mcap' --robots robots.yaml --out store --jobs track,replay --workers 4
      sysid batch s3://plant/bags --robots robots.yaml --out store --scheduler tcp://scheduler:8786
      sysid batch report store

    Exit codes: 0 done; 1 done, and some bags have failed, each with its reason in the store; 2 bad input or usage.
    """
    from sysid_ros.fleet.bags import find
    from sysid_ros.fleet.batch import Batch, failed_before
    from sysid_ros.fleet.cluster import connected, dashboard_of, require_dask
    from sysid_ros.fleet.rules import Rules
    from sysid_ros.fleet.store import Store

    require_dask()
    check_outputs(force, json=json_path)
    wanted = _jobs(jobs)
    if scheduler and workers:
        raise SettingsError("--workers is given beside --scheduler, whose workers are its own. Leave one of the two out.")
    rules = Rules.read(robots)
    # what is wrong with a date is said before the work, not in the midst of it
    total = sum(1 for bag in find(patterns) if rules.told(bag) is not None)
    store = Store(out, create=True)
    began = time.perf_counter()
    with store.writing():
        if not resume:
            note(f"{store.forget(failed_before(store))} failed results are tried again.")
        with connected(scheduler, workers or 0) as client:
            note(f"Dask: {dashboard_of(client) or 'its dashboard needs bokeh: pip install bokeh'}")
            with progress_bar("Bags", total) as advance:
                counts = Batch(store, rules, wanted, client, advance).run(patterns)
    _show(counts, out, time.perf_counter() - began)
    if json_path is not None:
        write_json(json_path, {**vars(counts), "elapsed": time.perf_counter() - began, "store": str(out)})
    return 1 if counts.failed or counts.unknown else 0


def _jobs(given: str) -> list[str]:
    wanted = [job.strip() for job in given.split(",") if job.strip()]
    unknown = [job for job in wanted if job not in JOBS]
    if unknown or not wanted:
        raise SettingsError(f"--jobs is '{given}'; it must be one or more of {', '.join(JOBS)}, with commas between them.")
    return list(dict.fromkeys(wanted))


def _show(counts: Any, out: Path, elapsed: float) -> None:
    shown = table("Batch", "", "")
    for name, value in (
        ("bags", counts.found), ("done before", counts.skipped), ("results", counts.done), ("failed", counts.failed),
        ("processor time", f"{counts.seconds:.1f} s"), ("took", f"{elapsed:.1f} s"), ("store", out),
    ):  # fmt: skip
        shown.add_row(name, str(value))
    report().print(shown)
    for bag, reason in counts.reasons.items():
        warn(f"{bag}: {reason}")
    if counts.unknown:
        warn(f"No rule of robots.yaml is for {', '.join(counts.unknown)}{' and others' if len(counts.unknown) >= 20 else ''}.")
