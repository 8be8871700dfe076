"""The URDF of the robot is likelier than others; faults of the channels and currents are hypotheses beside it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_bags import bag, messages
from robots import DATA, robot, urdf
from test_diagnosis import ARM, record
from unsimulated import unsimulated as unsimulated

from sysid_ros.cli.main import run
from sysid_ros.diagnosis.robot_hypotheses import judge
from sysid_ros.diagnosis.robot_likelihood import probabilities
from sysid_ros.effects import JointSign, TorqueSign
from sysid_ros.sample import FloatArray


@pytest.mark.slow
def test_the_likeliest_of_several_urdfs_is_judged(tmp_path: Path) -> None:
    heavy, foreign = tmp_path / "heavy.urdf", tmp_path / "foreign.urdf"
    heavy.write_text(urdf(ARM).replace('value="3"', 'value="12"'))
    foreign.write_text(urdf(ARM).replace('"turn"', '"other"'))
    recorded, out = bag(tmp_path / "bag", messages()), tmp_path / "out"
    right = DATA / f"{ARM}.urdf"
    given = [x for path in (heavy, right, foreign) for x in ("--urdf", str(path))]
    assert run(["diagnose", *given, str(recorded), "--out", str(out)]) == 0
    document = json.loads((out / "diagnosis.json").read_text())
    share = {Path(x["urdf"]).name: x["probability"] for x in document["urdfs"]}
    assert list(share) == ["heavy.urdf", right.name, "foreign.urdf"]
    assert share[right.name] > 0.9
    assert share["foreign.urdf"] == 0.0
    assert f"{right} is likeliest the robot's" in document["notes"][0]


@pytest.mark.slow
def test_a_wrong_sign_is_told_from_a_joint_that_counts_backwards() -> None:
    healthy = record(None, 1)
    flipped = np.where(np.arange(healthy.q.shape[1]) == 2, -1.0, 1.0)
    effort = judge(robot(ARM), [replace(healthy, tau=healthy.tau * flipped)])
    joint = judge(robot(ARM), [replace(healthy, q=healthy.q * flipped, tau=healthy.tau * flipped, v=None)])
    assert effort is not None
    assert joint is not None
    for found, kind in ((effort, TorqueSign), (joint, JointSign)):
        (fault,) = found.faults
        assert fault.effect.id == kind.id
        assert fault.joints == (2,)
        assert fault.probability is not None
        assert fault.probability > 0.9


@pytest.mark.slow
def test_dead_channels_among_currents_are_the_reason_of_a_refusal() -> None:
    healthy, rng = record(None, 1), np.random.default_rng(0)
    tau = healthy.tau / np.array([11.0, 14.0, 7.0, 9.0])
    tau[:, 1:3] = 1e-4 * rng.normal(size=(len(tau), 2))
    found = judge(robot(ARM), [replace(healthy, tau=tau)])
    assert found is not None
    assert found.refusal is not None
    assert "factor of its own on each joint (torque_unit)" in found.refusal
    assert found.factors is not None
    assert not found.factors.seen[1:3].any()


def test_a_likelihood_that_a_moment_decides_is_no_certainty() -> None:
    even, moment = np.full(400, 0.1), np.zeros(400)
    moment[7] = 40.0
    nothing: FloatArray = np.zeros(400)
    assert probabilities([even, nothing])[0] > 0.999
    assert 0.5 < probabilities([moment, nothing])[0] < 0.99
