"""What a report tells for machines: the table ``alarms`` of a store, and a JSON document."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sysid_ros.files import whole
from sysid_ros.fleet import campaign_table
from sysid_ros.fleet.changes.alarms import Alarm, changed_share, limit_of
from sysid_ros.fleet.changes.campaigns import RobotCampaigns, log_es
from sysid_ros.fleet.changes.fleet_changes import FleetChanges
from sysid_ros.fleet.changes.series import FleetSeries
from sysid_ros.fleet.schema import SCHEMA_VERSION, require_pyarrow
from sysid_ros.fleet.store import Store

ALARM_COLUMNS = {
    "robot": "name",
    "joint": "name; empty for what is carried",
    "quantity": "parameter of the joints' table, or payload",
    "what": "in words",
    "since": "median of when it began",
    "since_low": "2.5 % of it",
    "since_high": "97.5 % of it",
    "length": "how long it took [days]",
    "size": "of the change [SI]",
    "size_std": "standard deviation [SI]",
    "log_e": "logarithm of the e-value that anything changed on this joint",
    "probability": "that anything changed there",
    "probability_of_quantity": "that it is this quantity, given that something changed",
    "cost": "in words",
    "look_at": "in words",
    "bags_before": "paths",
    "bags_after": "paths",
}
"""Columns of the table ``alarms``: name to what it holds."""


def rows(alarms: Sequence[Alarm], series: FleetSeries) -> list[dict[str, Any]]:
    """A row an alarm, with dates in UTC."""
    return [
        {
            "robot": a.change.robot,
            "joint": a.change.joint,
            "quantity": a.change.quantity,
            "what": a.what,
            "since": series.date(a.change.since[0]),
            "since_low": series.date(a.change.since[1]),
            "since_high": series.date(a.change.since[2]),
            "length": a.change.length,
            "size": a.change.size,
            "size_std": a.change.std,
            "log_e": a.change.log_e,
            "probability": a.probability,
            "probability_of_quantity": a.of_kind,
            "cost": a.cost,
            "look_at": a.look,
            "bags_before": list(a.before),
            "bags_after": list(a.after),
        }
        for a in alarms
    ]


def write_alarms(store: Store, alarms: Sequence[Alarm], series: FleetSeries) -> None:
    """Write the table ``alarms`` of a store, in place of the one of the last report.

    Raises:
        OutputError: it can't be written.
    """
    pa = require_pyarrow()
    from pyarrow import parquet

    times = ("since", "since_low", "since_high")
    numbers = ("length", "size", "size_std", "log_e", "probability", "probability_of_quantity")
    kinds = {name: pa.timestamp("us", tz="UTC") for name in times} | dict.fromkeys(numbers, pa.float64())
    kinds |= dict.fromkeys(("bags_before", "bags_after"), pa.list_(pa.string()))
    fields = [pa.field(n, kinds.get(n, pa.string()), metadata={"about": about}) for n, about in ALARM_COLUMNS.items()]
    schema = pa.schema(fields, metadata={"sysid_schema_version": str(SCHEMA_VERSION), "sysid_table": "alarms"})
    path = store.path / "alarms" / "alarms.parquet"
    path.parent.mkdir(exist_ok=True)
    with whole(path) as beside:
        parquet.write_table(pa.Table.from_pylist(rows(alarms, series), schema=schema), beside, compression="zstd")


def document(
    alarms: Sequence[Alarm], changes: FleetChanges, rate: float, campaigns: Sequence[RobotCampaigns] = ()
) -> dict[str, Any]:
    """The result for machines."""
    looks = [*changes.looks, *log_es(campaigns)]
    share = changed_share(looks)
    told = [row | {k: v.isoformat() for k, v in row.items() if k.startswith("since")} for row in rows(alarms, changes.series)]
    return {
        "robots": len(changes.series.robots),
        "bags": sum(len(r.bags) for r in changes.series.robots),
        "looks": len(looks),
        "false_discovery_rate": rate,
        "share_of_looks_that_changed": share,
        "alarms": told,
        "campaigns": campaign_table.document(campaigns, limit_of(looks, rate), share),
        "notes": list(changes.series.notes),
    }
