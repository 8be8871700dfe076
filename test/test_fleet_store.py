"""The store of a fleet: what was written is read in one order, and a stop at any instant leaves whole results only."""

from __future__ import annotations

import multiprocessing
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pyarrow", reason="the extra fleet is not installed")

from sysid_ros import files
from sysid_ros.exceptions import OutputError, SettingsError
from sysid_ros.fleet.schema import COLUMNS, JOINT_PARAMETERS, ORDER, TABLES, UNITS, schema_of
from sysid_ros.fleet.store import Done, Results, Store

START = datetime(2026, 1, 5, 8, tzinfo=UTC)


def results(k: int) -> Results:
    """Of bag k, one every ten days; every seventh has failed."""
    date = START + timedelta(days=10 * k)
    key = {"hash": f"h{k}", "model": "m", "version": "1", "job": "track", "robot": f"r{k % 3}", "kind": "arm", "date": date}
    failed = k % 7 == 6
    row = {"bag": f"bag_{k:03}", **key, "status": "failed" if failed else "ok", "reason": "cut" if failed else "", "seconds": 0.1}
    if failed:
        return Results(row | {"date": None})
    joints = [{"bag": row["bag"], **key, "joint": f"j{i}", "noise": 0.1 * k, "noise_std": 0.01} for i in range(2)]
    return Results(row, joints, [{"bag": row["bag"], **key, "t_from": 0.0, "mass": 1.0 * k}], [])


def content(store: Store) -> dict[str, list[dict[str, Any]]]:
    return {table: store.read(table).to_pylist() for table in TABLES}


def filled(path: Path, order: list[int], at_once: int) -> Store:
    store = Store(path, create=True)
    with store.writing():
        for first in range(0, len(order), at_once):
            store.append([results(k) for k in order[first : first + at_once]])
    return store


def test_what_is_read_does_not_depend_on_who_wrote_what_when(tmp_path: Path) -> None:
    one, other = filled(tmp_path / "one", list(range(12)), 12), filled(tmp_path / "other", list(range(11, -1, -1)), 3)
    assert content(one) == content(other)
    assert len(content(one)["bags"]) == 12
    assert len(content(one)["joints"]) == 2 * 11
    assert one.read("joints", ["noise", "joint"]).column_names == ["noise", "joint"]
    assert one.read("bags", months=["2026-01"]).num_rows == 3


def test_joining_files_changes_nothing_that_is_read(tmp_path: Path) -> None:
    store = filled(tmp_path / "store", list(range(9)), 1)
    before = content(store)
    with store.writing():
        assert store.compact(few=1) > 0
    assert content(store) == before
    months = {len(list(folder.iterdir())) for table in TABLES for folder in (store.path / table).glob("month=*")}
    assert months == {1}


@pytest.mark.parametrize("after", [0, 1, 2, 4, 6, 8])
def test_a_stop_at_any_write_leaves_whole_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """As of a disk that is full from the write ``after`` on: of a writer, and of the joining of files."""
    store = filled(tmp_path / "store", [0, 1, 2, 3], 1)
    before, written, real = content(store), 0, files.whole

    def full(path: Path) -> Any:
        nonlocal written
        written += 1
        if written > after:
            raise OSError(28, "No space left on device", str(path))
        return real(path)

    monkeypatch.setattr("sysid_ros.fleet.store.whole", full)

    def work() -> None:
        store.compact(few=1)
        store.append([results(k) for k in (4, 5, 6)])
        store.append([results(7)])

    with store.writing(), pytest.raises(OutputError, match="No space left"):
        work()
    there = content(store)
    assert [row for row in there["bags"] if row["hash"] in {"h0", "h1", "h2", "h3"}] == before["bags"]
    ok = {row["hash"] for row in there["bags"] if row["status"] == "ok"}
    for table, a_bag in (("joints", 2), ("payloads", 1)):
        assert sorted(row["hash"] for row in there[table]) == sorted(list(ok) * a_bag)
    monkeypatch.setattr("sysid_ros.fleet.store.whole", real)
    with store.writing():
        done = {key.hash for key in store.done()}
        store.append([results(k) for k in range(8) if f"h{k}" not in done])
        store.compact(few=1)
    assert content(store) == content(filled(tmp_path / "other", list(range(8)), 8))


def test_a_stop_between_joining_and_removing_leaves_no_row_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = filled(tmp_path / "store", list(range(6)), 1)
    before = content(store)
    with monkeypatch.context() as patched:
        patched.setattr(Path, "unlink", lambda self, missing_ok=False: None)
        store.compact(few=1)
    assert content(store) == before
    store.clean()
    assert content(store) == before


def test_what_is_forgotten_is_done_again(tmp_path: Path) -> None:
    store = filled(tmp_path / "store", list(range(10)), 4)
    with store.writing():
        assert store.forget([Done("h3", "m", "1", "track"), Done("h6", "m", "1", "track")]) == 2
        assert {key.hash for key in store.done()} == {f"h{k}" for k in range(10) if k not in (3, 6)}
        store.append([results(6), results(3)])
    assert content(store) == content(filled(tmp_path / "other", list(range(10)), 10))
    assert Done("h6", "m", "1", "track") not in store.done(failed=False)


def hold(path: Path, ready: Any, leave: Any) -> None:
    with Store(path).writing():
        ready.set()
        leave.wait(20)


def test_two_processes_do_not_write_at_once(tmp_path: Path) -> None:
    store = Store(tmp_path / "store", create=True)
    spawned = multiprocessing.get_context("fork")
    ready, leave = spawned.Event(), spawned.Event()
    other = spawned.Process(target=hold, args=(store.path, ready, leave))
    other.start()
    assert ready.wait(20)
    with pytest.raises(OutputError, match="another process writes"), store.writing():
        pass
    leave.set()
    other.join()
    with store.writing():
        pass


def test_what_is_no_store_is_said(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="is no store"):
        Store(tmp_path)
    (tmp_path / "x").write_text("")
    with pytest.raises(OutputError, match="is no store"):
        Store(tmp_path, create=True)
    store = Store(tmp_path / "store", create=True)
    (store.path / "store.json").write_text('{"schema_version": 99}')
    with pytest.raises(SettingsError, match="version 99"):
        Store(store.path)


def test_columns_are_documented_and_in_order() -> None:
    assert set(UNITS) == set(JOINT_PARAMETERS)
    for table in TABLES:
        schema = schema_of(table)
        assert all(schema.field(name).metadata[b"about"] for name in schema.names)
        assert set(ORDER[table]) <= set(schema.names)
        assert len(set(schema.names)) == len(COLUMNS[table])
    with pytest.raises(SettingsError, match="no table 'robots'"):
        schema_of("robots")


def test_other_tools_read_the_folder(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    store = filled(tmp_path / "store", list(range(12)), 5)
    frame = pandas.read_parquet(store.path / "joints")
    assert len(frame) == store.read("joints").num_rows
    assert set(frame["month"].astype(str)) == {row["date"].strftime("%Y-%m") for row in store.read("joints").to_pylist()}
