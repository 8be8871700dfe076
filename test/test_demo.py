from __future__ import annotations

import importlib.util
import io
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

from sysid_ros.cli.demo import demo
from sysid_ros.cli.demo_display import Display, Picture, compare, objections, panel
from sysid_ros.cli.demo_processes import DemoProcess, ProcessFailed, ros_arguments
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.pages import TruthSegment
from sysid_ros.robot import inertial_parameters

COM = np.array([0.03, -0.02, 0.08])
INERTIA = np.diag([0.002, 0.003, 0.004])
TRUTH = TruthSegment(105.0, 111.0, 1.5, COM, INERTIA)
EVENTS = [PayloadEvent(105.02, "pick", 0.0, 1.5), PayloadEvent(111.05, "drop", 1.5, 0.0)]
ROOT = Path(__file__).resolve().parents[1]


def estimate(mass: float = 1.51, com: np.ndarray = COM, status: str = "ok", std: float = 0.01) -> PayloadEstimate:
    return PayloadEstimate(
        t=110.9,
        frame="tip",
        theta=inertial_parameters.from_com(mass, com, INERTIA),
        covariance=np.diag((std * np.array([1.0] + [0.1] * 9)) ** 2),
        status=status,
        reason="Because of a test.",
        observable=np.ones(10, dtype=bool),
        residual=np.zeros(7),
        payload_effort=np.zeros(7),
    )


def picture(**changes: Any) -> Picture:
    values: dict[str, Any] = {
        "t": 10.9,
        "duration": 14.0,
        "start": 100.0,
        "estimate": estimate(),
        "truth": TRUTH,
        "events": EVENTS[:1],
    }
    return Picture(**(values | changes))


def shown(what: object) -> str:
    out = io.StringIO()
    console = Console(file=out, width=110, force_terminal=False)
    console.print(what)
    return out.getvalue()


def test_a_right_estimate_has_no_objections() -> None:
    assert objections(estimate(), TRUTH, EVENTS) == []


@pytest.mark.parametrize(
    ("found", "events", "word"),
    [
        (None, EVENTS, "no estimate"),
        (estimate(status="inconsistent"), EVENTS, "status before the drop is inconsistent"),
        (estimate(mass=1.6, std=0.1), EVENTS, r"mass is wrong by \+0\.100 kg, \+6\.7 %"),
        (estimate(com=COM + np.array([0.0, 0.011, 0.0]), std=0.1), EVENTS, "centre of mass is wrong by 11.0 mm"),
        (estimate(mass=1.55, std=0.005), EVENTS, "covariance is too small"),
        (estimate(), EVENTS[1:], "pick was not found"),
        (estimate(), [EVENTS[0], PayloadEvent(112.0, "drop", 1.5, 0.0)], "drop was not found"),
    ],
)
def test_objections(found: PayloadEstimate | None, events: list[PayloadEvent], word: str) -> None:
    against = objections(found, TRUTH, events)
    assert len(against) == 1
    assert re.search(word, against[0])


def test_comparison() -> None:
    rows = {row.name: row for row in compare(estimate(), TRUTH)}
    assert list(rows) == ["mass", "com x", "com y", "com z", "Ixx", "Iyy", "Izz"]
    assert rows["mass"].error == pytest.approx(0.01)
    assert rows["mass"].half == pytest.approx(0.0196)
    assert rows["mass"].inside
    assert rows["com z"].estimate == pytest.approx(80.0)
    assert rows["Izz"].truth == pytest.approx(4.0)
    empty = TruthSegment(0.0, 1.0, 0.0, np.zeros(3), np.zeros((3, 3)))
    assert [row.name for row in compare(estimate(), empty)] == ["mass"]
    assert [row.name for row in compare(estimate(mass=0.0), TRUTH)] == ["mass"]


def test_the_picture_in_a_terminal() -> None:
    text = shown(panel(picture()))
    for word in (
        "10.9 of 14 s",
        "picked up 5.9 s ago",
        "ok",
        "Because of a test.",
        "1.510",
        "± 0.020",
        "pick 0.00 → 1.50 kg at 5.02 s",
    ):
        assert word in text
    height = [shown(panel(picture(estimate=e))).count("\n") for e in (estimate(), estimate(mass=0.0))]
    assert height[0] == height[1], "the table does not jump"


def test_one_line_a_second_elsewhere() -> None:
    out = io.StringIO()
    console = Console(file=out, width=300, force_terminal=False)
    with Display(console) as display:
        display.wait("this is for a terminal only")
        for t in np.arange(9.95, 12.0, 0.1):
            display.show(picture(t=t))
    lines = out.getvalue().splitlines()
    assert len(lines) == 3
    assert "found: pick" in lines[0]
    assert "found" not in "".join(lines[1:]), "an event is told once"


