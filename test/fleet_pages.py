"""The page of a small fleet, with robots by time and one by campaigns."""

from __future__ import annotations

from pathlib import Path

from test_fleet_changes import small_fleet, stored
from test_fleet_dates import campaign_store

from sysid_ros.fleet.changes.alarms import alarms
from sysid_ros.fleet.changes.campaigns import campaigns_of, log_es
from sysid_ros.fleet.changes.fleet_changes import fleet_changes
from sysid_ros.fleet.fleet_page import fleet_page


def write_fleet_page(path: Path) -> None:
    """Beside the stores that it is of."""
    changes = fleet_changes(stored(small_fleet(), path.with_suffix(".store")))
    campaigns = campaigns_of(campaign_store(path.with_suffix(".campaigns"), shift=1.0, ordered=True))
    failed = [
        {"bag": "/plant/small_1/bag_7_with_a_long_name_that_has_no_blank_in_it_anywhere.mcap", "reason": "cut in the midst."}
    ]
    found = alarms(changes, beside=log_es(campaigns))
    path.write_text(fleet_page(changes, found, failed, 0.05, "/plant/store", campaigns), encoding="utf-8")
