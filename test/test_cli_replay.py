"""``sysid replay`` on the bags of the repository: exit codes, JSON, CSV, and every way a bag comes."""

from __future__ import annotations

import csv
import json
import math
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from robots import urdf

from sysid_ros.cli.main import run
from sysid_ros.input_gate import InputGate
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import STATUSES
from sysid_ros.online.replay import as_json, replay
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import BagSource

BAGS = Path(__file__).parents[1] / "bags"
PICK = BAGS / "arm_pick_and_drop"
EMPTY = BAGS / "arm_empty"
TRUTH = json.loads((BAGS / "arm_pick_and_drop.truth.json").read_text())


def replay_json(tmp_path: Path, *arguments: str | Path) -> dict[str, Any]:
    path = tmp_path / "out.json"
    assert run(["replay", *map(str, arguments), "--json", str(path), "--force"]) == 0
    document: dict[str, Any] = json.loads(path.read_text(), parse_constant=_refuse)
    return document


def _refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is not JSON")


@pytest.fixture(scope="module")
def picked(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], list[dict[str, str]]]:
    """JSON and rows of the series of the bag with a payload."""
    folder = tmp_path_factory.mktemp("replay")
    document = replay_json(folder, PICK, "--series", folder / "series.csv")
    with (folder / "series.csv").open(newline="") as file:
        return document, list(csv.DictReader(file))


def is_number(x: object) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)


def assert_table(value: Any, *shape: int) -> None:
    assert np.shape(value) == shape
    assert all(is_number(x) for x in np.ravel(value).tolist())


def assert_contract(document: dict[str, Any]) -> None:
    """The keys, types and shapes that others read."""
    assert isinstance(document["frame"], str)
    samples = document["samples"]
    assert set(samples) == {"read", "used", "rejected"}
    assert samples["read"] >= samples["used"] >= 0
    assert samples["read"] - samples["used"] == sum(samples["rejected"].values())
    assert all(isinstance(k, str) and isinstance(n, int) and n > 0 for k, n in samples["rejected"].items())
    assert is_number(document["duration_s"])
    assert document["realtime_factor"] > 0
    payload = document["payload"]
    assert is_number(payload["mass"])
    assert payload["mass_std"] > 0
    assert_table(payload["theta"], 10)
    assert_table(payload["covariance"], 10, 10)
    assert len(payload["com"]) == len(payload["com_std"]) == 3
    assert np.shape(payload["inertia_com"]) == (3, 3)
    assert document["status"] in STATUSES
    assert len(document["observable"]) == 10
    assert all(isinstance(x, bool) for x in document["observable"])
    for event in document["events"]:
        assert set(event) == {"t", "kind", "mass_before", "mass_after"}
        assert event["kind"] in ("pick", "drop", "change", "external_force")
        assert all(is_number(event[k]) for k in ("t", "mass_before", "mass_after"))
    assert all(isinstance(w, str) for w in document["warnings"])


def test_json_is_as_the_contract_says(picked: tuple[dict[str, Any], list[dict[str, str]]]) -> None:
    document, _ = picked
    assert_contract(document)
    assert document["frame"] == TRUTH["frame"]
    assert document["samples"] == {"read": 3500, "used": 3500, "rejected": {}}
    assert document["duration_s"] == pytest.approx(14.0, abs=0.01)
    payload = document["payload"]
    assert payload["mass"] == payload["theta"][0]
    assert payload["mass_std"] == pytest.approx(payload["covariance"][0][0] ** 0.5)
    _, com, inertia = inertial_parameters.to_com(np.array(payload["theta"]))
    np.testing.assert_allclose(payload["com"], com)
    np.testing.assert_allclose(payload["inertia_com"], inertia)
    np.testing.assert_array_equal(payload["covariance"], np.transpose(payload["covariance"]))


COLUMNS = [
    "t",
    *inertial_parameters.NAMES,
    *(f"{name}_std" for name in inertial_parameters.NAMES),
    "com_x",
    "com_y",
    "com_z",
    "status",
]


def test_series_has_a_row_an_estimate(picked: tuple[dict[str, Any], list[dict[str, str]]]) -> None:
    document, rows = picked
    assert list(rows[0]) == COLUMNS
    t = [float(r["t"]) for r in rows]
    assert np.all(np.diff(t) > 0)
    assert np.median(np.diff(t)) == pytest.approx(0.02, rel=0.3)  # publish_rate
    for r in rows:
        assert all(math.isfinite(float(r[c])) for c in COLUMNS[:21])
        assert r["status"] in STATUSES
    last = [float(rows[-1][c]) for c in inertial_parameters.NAMES]
    assert last == document["payload"]["theta"]


