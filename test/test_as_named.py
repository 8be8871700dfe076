"""A model is not identified from channels that are not what they are named, unless that is asked for."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_bags import bag, changed, messages
from robots import DATA, robot
from test_diagnosis import ARM, record

from sysid_ros.cli.main import run
from sysid_ros.diagnosis.whose.as_named import as_named
from sysid_ros.exceptions import DataError
from sysid_ros.signals.recording import Recording

MODEL = robot(ARM)
JOINT = 2


def turned(recording: Recording, efforts: bool) -> Recording:
    """With the position and velocity of a joint of the other sign, and its effort or not."""
    sign = np.where(np.arange(MODEL.n) == JOINT, -1.0, 1.0)
    v = None if recording.v is None else recording.v * sign
    return replace(recording, q=recording.q * sign, v=v, tau=recording.tau * sign if efforts else recording.tau)


def test_nothing_is_said_of_channels_as_they_are_named() -> None:
    assert as_named(MODEL, None, [record(None, 1)]) == []


@pytest.mark.slow
@pytest.mark.parametrize("efforts", [True, False])
def test_a_joint_that_counts_backwards_is_refused_by_name(efforts: bool) -> None:
    recorded = [turned(record(None, 1), efforts)]
    with pytest.raises(DataError) as refused:
        as_named(MODEL, None, recorded)
    for word in ("joint_sign", MODEL.joint_names[JOINT], "probability 1", "--accept-doubts"):
        assert word in str(refused.value)
    (problem,) = as_named(MODEL, None, recorded, accept_doubts=True)
    assert "joint_sign" in problem.text


def test_efforts_in_another_unit_are_left_to_the_fit() -> None:
    recorded = record(None, 1)
    assert as_named(MODEL, None, [replace(recorded, tau=1000.0 * recorded.tau)]) == []


@pytest.mark.slow
def test_the_command_refuses_and_goes_on_where_it_is_told_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sign = np.where(np.arange(MODEL.n) == JOINT, -1.0, 1.0)
    recorded, out = bag(tmp_path / "bag", changed(messages(), position=lambda x: x * sign)), tmp_path / "model.yaml"
    asked = [
        "identify",
        str(recorded),
        "--urdf",
        str(DATA / f"{ARM}.urdf"),
        "--out",
        str(out),
        "--json",
        str(tmp_path / "x.json"),
    ]
    assert run(asked) == 2
    assert "joint_sign" in capsys.readouterr().err
    assert not out.exists()
    assert run([*asked, "--accept-doubts"]) == 0
    problems = json.loads((tmp_path / "x.json").read_text())["problems"]
    assert any("joint_sign" in p["text"] for p in problems)


@pytest.mark.slow
def test_two_swapped_legs_and_an_imu_in_g_are_refused() -> None:
    pytest.importorskip("pybullet_data", reason="PyBullet, which brings the quadruped, is not installed (extra sim)")
    from test_leg_channels import swapped
    from test_legs_diagnosed import noisy
    from test_legs_identified import BASE, LEGS, recording

    healthy = noisy(recording(7), 7)
    assert healthy.trunk is not None
    assert as_named(LEGS, BASE, [healthy]) == []
    in_g = replace(healthy, trunk=replace(healthy.trunk, force=healthy.trunk.force / 9.81))
    for wrong, word in ((swapped(healthy), "joint_order"), (in_g, "shows g and not")):
        with pytest.raises(DataError, match=word):
            as_named(LEGS, BASE, [wrong])
