"""Dates told in robots.yaml: by the path, by a table, as campaigns; what is wrong with them; what differs between campaigns."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fleet_bags import Hidden, write_bag

pytest.importorskip("pyarrow", reason="the extra fleet is not installed")
pytest.importorskip("distributed", reason="the extra fleet is not installed")

from click.testing import CliRunner
from pyarrow import parquet
from test_fleet_store import results

from sysid_ros.cli.batch import command as batch
from sysid_ros.exceptions import SettingsError
from sysid_ros.fleet.batch import Batch, Counts
from sysid_ros.fleet.changes.alarms import limit_of
from sysid_ros.fleet.changes.campaigns import campaigns_of, compare, log_es
from sysid_ros.fleet.changes.evidence import SIZES
from sysid_ros.fleet.changes.pooled import SCATTER_PRIOR
from sysid_ros.fleet.dates import Told
from sysid_ros.fleet.rules import Rules
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.fleet.store import Results, Store

UR10E = Path(__file__).resolve().parents[2] / "shared" / "data" / "ur10e"
BY_PATH = r"_(?P<year>\d{4})-?(?P<month>\d\d)-?(?P<day>\d\d)(T(?P<hour>\d\d)(?P<minute>\d\d))?"


def rules(folder: Path = Path(), **more: Any) -> Rules:
    return Rules({"robots": [{"robot": "arm", "paths": "fleet/*_*", **more}]}, folder)


def told(bag: str, folder: Path = Path(), **more: Any) -> Told:
    (one,) = rules(folder, **more).told(bag)
    return one


def test_a_date_stands_in_the_path() -> None:
    assert told("/x/fleet/run_2025-03-14", date=BY_PATH).date == datetime(2025, 3, 14, tzinfo=UTC)
    assert told("s3://x/fleet/run_20250314T0930", date=BY_PATH).date == datetime(2025, 3, 14, 9, 30, tzinfo=UTC)
    assert told("/x/fleet/run_1") == Told()


def test_dates_stand_in_a_table(tmp_path: Path) -> None:
    (tmp_path / "dates.csv").write_text("bag,date\nrun_1,2025-03-14\nfleet/run_2,2025-03-15T10:00+02:00\n\n")
    assert told("/x/fleet/run_1", tmp_path, dates="dates.csv").date == datetime(2025, 3, 14, tzinfo=UTC)
    assert told("/x/fleet/run_2", tmp_path, dates="dates.csv").date == datetime(2025, 3, 15, 8, tzinfo=UTC)
    with pytest.raises(SettingsError, match=r"dates.csv' has no line for bag '/x/fleet/run_11'"):
        told("/x/fleet/run_11", tmp_path, dates="dates.csv")


def test_campaigns_have_an_order_where_it_is_known() -> None:
    assert told("/x/fleet/old_1", campaign="{1}") == Told(None, "old", None)
    assert told("/x/fleet/new_1", campaign="{1}", campaigns=["old", "new"]) == Told(None, "new", 1)
    own = datetime(2020, 1, 1, tzinfo=UTC)
    assert Told().columns(own)["date"] == own
    assert Told(None, "old").columns(own)["date"] is None  # it was said not to count


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"date": "("}, r"which is no regular expression"),
        ({"date": r"(?P<year>\d+)"}, r"without a group named month, day"),
        ({"date": BY_PATH + "(?P<week>x)"}, r"has groups week"),
        ({"date": r"(?P<year>x*)(?P<month>x*)(?P<day>x*)y"}, r"does not fit the path of bag '/x/fleet/run_1'"),
        ({"date": r"(?P<year>_)(?P<month>1)(?P<day>)"}, r"which is no date"),
        ({"date": BY_PATH, "campaign": "a"}, r"rule 1 has campaign and date, which tell the same in two ways"),
        ({"dates": "nothing.csv"}, r"nothing.csv', which can't be read"),
        ({"dates": "wrong.csv"}, r"line 3 of '.*wrong.csv' is 'run_2,tomorrow'"),
        ({"dates": "twice.csv"}, r"line 3 of '.*twice.csv' gives bag run_1 a second date"),
        ({"dates": "headless.csv"}, r"the first line of '.*headless.csv' must be 'bag,date'"),
        ({"campaigns": ["a", "b"]}, r"there is no 'campaign'"),
        ({"campaign": "a", "campaigns": ["a", "a"]}, r"in the order of time, each once"),
        ({"campaign": "{1}", "campaigns": ["a"]}, r"is of campaign 'run', which is none of 'campaigns': a"),
    ],
)
def test_what_is_wrong_with_dates_is_said(tmp_path: Path, more: dict[str, Any], said: str) -> None:
    (tmp_path / "wrong.csv").write_text("bag,date\nrun_1,2025-03-14\nrun_2,tomorrow\n")
    (tmp_path / "twice.csv").write_text("bag,date\nrun_1,2025-03-14\nrun_1,2025-03-15\n")
    (tmp_path / "headless.csv").write_text("run_1,2025-03-14\n")
    with pytest.raises(SettingsError, match=said):
        told("/x/fleet/run_1", tmp_path, **more)


def test_a_bag_without_a_date_is_said_before_the_work(tmp_path: Path) -> None:
    write_bag(tmp_path / "fleet" / "run_1", Hidden(), seed=1)
    (tmp_path / "robots.yaml").write_text(json.dumps({"robots": [{"robot": "arm", "date": BY_PATH}]}))
    given = [str(tmp_path / "fleet"), "--robots", str(tmp_path / "robots.yaml"), "--out", str(tmp_path / "store")]
    with pytest.raises(SettingsError, match="does not fit the path"):
        CliRunner().invoke(batch, given, catch_exceptions=False)
    assert not (tmp_path / "store").exists()


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """Dask in threads of this process."""
    import distributed

    with distributed.Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as it:
        yield it


def test_a_date_that_is_told_anew_takes_the_place_of_the_old_one(tmp_path: Path, client: Any) -> None:
    for k in (1, 2):
        write_bag(tmp_path / "fleet" / f"run_{k}", Hidden(), seed=k)
    (tmp_path / "dates.csv").write_text("bag,date\nrun_1,2025-03-14\nrun_2,2025-04-15\n")
    (tmp_path / "later.csv").write_text("bag,date\nrun_1,2025-03-14\nrun_2,2025-05-16\n")
    store = Store(tmp_path / "store", create=True)

    def done(**more: Any) -> tuple[Counts, list[Any]]:
        with store.writing():
            counts = Batch(store, rules(tmp_path, **more), ["track"], client).run([str(tmp_path / "fleet")])
        return counts, [date and f"{date:%m-%d}" for date in store.read("bags").column("date").to_pylist()]

    first, dates = done()
    assert (first.done, dates) == (2, ["01-05"] * 2)
    counts, dates = done(dates="dates.csv")
    assert (counts.done, dates) == (2, ["03-14", "04-15"])
    assert done(dates="dates.csv")[0].skipped == 2
    counts, dates = done(dates="later.csv")
    assert (counts.done, counts.skipped, dates) == (1, 1, ["03-14", "05-16"])
    counts, dates = done(campaign="{1}")
    assert (counts.done, dates) == (2, [None, None])
    assert set(store.read("joints").column("date").to_pylist()) == {None}


def test_a_store_of_before_lacks_the_columns_and_is_read(tmp_path: Path) -> None:
    store = Store(tmp_path / "store", create=True)
    with store.writing():
        store.append([results(0)])
    (file,) = (tmp_path / "store" / "bags").glob("*/*.parquet")
    old = parquet.ParquetFile(file).read().drop_columns(["campaign", "campaign_order", "date_told"])
    parquet.write_table(old, file)
    (row,) = store.read("bags").to_pylist()
    assert (row["hash"], row["campaign"], row["date_told"]) == (results(0).bag["hash"], None, None)


GROUP = np.array([0, 0, 0, 1, 1, 1])


def drawn_evidence(rng: np.random.Generator, differ: bool) -> float:
    """The e-value of bags drawn from the model, with a scatter from its prior and, where campaigns differ, a size too."""
    scatter = np.exp(rng.normal(*SCATTER_PRIOR))
    each = rng.normal(size=2) * rng.choice(SIZES) * differ
    found = compare((rng.normal(size=6) + each[GROUP]) * np.sqrt(1.0 + scatter), np.ones(6), GROUP, 2, False)
    assert found is not None
    return float(np.exp(min(found[0], 700.0)))


def test_evidence_of_campaigns_is_a_ratio_of_likelihoods() -> None:
    rng = np.random.default_rng(2)
    # of a ratio of two densities the inverse has mean one under the first, and by Markov few are large under the second
    assert np.mean([1.0 / drawn_evidence(rng, True) for _ in range(200)]) == pytest.approx(1.0, abs=0.35)
    assert np.mean([drawn_evidence(rng, False) > 20.0 for _ in range(200)]) <= 1.0 / 20.0


def test_intervals_hold_the_truth_with_any_scatter() -> None:
    rng = np.random.default_rng(3)
    held, true = [], 2.0
    for _ in range(200):
        scatter = np.exp(rng.normal(0.0, 2.0))
        found = compare(rng.normal(size=6) * np.sqrt(1.0 + scatter) + true * GROUP, np.ones(6), GROUP, 2, False)
        assert found is not None
        _, low, high = found[2][1] or (0.0, 0.0, 0.0)
        held.append(low < true < high)
    assert np.mean(held) == pytest.approx(0.95, abs=0.046)  # three standard deviations of the mean


def test_order_and_units_do_not_matter() -> None:
    y, variance = np.array([1.0, 1.2, 0.9, 3.0, 3.3, 3.1]), np.full(6, 0.04)
    found, other = compare(y, variance, GROUP, 2, True), compare(1e3 * y[::-1], 1e6 * variance, GROUP[::-1], 2, True)
    assert found is not None
    assert other is not None
    assert found[0] == pytest.approx(other[0])
    assert found[0] > 2.0
    one, scaled = found[2][1], other[2][1]
    assert one is not None
    assert scaled == pytest.approx([1e3 * x for x in one])
    assert compare(y, variance, np.zeros(6, dtype=int), 2, True) is None


def campaign_store(path: Path, shift: float, ordered: bool) -> Store:
    store, rng = Store(path, create=True), np.random.default_rng(5)
    made = []
    for k, campaign in enumerate(["spring"] * 6 + ["autumn"] * 6):
        one = Results({**results(0).bag, "bag": f"bag {k}", "hash": f"h{k}", "robot": "arm"})
        order = ["spring", "autumn"].index(campaign) if ordered else None
        one.bag |= {"campaign": campaign, "campaign_order": order, "date": None}
        row = {name: float(rng.normal(1.0, 0.1)) for name in JOINT_PARAMETERS} | {f"{name}_std": 0.1 for name in JOINT_PARAMETERS}
        row["coulomb_friction"] += shift * (campaign == "autumn")
        own = {name: one.bag[name] for name in ("bag", "hash", "model", "version", "job", "robot", "kind")}
        made.append(Results(one.bag, [{**own, "joint": "elbow", **row}]))
    with store.writing():
        store.append(made)
    return store


def test_a_report_says_what_differs_between_campaigns(tmp_path: Path) -> None:
    store = campaign_store(tmp_path / "store", shift=1.0, ordered=True)
    robots = campaigns_of(store)
    assert robots[0].campaigns == ("spring", "autumn")
    limit = limit_of(log_es(robots), 0.05)
    (one,) = [c for c in robots[0].compared if c.log_e >= limit]
    assert (one.joint, one.quantity) == ("elbow", "coulomb_friction")
    middle, low, high = one.differences[1] or (0.0, 0.0, 0.0)
    assert low < 1.0 < high
    assert high - low < 0.4
    outputs = [str(tmp_path / "store"), "--out", str(tmp_path / "r.html"), "--json", str(tmp_path / "r.json")]
    assert CliRunner().invoke(batch, ["report", *outputs], catch_exceptions=False).exit_code == 0
    page, said = (tmp_path / "r.html").read_text(), json.loads((tmp_path / "r.json").read_text())
    assert "1 of 1 robot known by campaigns differ" in page
    assert "their order is, as robots.yaml tells it" in page
    told = [c for c in said["campaigns"][0]["compared"] if c["told"]]
    assert [c["differences"][1]["value"] for c in told] == [pytest.approx(middle)]


def test_campaigns_that_are_alike_are_not_told(tmp_path: Path) -> None:
    robots = campaigns_of(campaign_store(tmp_path / "store", shift=0.0, ordered=False))
    assert robots[0].campaigns == ("autumn", "spring")
    assert not robots[0].in_order
    assert limit_of(log_es(robots), 0.05) == np.inf


@pytest.mark.slow
@pytest.mark.skipif(not UR10E.is_dir(), reason=f"measured bags of a UR10e are not in {UR10E}")
def test_a_measured_robot_whose_bags_were_converted_on_one_day(tmp_path: Path) -> None:
    """Neither dates nor an order of its runs are known: what differs between them is told with intervals, and that it is so."""
    rule = {"robot": "ur10e", "paths": "ur10e/*_*", "urdf": str(UR10E / "ur10e.urdf"), "campaign": "{1}"}
    (tmp_path / "robots.yaml").write_text(json.dumps({"robots": [rule]}))
    given = ["--robots", str(tmp_path / "robots.yaml"), "--out", str(tmp_path / "store"), "--workers", "1"]
    assert CliRunner().invoke(batch, [str(UR10E), *given], catch_exceptions=False).exit_code == 0
    outputs = [str(tmp_path / "store"), "--out", str(tmp_path / "r.html"), "--json", str(tmp_path / "r.json")]
    assert CliRunner().invoke(batch, ["report", *outputs], catch_exceptions=False).exit_code == 0
    assert "Neither their dates nor their order are known" in (tmp_path / "r.html").read_text()
    (robot,) = json.loads((tmp_path / "r.json").read_text())["campaigns"]
    assert {c["name"]: len(c["bags"]) for c in robot["campaigns"]} == {"fast20": 2, "fourier14": 2, "friction": 1, "ptp": 1}
    assert not robot["order_known"]
    assert {c["joint"] for c in robot["compared"]} == {
        "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"
    }  # fmt: skip
    for row in robot["compared"]:
        told = [d for d in row["differences"] if d]
        assert told
        assert all(d["low"] < d["value"] < d["high"] for d in told)
    # what was bolted on within a campaign, as the people who made the logs state it
    rows = Store(tmp_path / "store").read("payloads", ["bag", "mass", "mass_std"]).to_pylist()
    mass = {Path(row["bag"]).name: (row["mass"], row["mass_std"]) for row in rows}
    for name, true in (("fourier14", 2.805), ("fast20", 1.069)):
        (with_it, its), (without, other) = mass[f"{name}_load"], mass[f"{name}_noload"]
        assert abs(with_it - without - true) < 2.0 * np.hypot(its, other)
