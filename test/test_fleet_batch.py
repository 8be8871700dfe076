"""sysid batch on small fleets: every bag is a row, nothing is done twice, order, place and number of workers change nothing."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fleet_bags import Hidden, write_bag, write_fleet

pytest.importorskip("pyarrow", reason="the extra fleet is not installed")
pytest.importorskip("distributed", reason="the extra fleet is not installed")

from sysid_ros.cli.main import run as sysid
from sysid_ros.exceptions import ClusterError, OutputError, SettingsError
from sysid_ros.fleet import batch as batch_module
from sysid_ros.fleet.bags import at_hand, content_hash, find, stamp_of
from sysid_ros.fleet.batch import Batch, Counts, failed_before
from sysid_ros.fleet.cluster import connected
from sysid_ros.fleet.in_flight import KILLED, InFlight
from sysid_ros.fleet.rules import Rules
from sysid_ros.fleet.schema import TABLES
from sysid_ros.fleet.store import Store

RULES = Rules({"robots": [{"paths": "arm_*/**", "robot": "arm {1}", "kind": "small"}]}, Path())
VARIES = {"seconds"}
"""Columns of which two runs may differ."""


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """Dask in threads of this process."""
    import distributed

    with distributed.Client(processes=False, n_workers=1, threads_per_worker=2, dashboard_address=None) as it:
        yield it


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two robots of three bags; the fifth bag is broken."""
    folder = tmp_path_factory.mktemp("fleet")
    write_fleet(folder, robots=2, bags=3, broken=(4,))
    return folder


def done(store: Path, bags: Path | str, client: Any, jobs: tuple[str, ...] = ("track",)) -> Counts:
    where = Store(store, create=True)
    with where.writing():
        return Batch(where, RULES, jobs, client).run([str(bags)])


def content(path: Path) -> dict[str, list[dict[str, Any]]]:
    """All values; NaN as text, for it equals nothing."""
    rows = {table: Store(path).read(table).to_pylist() for table in TABLES}
    return {table: [{k: repr(v) for k, v in row.items() if k not in VARIES} for row in rows[table]] for table in TABLES}


def test_every_bag_is_a_row_and_a_second_run_does_nothing(tmp_path: Path, fleet: Path, client: Any) -> None:
    first = done(tmp_path / "store", fleet, client)
    assert (first.found, first.done, first.failed, first.skipped) == (6, 5, 1, 0)
    (reason,) = first.reasons.values()
    assert "can't be read as a bag" in reason
    rows = content(tmp_path / "store")
    assert {(row["robot"], row["status"]) for row in rows["bags"]} == {
        ("'arm 0'", "'ok'"), ("'arm 1'", "'ok'"), ("'arm 1'", "'failed'")
    }  # fmt: skip
    assert len(rows["joints"]) == 5 * 4
    again = done(tmp_path / "store", fleet, client)
    assert (again.found, again.done, again.failed, again.skipped) == (6, 0, 0, 6)
    assert content(tmp_path / "store") == rows
    store = Store(tmp_path / "store")
    with store.writing():
        assert store.forget(failed_before(store)) == 1
    assert done(tmp_path / "store", fleet, client).failed == 1


def test_a_bag_that_was_moved_is_known_and_one_that_is_new_is_done(tmp_path: Path, fleet: Path, client: Any) -> None:
    shutil.copytree(fleet, tmp_path / "fleet")
    done(tmp_path / "store", tmp_path / "fleet", client)
    (tmp_path / "fleet").rename(tmp_path / "elsewhere")
    write_bag(tmp_path / "elsewhere" / "arm_0" / "bag_9", Hidden(), seed=99)
    after = done(tmp_path / "store", tmp_path / "elsewhere", client)
    assert (after.skipped, after.done) == (6, 1)


def test_the_same_bag_twice_is_one_row(tmp_path: Path, fleet: Path, client: Any) -> None:
    shutil.copytree(fleet / "arm_0", tmp_path / "fleet" / "arm_0")
    shutil.copytree(fleet / "arm_0" / "bag_1", tmp_path / "fleet" / "arm_1" / "bag_1")
    done(tmp_path / "store", tmp_path / "fleet", client)
    assert len(content(tmp_path / "store")["bags"]) == 3