def test_truth_is_inside_the_intervals_while_it_is_carried(picked: tuple[dict[str, Any], list[dict[str, str]]]) -> None:
    _, rows = picked
    start = TRUTH["start_time"]
    carried = [r for r in rows if TRUTH["pick_time"] + 3.0 < float(r["t"]) < TRUTH["drop_time"] - 0.3]
    assert len(carried) > 100
    names = inertial_parameters.NAMES
    inside = [
        [abs(float(r[n]) - x) <= 1.96 * float(r[f"{n}_std"]) for n, x in zip(names, TRUTH["payload"]["theta"], strict=True)]
        for r in carried
    ]
    assert np.mean(inside) > 0.85
    last = carried[-1]
    assert last["status"] == "ok", float(last["t"]) - start
    assert abs(float(last["m"]) - 1.8) <= min(1.96 * float(last["m_std"]), 0.03 * 1.8)
    com = [float(last[f"com_{axis}"]) for axis in "xyz"]
    np.testing.assert_allclose(com, TRUTH["payload"]["com"], atol=0.004)


def test_pick_and_drop_are_found_in_time(picked: tuple[dict[str, Any], list[dict[str, str]]]) -> None:
    document, _ = picked
    assert [e["kind"] for e in document["events"]] == ["pick", "drop"]
    for event, true in zip(document["events"], TRUTH["events"], strict=True):
        assert abs(event["t"] - true["t"]) < 0.3
    pick, drop = document["events"]
    assert abs(pick["mass_before"]) < 0.15
    assert pick["mass_after"] == pytest.approx(1.8, rel=0.1)
    assert abs(drop["mass_after"]) < 0.15
    assert document["status"] == "no_payload"
    assert abs(document["payload"]["mass"]) < 0.15


def test_before_it_can_know_it_does_not_claim_to(picked: tuple[dict[str, Any], list[dict[str, str]]]) -> None:
    _, rows = picked
    assert rows[0]["status"] == "warming_up"
    for r in rows:
        t = float(r["t"]) - TRUTH["start_time"]
        if r["status"] == "ok":
            assert float(r["m_std"]) < 0.2
            assert t < 4.1 or 4.0 < t < 10.5, t


@pytest.mark.parametrize("bag", [pytest.param(PICK, marks=pytest.mark.slow), EMPTY], ids=["mcap", "sqlite3"])
def test_every_form_of_a_bag_gives_the_same(tmp_path: Path, bag: Path) -> None:
    """A folder with and without metadata.yaml, and the file in it alone."""
    config = slow_output(tmp_path)
    reference = replay_json(tmp_path, bag, "--config", config)
    assert_contract(reference)
    copy = tmp_path / "copy"
    shutil.copytree(bag, copy)
    (copy / "metadata.yaml").unlink()
    for target in (copy, next(copy.iterdir())):
        document = replay_json(tmp_path, target, "--config", config)
        assert document["payload"] == reference["payload"]
        assert document["samples"] == reference["samples"]


def slow_output(tmp_path: Path, **parameters: object) -> Path:
    """A configuration with few estimates a second, which is quick."""
    path = tmp_path / "node.yaml"
    path.write_text(yaml.safe_dump({"online_payload_estimator": {"ros__parameters": {"publish_rate": 5.0, **parameters}}}))
    return path


def test_an_empty_arm_with_friction_carries_nothing(tmp_path: Path) -> None:
    document = replay_json(tmp_path, EMPTY, "--config", slow_output(tmp_path))
    assert document["status"] in ("no_payload", "warming_up")
    assert abs(document["payload"]["mass"]) < max(0.15, 2.5 * document["payload"]["mass_std"])
    assert document["events"] == []


def test_the_command_says_what_the_library_says(tmp_path: Path) -> None:
    config = slow_output(tmp_path)
    document = replay_json(tmp_path, PICK, "--config", config)
    source, settings = BagSource(PICK), OnlineSettings(publish_rate=5.0)
    model = RobotModel.for_messages(str(source.robot_description), source.joint_names)
    advanced: list[int] = []
    result = replay(source, InputGate(model, settings), OnlineEstimation(model, settings), advanced.append)
    assert sum(advanced) == result.read == 3500
    plain = as_json(result)
    for key in ("frame", "payload", "status", "observable", "events", "warnings", "samples"):
        assert plain[key] == document[key]


