"""The command ``sysid``: its overview, its exit codes, and where messages go."""

from __future__ import annotations

import subprocess
import sys
import types
from pathlib import Path

import click
import pytest

from sysid_ros.cli import main as cli
from sysid_ros.exceptions import BagError


def test_overview_names_every_command_and_imports_none() -> None:
    code = "import sys; from sysid_ros.cli.main import run; code = run(['--help']); sys.exit(code or 'numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    for name, (_, sentence) in cli.COMMANDS.items():
        assert name in done.stdout
        assert sentence in done.stdout


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["--version"]) == 0
    assert "0.1" in capsys.readouterr().out


def test_unknown_command_is_2_and_names_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["estimte"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "estimte" in captured.err
    assert "replay, identify, simulate, excite, diagnose" in captured.err


def _refuse() -> None:
    raise BagError("bag.mcap holds no message on /joint_states.")


def _not_found() -> None:
    Path("/nowhere/out.json").write_text("", encoding="utf-8")


@pytest.mark.parametrize(
    ("body", "code", "message"),
    [
        (lambda: None, 0, ""),
        (lambda: 1, 1, ""),
        (_refuse, 2, "Error: bag.mcap holds no message on /joint_states.\n"),
        (_not_found, 2, "Error: /nowhere/out.json: No such file or directory.\n"),
    ],
)
def test_exit_codes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], body: object, code: int, message: str
) -> None:
    module = types.ModuleType("sysid_ros.cli.stand_in")
    module.command = click.command("stand-in")(body)  # type: ignore[attr-defined,arg-type]
    monkeypatch.setitem(sys.modules, "sysid_ros.cli.stand_in", module)
    monkeypatch.setitem(cli.COMMANDS, "stand-in", ("sysid_ros.cli.stand_in", "For this test."))
    assert cli.run(["stand-in"]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == message


def test_wrong_option_is_2_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["--no-such-option"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "--no-such-option" in captured.err
