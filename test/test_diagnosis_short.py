"""Recordings of a few seconds: both parts, what is fitted and what is judged on, must be long enough to be filtered."""

from __future__ import annotations

import numpy as np
import pytest

from sysid_ros.diagnosis.diagnose import diagnose
from sysid_ros.diagnosis.heldout import split
from sysid_ros.effects import Payload
from sysid_ros.effects.payload import BODY_STD
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.conditioning import SHORTEST, longest_stretch
from sysid_ros.signals.recording import Recording

ROBOT = RobotModel.from_urdf(
    """<robot name="pendulum"><link name="base"/>
  <link name="bar"><inertial><origin xyz="0.2 0 0"/><mass value="1.5"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="servo" type="revolute"><parent link="base"/><child link="bar"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="20" velocity="20"/></joint>
</robot>"""
)
RATE = 200.0


def swing(seconds: float, name: str = "swing", seed: int = 0) -> Recording:
    """The joint swings, under dry friction."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / RATE)
    w = 2.0 * np.pi * rng.uniform(0.5, 1.5, 3)
    q = (0.4 * np.sin(np.outer(t, w))).sum(axis=1, keepdims=True)
    v, a = (0.4 * np.sin(np.outer(t, w) + p) * w**k for k, p in ((1, np.pi / 2), (2, np.pi)))
    v, a = v.sum(axis=1, keepdims=True), a.sum(axis=1, keepdims=True)
    tau = ROBOT.rnea_along(q, v, a) + 0.3 * np.tanh(v / 0.02) + 0.02 * rng.standard_normal(q.shape)
    return Recording(name, t, q, v, tau)


@pytest.mark.parametrize("seconds", [(4.3,), (6.0,), (20.0,), (2.2, 2.2), (3.0, 3.0, 3.0, 2.5), (2.5, 20.0), (1.0, 5.0)])
def test_both_parts_can_be_filtered(seconds: tuple[float, ...]) -> None:
    recordings = [swing(s, f"{k}") for k, s in enumerate(seconds)]
    fitted, judged = split(recordings)
    for part in (fitted, judged):
        assert max(longest_stretch(r) for r in part) >= SHORTEST
    rows = sum(len(r.t) for r in (*fitted, *judged))
    assert rows == sum(len(r.t) for r in recordings)
    assert sum(r.seconds for r in judged) <= 0.55 * sum(seconds)


def test_six_seconds_of_one_joint_are_diagnosed() -> None:
    found = diagnose(ROBOT, [swing(6.0)])
    assert "coulomb_friction" in {f["name"] for f in found.as_dict()["effects"]}


@pytest.mark.parametrize("pieces", [4, 8])
def test_pieces_too_short_to_be_filtered_are_refused_with_the_cure(pieces: int) -> None:
    found = diagnose(ROBOT, [swing(1.5, f"{k}", k) for k in range(pieces)])
    assert found.verdict == "refused"
    assert "2 s are the least" in (found.refusal or "")


def test_a_mass_that_does_not_show_rules_no_payload_out_and_is_not_told() -> None:
    payload = Payload(ROBOT)
    theta, unknown = np.zeros(10), np.concatenate([BODY_STD[:1], np.full(9, 1e-3)])
    theta[1:4] = 0.05, 0.01, 0.0
    assert payload.possible(theta, unknown)
    assert not payload.possible(theta, np.full(10, 1e-3))
    parameters = payload.as_parameters(theta, np.diag(unknown**2))
    assert [p.name for p in parameters] == ["mass", "mc"]
    words = payload.in_words(parameters, "")
    assert "does not show" in words
    assert "0.05" in words
