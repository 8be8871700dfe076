"""The Dockerfile and the compose file, as far as they can be read: commands, parameters and paths are those of the package."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
DOCKERFILE = (ROOT / "docker" / "Dockerfile").read_text(encoding="utf-8")
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "docker" / "compose.yaml").read_text(encoding="utf-8"))
TABLE: dict[str, Any] = json.loads((ROOT / "config" / "launch_arguments.json").read_text(encoding="utf-8"))
SCRIPTS = set(re.findall(r'^ +"(\w+) = ', (ROOT / "setup.py").read_text(encoding="utf-8"), re.MULTILINE))


def test_every_command_of_the_package_is_linked() -> None:
    (linked,) = re.findall(r"for name in ([\w ]+); do", DOCKERFILE)
    assert set(linked.split()) == SCRIPTS


def test_the_image_takes_what_the_project_has() -> None:
    assert re.search(r"^FROM ros:jazzy-", DOCKERFILE, re.MULTILINE)
    (extras,) = re.findall(r"/tmp/sysid_ros\[(\w+)\]", DOCKERFILE)
    assert f"\n{extras} = [" in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    launched = re.findall(r'"sysid_ros", "([\w.]+)"', DOCKERFILE)
    assert launched
    assert all((ROOT / "launch" / name).is_file() for name in launched)
    assert not set((ROOT / ".dockerignore").read_text(encoding="utf-8").split()) & {
        "sysid_ros",
        "config",
        "launch",
        "README.md",
        "LICENSE",
    }


def test_the_services_start_nodes_with_parameters_that_there_are() -> None:
    assert set(COMPOSE["services"]) == {"robot", "estimator", "controller"}
    for service in COMPOSE["services"].values():
        assert (ROOT / "docker" / service["build"]["context"] / service["build"]["dockerfile"]).is_file()
        assert service["stop_signal"] == "SIGINT"
        words = shlex.split(service["command"])
        assert words[:3] == ["ros2", "run", "sysid_ros"]
        given = {words[k + 1].partition(":=")[0] for k, word in enumerate(words) if word == "-p"}
        assert given <= set(TABLE[words[3]])
        assert set(service.get("depends_on", [])) <= set(COMPOSE["services"])


def test_the_controllers_gains_are_for_the_robots_rate() -> None:
    robot, controller = (COMPOSE["services"][name]["command"] for name in ("robot", "controller"))
    (rate,), (delay,) = re.findall(r"rate:=([\d.]+)", robot), re.findall(r"loop_delay:=([\d.]+)", controller)
    assert 1.0 / float(rate) < float(delay)
