"""A tilted base or a wrong zero moves all that the arm carries: what the links and the payload weigh counts for both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from robots import ROBOTS, random_body, random_sample, robot
from test_diagnosis import ARM, payload, record
from unsimulated import unsimulated as unsimulated

from sysid_ros.diagnosis import diagnose
from sysid_ros.effects import BaseTilt, JointOffset
from sysid_ros.effects.base_tilt import tilted_gravity
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

ROLL, PITCH, DELTA = 0.12, -0.07, 0.09


def added(model: RobotModel, rng: np.random.Generator) -> FloatArray:
    """A body more on each link."""
    return np.concatenate([inertial_parameters.from_com(*random_body(rng)) for _ in range(model.n)])


@pytest.mark.parametrize("name", ROBOTS)
def test_other_links_give_the_torque_of_their_regressor(name: str) -> None:
    model, rng = robot(name), np.random.default_rng(0)
    before, change = model.pi.copy(), added(model, rng)
    other = model.with_links(change)
    for _ in range(5):
        s = random_sample(model, rng)
        expected = model.rnea(s.q, s.v, s.a) + model.regressor(s.q, s.v, s.a) @ change
        np.testing.assert_allclose(other.rnea(s.q, s.v, s.a), expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_array_equal(other.pi, before + change)
    np.testing.assert_array_equal(model.pi, before)


@pytest.mark.parametrize("name", ROBOTS)
def test_what_an_arm_carries_is_turned_and_moved_with_it(name: str) -> None:
    """Columns times parameters are the torque of the loaded arm where it is less that where it is taken for."""
    model, rng = robot(name), np.random.default_rng(1)
    change = added(model, rng)
    loaded = model.with_links(change)
    tilt = BaseTilt(model, around=(ROLL, PITCH), links=change.tolist())
    zero = JointOffset(model, (model.joint_names[-2],), around=DELTA, links=change.tolist())
    gravity = tilted_gravity(model.gravity, ROLL, PITCH)
    for _ in range(5):
        s = random_sample(model, rng)
        q, v, a = s.q[None], s.v[None], s.a[None]
        level = loaded.rnea_along(q, v, a)[0]
        expected = loaded.rnea_along(q, v, a, gravity)[0] - level
        np.testing.assert_allclose(tilt.columns(s) @ [ROLL, PITCH], expected, atol=1e-8 * np.abs(level).max())
        q = q.copy()
        q[0, -2] -= DELTA
        expected = loaded.rnea_along(q, v, a)[0] - level
        np.testing.assert_allclose(zero.columns(s) @ [DELTA], expected, atol=1e-8 * np.abs(level).max())


@pytest.mark.parametrize("kind", [BaseTilt, JointOffset])
def test_the_links_are_part_of_the_settings_and_are_checked(kind: type[BaseTilt] | type[JointOffset]) -> None:
    model, rng = robot(ARM), np.random.default_rng(2)
    effect = kind(model, links=added(model, rng).tolist())
    sample = random_sample(model, rng)
    again = kind.from_settings(model, model.joint_names, effect.settings)
    np.testing.assert_array_equal(again.columns(sample), effect.columns(sample))
    assert "links" not in kind(model).settings
    with pytest.raises(ModelFileError, match=f"7 numbers.*{10 * model.n}"):
        kind(model, links=[1.0] * 7)


def on_a_slope(seed: int, seconds: float) -> Recording:
    """A payload on an arm whose base is tilted."""
    level = record(payload, seed, seconds)
    model = robot(ARM)
    body = inertial_parameters.from_com(0.8, np.array([0.02, -0.03, 0.05]), 0.002 * np.eye(3))
    frame = model.model.frames[model.frame_id(model.default_frame)]
    change = np.zeros((model.n, 10))
    change[frame.parentJoint - 1] = inertial_parameters.move(body, frame.placement.rotation, frame.placement.translation)
    loaded = model.with_links(change.ravel())
    still = np.zeros_like(level.q)
    tilted = loaded.rnea_along(level.q, still, still, tilted_gravity(model.gravity, ROLL, PITCH))
    return replace(level, tau=level.tau + tilted - loaded.rnea_along(level.q, still, still))


@pytest.mark.slow
def test_a_payload_on_a_tilted_base_is_no_force_besides() -> None:
    """Taken for the weight on a level base, a payload leaves a steady force of m g sin(tilt)."""
    result = diagnose(robot(ARM), [on_a_slope(1, 16.0)], [on_a_slope(2, 8.0)])
    sizes = {p.name: p for f in result.findings for p in f.parameters}
    assert {f.id for f in result.findings} == {"payload", "base_tilt"}
    for name, value in (("mass", 0.8), ("roll", ROLL), ("pitch", PITCH)):
        assert sizes[name].low <= value <= sizes[name].high