def test_frame_and_urdf_are_options(tmp_path: Path) -> None:
    description = tmp_path / "arm.urdf"
    description.write_text(urdf("iiwa"))
    document = replay_json(tmp_path, PICK, "--urdf", description, "--frame", "lbr_iiwa_link_6", "--config", slow_output(tmp_path))
    assert document["frame"] == "lbr_iiwa_link_6"


@pytest.mark.parametrize(
    "text",
    [
        "online_payload_estimator:\n  ros__parameters:\n    frame_id: lbr_iiwa_link_5\n    publish_rate: 5.0\n",
        "/**:\n  ros__parameters:\n    frame_id: lbr_iiwa_link_5\n    publish_rate: 5.0\n",
        "/arm:\n  estimator:\n    ros__parameters: {frame_id: lbr_iiwa_link_5, publish_rate: 5.0}\n",
        "frame_id: lbr_iiwa_link_5\npublish_rate: 5\n",
    ],
    ids=["by name", "wildcard", "namespace", "plain"],
)
def test_configuration_files(tmp_path: Path, text: str) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(text)
    document = replay_json(tmp_path, PICK, "--config", path, "--series", tmp_path / "s.csv")
    assert document["frame"] == "lbr_iiwa_link_5"
    assert len((tmp_path / "s.csv").read_text().splitlines()) < 100


def test_parameters_that_only_the_node_has_are_passed_over_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    replay_json(tmp_path, PICK, "--config", slow_output(tmp_path, autostart=False, markers_rate=2.0))
    assert "autostart" in capsys.readouterr().err


def test_options_outrank_the_configuration(tmp_path: Path) -> None:
    config = slow_output(tmp_path, frame_id="lbr_iiwa_link_5")
    assert replay_json(tmp_path, PICK, "--config", config, "--frame", "lbr_iiwa_link_6")["frame"] == "lbr_iiwa_link_6"


def test_a_table_for_people_and_messages_beside_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["replay", str(PICK), "--config", str(slow_output(tmp_path))]) == 0
    captured = capsys.readouterr()
    for word in ("mass", "kg", "com x", "mm", "status", "no_payload", "pick", "drop", "times real time"):
        assert word in captured.out
    assert "Traceback" not in captured.err


def test_a_stream_that_goes_stale(tmp_path: Path) -> None:
    """The efforts end before the messages do: the estimate is not of now."""
    source, settings = BagSource(PICK), OnlineSettings(publish_rate=5.0)
    model = RobotModel.for_messages(str(source.robot_description), source.joint_names)
    records = [
        r if k < 2500 else type(r)(r.stamp, r.receive_time, r.names, r.position, r.velocity, []) for k, r in enumerate(source)
    ]
    result = replay(records, InputGate(model, settings), OnlineEstimation(model, settings))
    assert result.status == "stale"
    assert result.reason
    assert (result.read, result.used) == (3500, 2500)
    assert sum(result.rejected.values()) == 1000
    assert_contract(json.loads(json.dumps(as_json(result))))


def test_a_recording_without_a_usable_sample() -> None:
    source, settings = BagSource(PICK), OnlineSettings()
    model = RobotModel.for_messages(str(source.robot_description), source.joint_names)
    records = [
        type(r)(r.stamp, r.receive_time, r.names, r.position, r.velocity, []) for r, _ in zip(source, range(300), strict=False)
    ]
    for recording in (records, []):
        result = replay(recording, InputGate(model, settings), OnlineEstimation(model, settings))
        assert result.used == 0
        assert result.series == []
        assert result.status in ("stale", "warming_up")
        assert any("no estimate at all" in w for w in result.warnings)
        document = json.loads(json.dumps(as_json(result), allow_nan=False))
        assert document["payload"]["com"] == [None] * 3
        assert document["observable"] == [False] * 10


def bad_file(tmp_path: Path, name: str, content: bytes | str) -> str:
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return str(path)


