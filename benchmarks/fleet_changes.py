"""What changed in a fleet over a year: found, named and dated, beside CUSUM and moving-average charts on the same store.

40 robots, 50 weeks, a bag a week; a tenth of the robots each: Coulomb friction that doubles in two months, an offset of 2 % of
the effort limit, a zero that slips by half a degree, a gain of 5 %, a tool of 0.3 kg. Seasons, loads, scatter, slow drift in all.
A found change is an alarm on its robot and joint; every other alarm is a false discovery.

    python benchmarks/fleet_changes.py --seeds 10 11 12 [--quiet-seeds 30 31] [--stores FOLDER...] --json out.json

``--quiet-seeds``: fleets in which nothing changes. ``--stores``: folders that hold a store ``store/`` made from bags and the
``truth.yaml`` of `sysid simulate fleet`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from fleet_charts import Crossing, crossings, cusum, moving_average, told_by
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.fleet.changes.alarms import RATE, alarms
from sysid_ros.fleet.changes.fleet_changes import fleet_changes
from sysid_ros.fleet.changes.quantities import CARRIED
from sysid_ros.fleet.changes.series import FleetSeries, fleet_series
from sysid_ros.fleet.store import Results, Store
from sysid_ros.simulation.fleet.drawn_fleet import draw_fleet
from sysid_ros.simulation.fleet.fleet_scenario import FleetScenario
from sysid_ros.simulation.fleet.fleet_tables import drawn_rows
from sysid_ros.simulation.fleet.plain_arm import KINDS, plain_arm

WEEKS = 14.0
"""Days by which a date may be wrong."""
Told = tuple[str, str, str, float]
"""Robot, joint, quantity, day."""


def judged(told: Sequence[Told], truth: Mapping[str, Any], start: datetime) -> dict[str, Any]:
    """How many changes were found, named and dated, and how many alarms are false; alarms come in the order of their strength."""
    left = list(told)
    rows = []
    for change in truth["changes"]:
        where = (change["robot"], change["joint"] or "")
        mine = [t for t in left if t[:2] == where]
        parameter = change["parameter"] if change["joint"] else CARRIED
        row: dict[str, Any] = {"cause": change["cause"], "found": bool(mine), "kind": False, "days": None}
        if mine:
            left.remove(mine[0])
            day = (datetime.fromisoformat(change["date"]) - start).total_seconds() / 86400.0
            row |= {"kind": mine[0][2] == parameter, "days": mine[0][3] - day}
        rows.append(row)
    return {"changes": rows, "alarms": len(told), "false": len(left)}


def of_method(series: FleetSeries) -> tuple[list[Told], list[dict[str, Any]], float]:
    """What the fleet's changes tell, with dates' intervals, and the time it took [s]."""
    began = time.process_time()
    found = alarms(fleet_changes(series))
    told = [(a.change.robot, a.change.joint, a.change.quantity, a.change.since[0]) for a in found]
    more = [{"low": a.change.since[1], "high": a.change.since[2], "probability": a.probability} for a in found]
    return told, more, time.process_time() - began


def of_chart(charted: list[Crossing], limit: float) -> list[Told]:
    """What a chart tells."""
    found = sorted(told_by(charted, limit), key=lambda c: -c.worst)
    return [(c.robot, c.joint, c.quantity, c.day) for c in found]


def of_tuned_chart(charted: list[Crossing], truth: Mapping[str, Any], start: datetime) -> list[Told]:
    """What a chart tells at the lowest limit at which its false discoveries are at most those stated: chosen with the truth,
    which nobody has; in its favour."""
    for limit in np.geomspace(1.0, 1000.0, 60):
        told = of_chart(charted, float(limit))
        if told and judged(told, truth, start)["false"] <= RATE * len(told):
            return told
    return []


def methods(series: FleetSeries, truth: Mapping[str, Any]) -> dict[str, Any]:
    """Judgement of each."""
    told, more, seconds = of_method(series)
    out = {"this": judged(told, truth, series.start) | {"seconds": seconds, "intervals": more}}
    for name, chart in (("CUSUM", cusum), ("moving average", moving_average)):
        charted = crossings(series, chart)
        out[name] = judged(of_chart(charted, 1.0), truth, series.start)
        tuned = of_tuned_chart(charted, truth, series.start)
        out[f"{name}, limit chosen by the truth"] = judged(tuned, truth, series.start)
    return out


def drawn(seed: int, quiet: bool) -> tuple[FleetSeries, dict[str, Any]]:
    """A fleet's store drawn from the error model."""
    kinds = {kind: plain_arm(kind, *values) for kind, values in KINDS.items()}
    scenario = FleetScenario(seed=seed, changes={}) if quiet else FleetScenario(seed=seed)
    fleet = draw_fleet(scenario, kinds)
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder) / "store", create=True)
        store.append([Results(r.bag, r.joints, r.payloads) for r in drawn_rows(fleet)])
        return fleet_series(store), fleet.truth()


