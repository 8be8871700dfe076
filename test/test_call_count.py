"""The way of one message through the node stays short."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed (extra ros)")
pytest.importorskip("pybullet", reason="pybullet is not installed (extra sim)")

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.slow
def test_one_message_takes_few_calls(tmp_path: Path) -> None:
    """In a process of its own: the profile sees all that runs."""
    path = tmp_path / "count.json"
    command = [sys.executable, str(ROOT / "benchmarks" / "call_count.py"), "--json", str(path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert path.is_file(), done.stderr
    found = json.loads(path.read_text(encoding="utf-8"))["results"]
    without, publication = "without an update", "with update and publication"
    assert 10 < found["calls"][without] <= 20
    assert 20 < found["calls"][publication] <= 42
    assert found["with_compiled"][without] <= 25
    assert found["with_compiled"][publication] <= 52
    assert found["files"][without] <= 12
    assert found["files"][publication] <= 14