def test_what_is_written_before_a_stop_is_not_done_again(
    tmp_path: Path, fleet: Path, client: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    done(tmp_path / "whole", fleet, client)
    real, written = Store.append, 0

    def stops(self: Store, results: Any) -> None:
        nonlocal written
        if written == 2:
            raise OutputError("the disk is full")
        real(self, results)
        written += 1

    monkeypatch.setattr(batch_module, "_MANY", 1)
    with monkeypatch.context() as patched:
        patched.setattr(Store, "append", stops)
        with pytest.raises(OutputError, match="full"):
            done(tmp_path / "store", fleet, client)
    rest = done(tmp_path / "store", fleet, client)
    assert rest.skipped == 2
    assert content(tmp_path / "store") == content(tmp_path / "whole")


def test_calls_that_are_one_task_are_known_apart(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def through() -> dict[int, Any]:
        flight, found = InFlight(client), dict[int, Any]()
        flight.submit(divmod, [(k, (k, 3)) for k in range(7)], 3)
        assert len(flight) == 7
        while flight:
            found |= dict(flight.next())
        return found

    assert through() == {k: divmod(k, 3) for k in range(7)}
    monkeypatch.setattr(InFlight, "_found", lambda self, futures: [(future, KILLED) for future in futures])
    assert through() == dict.fromkeys(range(7), KILLED)


def test_bags_of_a_batch_share_tasks_but_for_the_last(tmp_path: Path, client: Any) -> None:
    write_fleet(tmp_path / "bags", robots=2, bags=12)
    sizes: list[int] = []
    submit = client.map

    def counted(function: Any, functions: list[Any], arguments: list[list[Any]], **options: Any) -> Any:
        sizes.extend(map(len, arguments))
        return submit(function, functions, arguments, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(client, "map", counted)
        patch.setattr(batch_module, "_TOGETHER", 3)
        counts = done(tmp_path / "store", tmp_path / "bags", client)
    assert counts.done == sum(sizes) == 24
    assert max(sizes) == 3  # each of them takes much less than a second
    assert sizes[-1] == 1


def test_ctrl_c_keeps_what_is_known(tmp_path: Path, fleet: Path, client: Any) -> None:
    through = 0

    def interrupt(bags: int) -> None:
        nonlocal through
        through += bags
        if through == 3:
            raise KeyboardInterrupt

    store = Store(tmp_path / "store", create=True)
    with store.writing(), pytest.raises(KeyboardInterrupt):
        Batch(store, RULES, ["track"], client, interrupt).run([str(fleet)])
    assert len(content(tmp_path / "store")["bags"]) == 3
    assert done(tmp_path / "store", fleet, client).skipped == 3


def test_bags_at_a_url_are_fetched_for_as_long_as_they_are_read(tmp_path: Path, fleet: Path, client: Any) -> None:
    fsspec = pytest.importorskip("fsspec")
    memory = fsspec.filesystem("memory")
    memory.put(str(fleet), "/plant", recursive=True)
    try:
        bags = list(find(["memory://plant"]))
        assert len(bags) == 6
        assert all(stamp_of(bag) for bag in bags)
        with at_hand(bags[0]) as path:
            assert content_hash(path) == content_hash(fleet / "arm_0" / "bag_0")
        assert not path.exists()
        assert done(tmp_path / "store", "memory://plant", client).done == 5
        assert done(tmp_path / "store", fleet, client).skipped == 6  # the same content
        with pytest.raises(SettingsError, match="matches no bag"):
            list(find(["memory://elsewhere"]))
    finally:
        memory.rm("/plant", recursive=True)


def test_bags_are_found_by_folder_and_glob(fleet: Path) -> None:
    of_folder = list(find([str(fleet)]))
    assert of_folder == sorted(of_folder)
    assert len(of_folder) == 6
    assert list(find([f"{fleet}/arm_*/*"])) == of_folder
    assert list(find([f"{fleet}/**"])) == of_folder
    assert len(list(find([f"{fleet}/arm_0/**/*.mcap"]))) == 3
    assert list(find([str(fleet / "arm_0" / "bag_1")])) == [str(fleet / "arm_0" / "bag_1")]
    with pytest.raises(SettingsError, match="matches no bag"):
        list(find([f"{fleet}/nothing*"]))


def test_the_jobs_of_the_library_write_their_rows(tmp_path: Path, fleet: Path, client: Any) -> None:
    counts = done(tmp_path / "store", fleet / "arm_0" / "bag_0", client, ("track", "replay"))
    assert counts.done == 2
    bags = Store(tmp_path / "store").read("bags").to_pylist()
    assert [row["job"] for row in bags] == ["replay", "track"]
    assert bags[0]["document"].startswith("{")
    assert bags[1]["document"] is None


def test_a_scheduler_that_does_not_answer_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sysid_ros.fleet.cluster._PATIENCE", 0.2)
    with (
        pytest.raises(ClusterError, match=r"no Dask scheduler answers at 'tcp://127\.0\.0\.1:9'"),
        connected("tcp://127.0.0.1:9"),
    ):
        pass


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--jobs", "track,wash"], "--jobs is 'track,wash'; it must be one or more of track, replay"),
        (["--scheduler", "tcp://x:1", "--workers", "2"], "--workers is given beside --scheduler"),
        (["--robots", "nothing.yaml"], "--robots: 'nothing.yaml' can't be read"),
    ],
)
def test_what_is_wrong_is_said(
    tmp_path: Path, fleet: Path, capsys: pytest.CaptureFixture[str], more: list[str], said: str
) -> None:
    robots = tmp_path / "robots.yaml"
    robots.write_text("robots: [{robot: arm}]")
    assert sysid(["batch", str(fleet), "--robots", str(robots), "--out", str(tmp_path / "store"), *more]) == 2
    assert said in capsys.readouterr().err