def summary(results: Sequence[dict[str, Any]], name: str) -> dict[str, float]:
    """Over several fleets."""
    rows = [row for r in results for row in r[name]["changes"]]
    found = [row for row in rows if row["found"]]
    days = [abs(row["days"]) for row in found]
    return {
        "changes": len(rows),
        "found": len(found) / max(len(rows), 1),
        "kind": float(np.mean([row["kind"] for row in found])) if found else 0.0,
        "dated": float(np.mean([d <= WEEKS for d in days])) if days else 0.0,
        "median_days": float(np.median(days)) if days else float("nan"),
        "false": float(np.mean([r[name]["false"] / max(r[name]["alarms"], 1) for r in results])),
        "alarms": sum(r[name]["alarms"] for r in results),
    }


def shown(results: Sequence[dict[str, Any]]) -> None:
    """The table of all methods, and of the causes one by one."""
    out = Table(title="Changes of a fleet", title_justify="left")
    for column in ("method", "changes", "found", "kind right", "within two weeks", "median error [days]", "false discoveries"):
        out.add_column(column, justify="left" if column == "method" else "right")
    for name in results[0]:
        s = summary(results, name)
        shares = [f"{100.0 * s[key]:.1f} %" for key in ("found", "kind", "dated")]
        out.add_row(name, f"{s['changes']:g}", *shares, f"{s['median_days']:.1f}", f"{100.0 * s['false']:.1f} %")
    causes = Table(title="By cause, this package", title_justify="left")
    for column in ("cause", "changes", "found", "kind right", "within two weeks"):
        causes.add_column(column, justify="right" if column != "cause" else "left")
    rows = [row for r in results for row in r["this"]["changes"]]
    for cause in dict.fromkeys(row["cause"] for row in rows):
        of = [row for row in rows if row["cause"] == cause]
        dated = [row for row in of if row["found"] and abs(row["days"]) <= WEEKS]
        kind = sum(row["kind"] for row in of)
        causes.add_row(cause, str(len(of)), str(sum(r["found"] for r in of)), str(kind), str(len(dated)))
    console = Console(width=130)
    console.print(out)
    console.print(causes)


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="*", default=[10])
    parser.add_argument("--quiet-seeds", type=int, nargs="*", default=[])
    parser.add_argument("--stores", type=Path, nargs="*", default=[])
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    results = []
    for seed in given.seeds:
        series, truth = drawn(seed, quiet=False)
        results.append(methods(series, truth))
        _said(f"seed {seed}", results[-1])
    for folder in given.stores:
        truth = yaml.safe_load((folder / "truth.yaml").read_text(encoding="utf-8"))
        results.append(methods(fleet_series(Store(folder / "store")), truth))
        _said(str(folder), results[-1])
    quiet = []
    for seed in given.quiet_seeds:
        series, truth = drawn(seed, quiet=True)
        quiet.append(judged(of_method(series)[0], truth, series.start)["alarms"])
        print(f"seed {seed}, nothing changes: {quiet[-1]} alarms", flush=True)
    shown(results)
    s = summary(results, "this")
    targets = [
        Target("changes found, share", s["found"], low=0.95),
        Target("their kind right, share", s["kind"], low=0.9),
        Target("their date within two weeks, share", s["dated"], low=0.9),
        Target("false discoveries, mean share of the alarms", s["false"], high=RATE),
    ]
    if quiet:
        # where nothing changes, every alarm is false: the rate bounds the share of fleets that have one
        targets.append(
            Target("fleets with an alarm where nothing changes, share", float(np.mean(np.array(quiet) > 0)), high=RATE)
        )
    return conclude("fleet_changes", targets, {"fleets": results, "quiet": quiet}, given.json)


def _said(what: str, result: dict[str, Any]) -> None:
    mine = result["this"]
    rows = mine["changes"]
    late = [r for r in rows if not r["kind"] or abs(r["days"]) > WEEKS]
    wrong = [(r["cause"], r["found"], r["kind"], r["days"]) for r in late]
    print(
        f"{what}: {sum(r['found'] for r in rows)} of {len(rows)}, false {mine['false']}, {mine['seconds']:.0f} s; {wrong}",
        flush=True,
    )


if __name__ == "__main__":
    sys.exit(main())
