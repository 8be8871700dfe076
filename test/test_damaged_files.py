"""Damaged files of every format: read, or refused with an error of the package; never anything else."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import bad_files as bad
import numpy as np
import pytest
from damaged import damaged

from sysid_ros.cli.main import run
from sysid_ros.exceptions import SysidError
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import BagSource, urdf_text
from sysid_ros.sources.columns import columns_of, read_columns
from sysid_ros.sources.table import read_table
from sysid_ros.torque.model_file import ModelFile

LONGEST = 700
"""Letters of a message, with the path of the file."""
ROBOT = RobotModel.from_urdf(bad.URDF)
MAPPING = (
    "time: time\nposition: [position_a, position_b]\nvelocity: [velocity_a, velocity_b]\neffort: [effort_a, effort_b]\n"
    "joints: [a, b]\ntime_unit: s\nposition_unit: rad\n"
)
CONFIG = (
    "online_payload_estimator:\n  ros__parameters:\n    joint_names: [a, b]\n    max_gap: 0.1\n    effort_scale: [1.0, 1.0]\n"
)


def _read_model(path: Path) -> None:
    ModelFile.read(path).known_effects(ROBOT)


def _read_robot(path: Path) -> None:
    model = RobotModel.from_urdf(urdf_text(path))
    model.rnea(*np.full((3, model.n), 0.1))


def _read_config(path: Path) -> None:
    from sysid_ros.cli.inputs import read_config

    given = {name: value for name, value in read_config(path).items() if name in ("joint_names", "max_gap", "effort_scale")}
    OnlineSettings.from_mapping(given, "configuration")


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "csv": ("log.csv", read_table),
    "npz": ("log.npz", read_table),
    "parquet": ("log.parquet", read_table),
    "mcap": ("log.mcap", lambda path: list(BagSource(path))),
    "db3": ("log.db3", lambda path: list(BagSource(path))),
    "metadata": ("bag/metadata.yaml", lambda path: list(BagSource(path.parent))),
    "urdf": ("two.urdf", _read_robot),
    "mjcf": ("two.xml", _read_robot),
    "model": ("model.yaml", _read_model),
    "columns": ("columns.yaml", lambda path: columns_of(bad.NAMES, read_columns(path), "log")),
    "config": ("config.yaml", _read_config),
}


def content_of(kind: str, folder: Path) -> bytes:
    """A small valid file."""
    if kind in ("mcap", "db3", "metadata"):
        storage, suffix = ("sqlite3", "db3") if kind == "db3" else ("mcap", "mcap")
        bad.bag(folder / "bag", bad.records(bad.table()[:300]), storage)
        return (folder / "bag" / ("metadata.yaml" if kind == "metadata" else f"bag.{suffix}")).read_bytes()
    if kind == "parquet":
        pytest.importorskip("pyarrow", reason="pyarrow is not installed (extra tables)")
        return bad.parquet()
    if kind == "mjcf":
        pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")
    if kind == "npz":
        return bad.good_npz()
    texts = {"csv": bad.csv(bad.table()[:100]), "urdf": bad.URDF, "mjcf": bad.MJCF, "columns": MAPPING, "config": CONFIG}
    return (bad.model_text() if kind == "model" else texts[kind]).encode()


@pytest.mark.parametrize("count", [25, pytest.param(400, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", READERS)
def test_a_damaged_file_is_read_or_refused(kind: str, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    name, read = READERS[kind]
    path, content = tmp_path / name, content_of(kind, tmp_path)
    path.write_bytes(content)
    read(path)
    ends: Counter[str] = Counter()
    longest = ""
    for data in damaged(content, count, seed=count):
        path.write_bytes(data)
        try:
            read(path)
            ends["read"] += 1
        except SysidError as error:
            ends["refused"] += 1
            longest = max(longest, str(error), key=len)
    assert ends.total() == count
    assert len(longest) < LONGEST, longest
    # of a bag whose metadata.yaml is damaged the files are read
    assert ends["refused"] > 0 or kind == "metadata"


COMMANDS = {
    "replay": ["replay", "{log}", "--urdf", "{urdf}", "--json", "o.json"],
    "identify": ["identify", "{log}", "--urdf", "{urdf}", "--out", "m.yaml"],
    "diagnose": ["diagnose", "{log}", "--urdf", "{urdf}", "--out", "d"],
    "frequency": ["frequency", "{log}", "--urdf", "{urdf}", "--plot", "f.png"],
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_on_a_damaged_file_ends_well(command: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sysid_ros.cli.replay.warm_up", lambda robot, settings: 0)
    given = {"log": "good.csv", "urdf": "good.urdf"}
    Path("good.csv").write_text(bad.csv(bad.table()))
    Path("good.urdf").write_text(bad.URDF)
    name = READERS[kind][0]
    content, path = content_of(kind, tmp_path), tmp_path / name
    more: list[str] = []
    if kind in ("urdf", "mjcf"):
        given["urdf"] = name
    elif kind in ("model", "columns", "config"):
        more = [f"--{kind}", name]
    else:
        given["log"] = "bag" if kind == "metadata" else name
    if kind == "model" and command == "identify":
        pytest.skip("identify takes no model")
    arguments = [word.format(**given) for word in COMMANDS[command]]
    for data in damaged(content, 6 if command == "diagnose" else 12, seed=1):
        path.write_bytes(data)
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as said:
            code = run([*arguments, *more, "--force"])
        assert code in (0, 2), said.getvalue()
