"""``sysid batch report``: what changed in a fleet over time, as alarms and as a page, from the store of `sysid batch`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from sysid_ros.cli import options as opt
from sysid_ros.cli.output import check_outputs, note, report, table, write_json
from sysid_ros.cli.progress import stages
from sysid_ros.files import write_text

_PAGE = "report.html"


@click.command()
@click.argument("store", type=opt.PATH)
@opt.path("--out", metavar="HTML", help=f"The page.  [default: {_PAGE} in the store]")
@click.option(
    "--rate",
    type=opt.Range(0.0, 0.5, min_open=True),
    default=0.05,
    show_default=True,
    help="Of the alarms, so many may be expected to be false.",
)
@opt.JSON
@opt.FORCE
def command(store: Path, out: Path | None, rate: float, json_path: Path | None, force: bool) -> int:
    """Say what changed on which robot, since when and how sure that is, and write a page of the fleet.

    Judged is what the job track found. The alarms also go into the store, as the table alarms.

    \b
    Examples:
      sysid batch report store
      sysid batch report store --out fleet.html --rate 0.01 --json alarms.json

    Exit codes: 0 done, whether or not something changed; 2 bad input or usage.
    """
    from sysid_ros.fleet.alarm_table import document, write_alarms
    from sysid_ros.fleet.changes.alarms import alarms, limit_of
    from sysid_ros.fleet.changes.campaigns import campaigns_of, log_es
    from sysid_ros.fleet.changes.fleet_changes import fleet_changes
    from sysid_ros.fleet.changes.series import fleet_series
    from sysid_ros.fleet.fleet_page import fleet_page
    from sysid_ros.fleet.store import Store

    opened = Store(store)
    path = out or store / _PAGE
    # the page in the store is of it, as its tables are: it is made anew
    check_outputs(force or out is None, out=path)
    check_outputs(force, json=json_path)
    with stages() as said:
        said("Reading the store")
        series = fleet_series(opened)
        changes = fleet_changes(series, said)
        campaigns = campaigns_of(opened)
        found = alarms(changes, rate, log_es(campaigns))
    failed = [b for b in opened.read("bags", ["bag", "status", "reason"]).to_pylist() if b["status"] != "ok"]
    write_text(path, fleet_page(changes, found, failed, rate, str(store), campaigns))
    write_alarms(opened, found, series)
    if json_path is not None:
        write_json(json_path, document(found, changes, rate, campaigns))
    _show(found, series, campaigns, limit_of([*changes.looks, *log_es(campaigns)], rate))
    note(f"The page is {path}.")
    for sentence in series.notes:
        note(sentence)
    return 0


def _show(found: Any, series: Any, campaigns: Any, limit: float) -> None:
    from sysid_ros.fleet.campaign_table import tables
    from sysid_ros.fleet.changes.alarms import percent
    from sysid_ros.fleet.fleet_page import answer

    columns = ("robot", "what", "since", "95 %", "sure", "costs")
    shown = table(f"What changed on {len(series.robots)} robots", *columns, words=("what", "costs"))
    for a in found:
        c = a.change
        low, high = (f"{series.date(day):%m-%d}" for day in c.since[1:])
        sure = percent(a.probability * a.of_kind)
        shown.add_row(c.robot, a.what, f"{series.date(c.since[0]):%Y-%m-%d}", f"{low}..{high}", sure, a.cost)
    if found:
        report().print(shown)
    report().print(answer(found, series, campaigns, limit))
    for of in tables(campaigns, limit, 0.0):
        if of["told"]:
            told = table(
                f"{of['robot']} by campaign: difference with its 95 % interval", "what", *of["campaigns"], words=("what",)
            )
            for row in of["told"]:
                told.add_row(f"{row['what']} [{row['unit']}]", *(cell["difference"] or cell["value"] for cell in row["cells"]))
            report().print(told)
        for sentence in of["said"]:
            note(sentence)