def test_arguments_of_ros() -> None:
    arguments = ros_arguments({"a": 1, "b": 2.0, "c": False, "d": [0.1, 2.0]})
    assert arguments == ["--ros-args", "-p", "a:=1", "-p", "b:=2.0", "-p", "c:=false", "-p", "d:=[0.1, 2.0]"]
    assert ros_arguments({}) == []


def test_help_says_the_criterion() -> None:
    text = " ".join(CliRunner().invoke(demo, ["--help"]).output.split())
    assert "the mass is within 5 %" in text
    assert "Exit codes" in text


def check_for(process: DemoProcess, seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        process.check()
        time.sleep(0.05)


def test_a_process_that_ends_shows_its_log(tmp_path: Path) -> None:
    with (
        DemoProcess("sysid_ros.no_such_node", {}, dict(os.environ), tmp_path / "log") as process,
        pytest.raises(ProcessFailed, match=r"no_such_node ended with code 1[\s\S]*No module named"),
    ):
        check_for(process, 30.0)


def test_a_process_that_ignores_sigint_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sysid_ros.cli.demo_processes._SOFT_STOP", 0.2)
    (tmp_path / "deaf.py").write_text(
        "import signal, time\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\nprint('deaf', flush=True)\ntime.sleep(100)\n"
    )
    log = tmp_path / "log"
    with DemoProcess("deaf", {}, os.environ | {"PYTHONPATH": str(tmp_path)}, log) as process:
        deadline = time.monotonic() + 30.0
        while "deaf" not in log.read_text() and time.monotonic() < deadline:
            time.sleep(0.05)
        process.check()
    with pytest.raises(ProcessFailed, match="code -9"):
        process.check()


def needs_ros_and_simulation() -> None:
    for package in ("rclpy", "pybullet"):
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"{package} is not installed")


def start(out: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "sysid_ros.cli.demo", "--robot", "arm", "--out", str(out), *options]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=ROOT, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def running_children(domain: str) -> list[str]:
    """Nodes of the demo that live in this ROS domain."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            environment, command = (folder / "environ").read_bytes(), (folder / "cmdline").read_bytes()
        except OSError:
            continue
        if f"ROS_DOMAIN_ID={domain}".encode() in environment.split(b"\0") and b"sysid_ros.nodes" in command:
            found.append(command.decode())
    return found


@pytest.mark.slow
def test_demo_ends_by_itself_with_a_plot(tmp_path: Path) -> None:
    needs_ros_and_simulation()
    process = start(tmp_path, "--duration", "24", "--seed", "1")
    output, errors = process.communicate(timeout=90)
    assert process.returncode == 0, output + errors
    assert (tmp_path / "payload.png").read_bytes().startswith(b"\x89PNG")
    assert "ros2 run sysid_ros online_payload_estimator" in output
    assert "The estimate was right." in output
    assert str(tmp_path / "payload.png") in output
    assert sum("truth" in text and "kg" in text for text in output.splitlines()) > 10, "a line a second"
    assert running_children(output.partition("ROS_DOMAIN_ID=")[2].split()[0]) == []


@pytest.mark.slow
@pytest.mark.parametrize(("sign", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_signal_stops_both_nodes(sign: signal.Signals, code: int, tmp_path: Path) -> None:
    needs_ros_and_simulation()
    process = start(tmp_path)
    assert process.stdout is not None
    head = ""
    while "ROS_DOMAIN_ID=" not in head:
        head += process.stdout.readline()
    domain = head.partition("ROS_DOMAIN_ID=")[2].split()[0]
    deadline = time.monotonic() + 30.0
    while not running_children(domain) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert running_children(domain)
    # one signal while the estimator starts, one while both nodes run
    if sign == signal.SIGINT:
        while "mass" not in process.stdout.readline():
            assert process.poll() is None
        assert len(running_children(domain)) == 2
    process.send_signal(sign)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == code, errors
    assert "Traceback" not in errors
    assert running_children(domain) == []


@pytest.mark.slow
def test_a_failing_node_ends_the_demo(tmp_path: Path) -> None:
    needs_ros_and_simulation()
    # no range excludes it, but the robot's node does
    process = start(tmp_path, "--payload-mass", "nan")
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "simulated_robot ended with code 2" in errors
    assert "payload_mass is" in errors, "the end of its log is shown"
