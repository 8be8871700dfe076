"""What a message calls is compiled before the first message: a pick is no moment to compile in."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

BAG = Path(__file__).parents[1] / "bags" / "arm_pick_and_drop"
CODE = """
import sys
from numba.core.dispatcher import Dispatcher
from sysid_ros.cli.main import run
from sysid_ros.online import replay, warm_up

def compiled():
    found = {}
    for name, module in list(sys.modules.items()):
        if name.startswith("sysid_ros."):
            for value in vars(module).values():
                if isinstance(value, Dispatcher):
                    found[value.py_func.__module__ + "." + value.py_func.__name__] = len(value.signatures)
    return found

import sysid_ros.cli.replay as command
warm, before = command.warm_up, {}
def watched(*arguments):
    estimates = warm(*arguments)
    before.update(compiled())
    return estimates
command.warm_up = watched
assert run(["replay", sys.argv[1]]) == 0
assert before
print("LATER", {k: n for k, n in compiled().items() if n > before.get(k, 0)})
"""


@pytest.mark.slow
def test_a_pick_and_a_drop_compile_nothing() -> None:
    """In a process of its own: others have compiled what they call."""
    done = subprocess.run([sys.executable, "-c", CODE, str(BAG)], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert "LATER {}" in done.stdout.splitlines(), done.stdout