@pytest.mark.parametrize(
    ("case", "message"),
    [
        ("no bag given", "BAG"),
        ("no bag", "does not exist"),
        ("not a bag", "not a bag"),
        ("folder without bag", "not a bag"),
        ("other topic", "/arm/joint_states"),
        ("no urdf file", "arm.urdf"),
        ("urdf is no xml", "XML"),
        ("urdf is binary", "arm.urdf"),
        ("urdf of another robot", "lbr_iiwa_joint_1"),
        ("unknown frame", "no link named 'hook'"),
        ("no model file", "model.yaml"),
        ("model is no yaml", "model.yaml"),
        ("model of another robot", "joints"),
        ("no config file", "config.yaml"),
        ("config is no yaml", "config.yaml"),
        ("config is binary", "config.yaml"),
        ("config is a list", "config.yaml"),
        ("config is empty", "config.yaml"),
        ("config has no parameters", "config.yaml"),
        ("bad setting", "publish_rate is -3"),
        ("setting of the wrong type", "estimator is 3"),
        ("joints that messages lack", "elbow"),
        ("effort_scale too short", "effort_scale"),
        ("unknown option", "--plott"),
        ("series in no folder", "no/such"),
        ("json in no folder", "no/such"),
        ("plot of unknown kind", ".docx"),
    ],
)
def test_bad_input_is_a_message_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], case: str, message: str
) -> None:
    def config(text: str | bytes) -> list[str]:
        return [str(PICK), "--config", bad_file(tmp_path, "config.yaml", text)]

    def parameters(**values: object) -> list[str]:
        return [str(PICK), "--config", str(slow_output(tmp_path, **values))]

    arm = str(tmp_path / "arm.urdf")
    model = "format: 1\nrobot: {name: a, joints: [x, y]}\neffects: []\n"
    arguments = {
        "no bag given": [],
        "no bag": [str(tmp_path / "none.mcap")],
        "not a bag": [bad_file(tmp_path, "bag.txt", "hello")],
        "folder without bag": [str(tmp_path)],
        "other topic": [str(PICK), "--topic", "/arm/joint_states"],
        "no urdf file": [str(PICK), "--urdf", arm],
        "urdf is no xml": [str(PICK), "--urdf", bad_file(tmp_path, "a.urdf", "robot: 1")],
        "urdf is binary": [str(PICK), "--urdf", bad_file(tmp_path, "arm.urdf", b"\x89PNG\xff\xfe\x00")]
        if "binary" in case
        else [],
        "urdf of another robot": [str(PICK), "--urdf", bad_file(tmp_path, "b.urdf", urdf("small_arm"))],
        "unknown frame": [str(PICK), "--frame", "hook"],
        "no model file": [str(PICK), "--model", str(tmp_path / "model.yaml")],
        "model is no yaml": [str(PICK), "--model", bad_file(tmp_path, "model.yaml", "a: [")] if "is no yaml" in case else [],
        "model of another robot": [str(PICK), "--model", bad_file(tmp_path, "m.yaml", model)],
        "no config file": [str(PICK), "--config", str(tmp_path / "config.yaml")],
    }
    more = {
        "config is no yaml": lambda: config("a: [1"),
        "config is binary": lambda: config(b"\xff\xfe\x00\x80"),
        "config is a list": lambda: config("[1, 2]"),
        "config is empty": lambda: config(""),
        "config has no parameters": lambda: config("node:\n  ros__parameters:\n"),
        "bad setting": lambda: parameters(publish_rate=-3),
        "setting of the wrong type": lambda: parameters(estimator=3),
        "joints that messages lack": lambda: parameters(joint_names=["elbow"]),
        "effort_scale too short": lambda: parameters(effort_scale=[1.0]),
        "unknown option": lambda: [str(PICK), "--plott", "x.png"],
        "series in no folder": lambda: [*parameters(), "--series", str(tmp_path / "no/such/series.csv")],
        "json in no folder": lambda: [*parameters(), "--json", str(tmp_path / "no/such/out.json")],
        "plot of unknown kind": lambda: [*parameters(), "--plot", str(tmp_path / "plot.docx")],
    }
    chosen = more[case]() if case in more else arguments[case]
    assert run(["replay", *chosen]) == 2
    captured = capsys.readouterr()
    assert message in captured.err.replace("\n", " ")
    assert "Traceback" not in captured.err


def test_help_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["replay", "--help"]) == 0
    out = capsys.readouterr().out
    assert "sysid replay" in out
    assert "Exit codes" in out


def test_what_takes_long_to_import_is_not_imported() -> None:
    """Half of the time that a short replay takes would go there."""
    slow = ("scipy.signal", "scipy.stats", "scipy.optimize", "cvxpy", "matplotlib", "plotly", "pybullet", "mujoco")
    code = f"import sys, sysid_ros.cli.replay; print([name for name in {slow} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
