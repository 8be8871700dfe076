"""Tables instead of bags: the same numbers from each of them, columns that are guessed, and what can't be read."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_ros.cli.main import run
from sysid_ros.exceptions import DataError
from sysid_ros.sources import BagSource, TableSource, open_source
from sysid_ros.sources.columns import columns_of, read_columns
from sysid_ros.sources.table import of_frame, read_table, write_table

BAG = Path(__file__).parents[1] / "bags" / "arm_pick_and_drop"


def of_bag(path: Path) -> TableSource:
    records = list(BagSource(path))
    t, q, tau, v = (np.array([getattr(r, what) for r in records]) for what in ("stamp", "position", "effort", "velocity"))
    return TableSource("bag", t, q, tau, v if v.size else None, records[0].names)


@pytest.fixture(scope="module")
def table() -> TableSource:
    return of_bag(BAG)


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("urdf") / "arm.urdf"
    path.write_text(BagSource(BAG).robot_description or "")
    return path


def replayed(tmp_path: Path, *arguments: str | Path) -> dict[str, Any]:
    out = tmp_path / "out.json"
    assert run(["replay", *map(str, arguments), "--json", str(out), "--force"]) == 0
    document: dict[str, Any] = json.loads(out.read_text())
    return {key: document[key] for key in ("payload", "payloads", "events", "status")}


def test_a_bag_and_each_form_of_table_give_the_same_to_the_last_digit(tmp_path: Path, table: TableSource, urdf: Path) -> None:
    truth = replayed(tmp_path, BAG)
    for suffix in (".csv", ".npz", ".parquet"):
        path = tmp_path / f"log{suffix}"
        write_table(path, table)
        assert replayed(tmp_path, path, "--urdf", urdf) == truth, suffix


def test_columns_in_an_npz(tmp_path: Path, table: TableSource, urdf: Path) -> None:
    """An array a column, an array a quantity, and whatever names a mapping gives: the same numbers."""
    arrays = {"position": table.q, "effort": table.tau}
    single: dict[str, Any] = {f"{j}_{what}": x[:, k] for what, x in arrays.items() for k, j in enumerate(table.joint_names)}
    np.savez(tmp_path / "single.npz", time=table.t, **single)
    np.savez(tmp_path / "joint.npz", time=table.t, joint_position=table.q, joint_effort=table.tau, rates=np.arange(3.0))
    np.savez(tmp_path / "own.npz", clock=1e3 * table.t, a=table.q, b=table.tau)
    mapping, n = tmp_path / "columns.yaml", table.q.shape[1]
    mapping.write_text(
        f"time: clock\ntime_unit: ms\nposition: {[f'a_{k}' for k in range(n)]}\neffort: {[f'b_{k}' for k in range(n)]}\n"
    )
    for name, columns in (("single", None), ("joint", None), ("own", mapping)):
        found = read_table(tmp_path / f"{name}.npz", read_columns(columns) if columns else None)
        np.testing.assert_array_equal(found.q, table.q)
        np.testing.assert_array_equal(found.tau, table.tau)
        np.testing.assert_allclose(found.t, table.t, atol=1e-6)
        assert found.joint_names == (table.joint_names if name == "single" else ())


def test_a_joint_that_is_called_a_joint_keeps_its_name() -> None:
    found = columns_of(["time", "elbow_joint_position", "elbow_joint_velocity", "elbow_joint_effort"], None, "log.csv")
    assert found.joints == ("elbow_joint",)
    assert columns_of(["time", "joint_position_0", "joint_effort_0"], None, "log.csv").joints == ()


@pytest.mark.slow
def test_identify_reads_tables(tmp_path: Path, urdf: Path) -> None:
    path, models = tmp_path / "empty.npz", [tmp_path / "bag.yaml", tmp_path / "table.yaml"]
    write_table(path, of_bag(BAG.parent / "arm_empty"))
    assert run(["identify", str(BAG.parent / "arm_empty"), "--out", str(models[0])]) == 0
    assert run(["identify", str(path), "--urdf", str(urdf), "--out", str(models[1])]) == 0
    one, other = (model.read_text().split("provenance")[0] for model in models)
    assert one == other


def test_joints_without_names_are_those_of_the_urdf(
    tmp_path: Path, table: TableSource, urdf: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "log.csv"
    write_table(path, TableSource("x", table.t, table.q, table.tau))
    replayed(tmp_path, path, "--urdf", urdf)
    said = capsys.readouterr().err
    assert "Columns taken for: time 'time' [s]; position 'position_1' to 'position_7'; velocity none" in said
    assert "in its order: lbr_iiwa_joint_1, lbr_iiwa_joint_2" in said


def test_a_mapping_says_which_is_which(tmp_path: Path, table: TableSource, urdf: Path) -> None:
    path, mapping, n = tmp_path / "log.csv", tmp_path / "columns.yaml", table.q.shape[1]
    names = ["clock", *(f"a{k}" for k in range(n)), *(f"b{k}" for k in range(n))]
    values = np.column_stack([1e3 * (table.t - table.t[0]), np.rad2deg(table.q), table.tau])
    path.write_text(";".join(names) + "\n" + "\n".join(";".join(map(repr, row)) for row in values.tolist()))
    mapping.write_text(
        f"time: clock\ntime_unit: ms\nposition_unit: deg\nposition: {names[1 : n + 1]}\neffort: {names[n + 1 :]}\n"
        f"joints: {list(table.joint_names)}\n"
    )
    found = replayed(tmp_path, path, "--urdf", urdf, "--columns", mapping)
    assert found["payloads"][0]["mass"] == pytest.approx(1.8, abs=0.02)


@pytest.mark.parametrize(
    ("names", "joints", "effort"),
    [
        (["t", "q1", "q2", "tau1", "tau2"], (), ("tau1", "tau2")),
        (["time", "q_0", "q_1", "qd_0", "qd_1", "tau_0", "tau_1"], (), ("tau_0", "tau_1")),
        (["timestamp", "shoulder_position", "elbow_position", "shoulder_torque", "elbow_torque"], ("shoulder", "elbow"), None),
        (["__time", "/joint_states/A1/position", "/joint_states/A1/effort"], ("A1",), ("/joint_states/A1/effort",)),
        (["timestamp", "actual_q_0", "actual_qd_0", "actual_current_0"], (), ("actual_current_0",)),
        (["Time [ms]", "pos[0]", "pos[1]", "effort[0]", "effort[1]"], (), ("effort[0]", "effort[1]")),
    ],
)
def test_columns_are_guessed(names: Sequence[str], joints: tuple[str, ...], effort: tuple[str, ...] | None) -> None:
    columns = columns_of(names, None, "log")
    assert columns.joints == joints
    assert effort is None or columns.effort == effort
    assert columns.time == names[0]
    assert columns.time_unit == ("ms" if "[ms]" in names[0] else "s")
    assert bool(columns.notes) == ("actual_current_0" in names)


def test_data_frames_are_tables(table: TableSource) -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({f"q{k}": table.q[:, k] for k in range(7)} | {f"tau{k}": table.tau[:, k] for k in range(7)})
    by_column = of_frame(frame.assign(t=table.t), "frame")
    by_index = of_frame(frame.set_index(table.t), "frame")
    for found in (by_column, by_index):
        np.testing.assert_array_equal(found.t, table.t)
        np.testing.assert_array_equal(found.tau, table.tau)


def test_times_from_zero_are_shifted_and_that_is_said() -> None:
    source = TableSource("log", np.arange(3.0), np.zeros((3, 2)), np.zeros((3, 2)), joint_names=("a", "b"))
    assert source.t.tolist() == [1.0, 2.0, 3.0]
    assert "1 s is added" in " ".join(source.notes)
    assert [r.stamp for r in source] == [1.0, 2.0, 3.0]


BAD = {
    "no file": (None, "does not exist"),
    "empty": ("", "name"),
    "no rows": ("t,q1,tau1\n", "no rows below"),
    "ragged": ("t,q1,tau1\n1,2,3\n1,2\n", "2 values in line 3"),
    "no time": ("a,q1,tau1\n1,2,3\n", "time"),
    "no effort": ("t,q1,q2\n1,2,3\n", "effort"),
    "binary": (b"\xff\xfe\x00\x01", "not text in UTF-8"),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_tables_are_a_sentence_and_exit_code_2(
    kind: str, tmp_path: Path, urdf: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content, word = BAD[kind]
    path = tmp_path / "log.csv"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert run(["replay", str(path), "--urdf", str(urdf)]) == 2
    assert word in capsys.readouterr().err


def test_bad_npz_and_mappings(tmp_path: Path, urdf: Path) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, t=np.arange(3.0), q=np.zeros((3, 2)))
    with pytest.raises(DataError, match="must hold"):
        read_table(path)
    np.savez(path, t=np.arange(3.0), q=np.zeros((3, 2)), tau=np.zeros((3, 3)))
    with pytest.raises(DataError, match="must be"):
        open_source(path)
    path.write_bytes(b"PK")
    with pytest.raises(DataError, match="can't be read"):
        open_source(path)
    for given, word in (
        ({"time": "t", "position": ["q"], "effort": ["x"]}, "no column 'x'"),
        ({"time": "t", "position": ["q"], "effort": []}, "one of each"),
        ({"time": "t", "position": ["q"], "effort": ["tau"], "time_unit": "h"}, "unit 'h'"),
        ({"zeit": "t"}, "may have"),
    ):
        with pytest.raises(DataError, match=word):
            columns_of(["t", "q", "tau"], given, "log")


def test_a_urdf_of_another_number_of_joints_is_said() -> None:
    source = TableSource("log", np.arange(1.0, 4.0), np.zeros((3, 2)), np.zeros((3, 2)))
    with pytest.raises(DataError, match="2 joints without names, the URDF has 3"):
        source.named(["a", "b", "c"])
