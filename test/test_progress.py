"""What is shown while a command works: one line that fits where a person watches, a few whole lines in a log."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys

import pytest

SENTENCE = "computing what each effect would do on every joint of a robot whose joints have long names, wrist_roll_joint_of_arm"
BODY = f"""
import os, sys, time
os.environ["TERM"] = sys.argv[1]
from sysid_ros.cli.output import note, warn
from sysid_ros.cli.progress import progress_bar, said_if_slow, stages
with progress_bar("a_bag_with_a_rather_long_name_of_its_own", 40) as advance:
    for _ in range(20):
        advance(2)
        time.sleep(0.01)
with stages() as tell:
    tell({SENTENCE!r})
    time.sleep(0.15)
with said_if_slow("Compiling for this machine, once after an install", 0.0):
    time.sleep(0.15)
warn({SENTENCE!r})
"""
_CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def in_terminal(columns: int, term: str = "xterm") -> str:
    """What comes to a terminal of so many columns."""
    owner, end = pty.openpty()
    environment = {**os.environ, "COLUMNS": str(columns), "LINES": "24", "NO_COLOR": "1"}
    process = subprocess.Popen([sys.executable, "-c", BODY, term], stdout=end, stderr=end, stdin=end, env=environment)
    os.close(end)
    out = b""
    while True:
        try:
            part = os.read(owner, 65536)
        except OSError:  # the process has closed it
            break
        if not part:
            break
        out += part
    os.close(owner)
    assert process.wait(60) == 0, out.decode()
    return out.decode()


@pytest.mark.parametrize("columns", [40, 80, 200])
def test_one_line_that_fits_and_goes(columns: int) -> None:
    said = in_terminal(columns)
    lines = [_CONTROL.sub("", line).rstrip("\r") for line in re.split(r"\r?\n|\r", said)]
    assert max(map(len, lines)) <= columns
    bar = next(line for line in lines if "%" in line)
    assert bar.startswith("a_bag")
    assert any(line.startswith(("⠋", "⠙", "⠹", "⠸", "⠼", "⠴")) and "computing" in line for line in lines)
    # a warning stays, with its words whole; all else is taken away again
    rest = said[said.rindex("\x1b[2K") :]
    assert " ".join(_CONTROL.sub("", rest).split()) == f"Warning: {SENTENCE}"


def test_a_log_has_whole_lines_and_no_bar() -> None:
    done = subprocess.run([sys.executable, "-c", BODY, "xterm"], capture_output=True, text=True, timeout=60, check=True)
    first, second, third = done.stderr.splitlines()
    assert re.fullmatch(rf" +0\.\d s  {re.escape(SENTENCE)}", first)
    assert second == "Compiling for this machine, once after an install."
    assert third == f"Warning: {SENTENCE}"
    assert done.stdout == ""


def test_a_terminal_that_can_draw_no_line_again_is_a_log() -> None:
    assert "\x1b[2K" not in in_terminal(80, "dumb")
