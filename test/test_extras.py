"""What is not installed is named with the extra that brings it, in one line."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

ALONE = """import contextlib, io, json, sys
for name in ("pybullet", "pybullet_data", "mujoco", "pyarrow", "pyarrow.parquet", "rclpy", "rerun", "distributed"):
    sys.modules[name] = None
from sysid_ros.cli.main import run
from sysid_ros.nodes import start
answers = {}
for name, arguments in json.load(sys.stdin).items():
    with contextlib.redirect_stderr(io.StringIO()) as said:
        code = run(arguments) if arguments else getattr(start, name)()
    answers[name] = [code, said.getvalue()]
print(json.dumps(answers))
"""
COMMANDS: dict[str, tuple[list[str], str]] = {
    "simulate": (["simulate", "arm", "--bag", "new"], "sim"),
    "control": (["control", "--json", "new.json"], "sim"),
    "mjcf": (["export", "model.yaml", "--urdf", "robot.xml", "--out", "new.xml"], "mujoco"),
    "parquet": (["replay", "table.parquet", "--urdf", "robot.urdf"], "tables"),
    "rerun": (["replay", "table.csv", "--urdf", "robot.urdf", "--rerun", "new.rrd"], "rerun"),
    "batch": (["batch", "bags", "--robots", "robots.yaml", "--out", "store"], "fleet"),
    "demo": (["demo"], "ros"),
    "online_payload_estimator": ([], "ros"),
    "adaptive_controller": ([], "ros"),
    "simulated_robot": ([], "ros"),
}
"""What needs an extra, and which; without arguments: the node of that name."""
FILES = {
    "model.yaml": "format: 1\nrobot: {name: one, joints: [hip]}\neffects: []\n",
    "robot.xml": "<mujoco/>",
    "robot.urdf": "<robot name='one'/>",
    "table.parquet": "x",
    "table.csv": "x",
}


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, str]]:
    """Exit code and what stands on stderr, of a process in which no extra can be imported; nothing is left behind."""
    folder = tmp_path_factory.mktemp("alone")
    for name, text in FILES.items():
        (folder / name).write_text(text)
    asked = json.dumps({name: arguments for name, (arguments, _) in COMMANDS.items()})
    done = subprocess.run(
        [sys.executable, "-c", ALONE], cwd=folder, input=asked, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    return {name: (int(code), str(text)) for name, (code, text) in json.loads(done.stdout.splitlines()[-1]).items()}


@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_missing_is_named_with_its_extra(name: str, answers: dict[str, tuple[int, str]]) -> None:
    code, text = answers[name]
    assert code == 2
    assert text.startswith("Error: ")
    assert len(text.splitlines()) == 1
    assert f"pip install 'sysid_ros[{COMMANDS[name][1]}]'" in text


def test_a_simulator_that_is_missing_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    from sysid_ros.exceptions import SettingsError
    from sysid_ros.simulation import simulators

    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.setitem(sys.modules, "pybullet", None)
    assert simulators.installed() is None
    for name, extra in (("mujoco", "mujoco"), ("pybullet", "sim")):
        with pytest.raises(SettingsError, match=rf"pip install 'sysid_ros\[{extra}\]'"):
            simulators.installed(name)
