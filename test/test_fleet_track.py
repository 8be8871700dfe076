"""track: what a simulated robot has is found within its intervals, and what a bag can't tell is not told."""

from __future__ import annotations

import numpy as np
import pytest
from fleet_bags import ARM, Hidden, recording
from robots import robot

pytest.importorskip("pyarrow", reason="the extra fleet is not installed")

from sysid_ros.exceptions import DataError
from sysid_ros.fleet.known_robot import KnownRobot
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.fleet.track import Tracked, effort_noise, track
from sysid_ros.robot.inertial_parameters import from_com
from sysid_ros.robot.urdf_bodies import as_links
from sysid_ros.signals.recording import Recording

NOTHING = np.zeros(10)
FULL = Hidden(torque_gain=1.05, joint_offset=0.008, torque_delay=0.003, mass=0.7)


def known() -> KnownRobot:
    model = robot(ARM)
    return KnownRobot(model, None, model.default_frame, NOTHING)


def errors(found: Tracked, hidden: Hidden) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Over their standard deviations, shape (8, n)."""
    truth = np.array([getattr(hidden, name) for name in JOINT_PARAMETERS])
    of_model = np.zeros((8, robot(ARM).n))
    of_model[0], of_model[1], of_model[5] = robot(ARM).friction, robot(ARM).damping, np.array(robot(ARM).model.armature)
    return np.asarray((found.values - truth[:, None] - of_model) / found.std)


@pytest.mark.parametrize("hidden", [Hidden(), FULL], ids=["as its URDF", "with everything"])
def test_what_is_hidden_is_found_within_its_intervals(hidden: Hidden) -> None:
    found = [track(known(), recording(hidden, seed)) for seed in range(1, 9)]
    z = np.array([errors(f, hidden) for f in found])
    told = np.isfinite(z)
    assert told.mean() > 0.7
    assert 0.88 < np.mean(np.abs(z[told]) < 1.96) < 0.99
    assert np.nanmax(np.abs(z)) < 5.0
    for f in found:
        (body,) = f.carried
        assert abs(body.theta[0] - hidden.mass) < 4.0 * np.sqrt(body.covariance[0, 0])


def test_what_the_model_knows_is_counted_in() -> None:
    model = robot(ARM)
    body = from_com(0.7, np.array([0.02, -0.01, 0.06]), 7e-4 * np.eye(3))
    of_payload = KnownRobot(model, None, model.default_frame, body)
    found, free = (track(k, recording(FULL, 4)) for k in (of_payload, known()))
    told = np.isfinite(found.values)
    np.testing.assert_array_equal(told, np.isfinite(free.values))
    assert np.all(np.abs(found.values - free.values)[told] < 0.5 * found.std[told])
    np.testing.assert_allclose(found.carried[0].theta[:4], free.carried[0].theta[:4], atol=0.01)


def test_a_body_as_links_has_the_torque_of_the_payload() -> None:
    model = robot(ARM)
    body, rng = from_com(1.3, np.array([0.1, -0.05, 0.2]), np.diag([0.01, 0.02, 0.015])), np.random.default_rng(0)
    q, v, a = rng.normal(size=(3, 5, model.n))
    columns = np.stack([model.payload_regressor(*x, model.frame_id(model.default_frame)) for x in zip(q, v, a, strict=True)])
    np.testing.assert_allclose(
        model.link_torque_along(q, v, a, as_links(model, model.default_frame, body)), columns @ body, atol=1e-9
    )


def test_a_joint_that_stands_is_not_told() -> None:
    joint = robot(ARM).joint_names[1]
    found = track(known(), recording(Hidden(still=(joint,)), 5))
    assert np.isnan(found.values[:7, 1]).all()
    assert set(JOINT_PARAMETERS[:7]) <= set(found.from_prior[1])
    assert np.isnan(found.covariance[1][:7, :7]).all()
    assert np.isfinite(found.values[0, 0])


def test_noise_that_keeps_its_sign_widens_the_intervals() -> None:
    """The same power at every sample, but most of it below the cut-off."""
    white, coloured = (track(known(), recording(Hidden(colour=colour), 6)) for colour in (0.0, 0.95))
    ratio = np.nanmedian(coloured.std[:7] / white.std[:7])
    assert ratio > 2.0
    z = errors(coloured, Hidden())[:7]
    assert np.nanmax(np.abs(z)) < 5.0


def test_a_body_that_is_picked_up_is_two_payloads() -> None:
    hidden = Hidden(mass=1.0, pick=5.5)
    before, after = track(known(), recording(hidden, 7)).carried
    assert after.t_from == pytest.approx(5.5, abs=0.15)
    assert abs(before.theta[0]) < 4.0 * np.sqrt(before.covariance[0, 0])
    assert abs(after.theta[0] - 1.0) < 4.0 * np.sqrt(after.covariance[0, 0])
    assert before.t_to == after.t_from


def test_another_robot_is_refused() -> None:
    of = recording(Hidden(), 8)
    with pytest.raises(DataError, match=r"torque's power.*robots\.yaml"):
        track(known(), Recording("other", of.t, of.q, None, 5.0 * np.sin(4.0 * (of.t - of.t[0])[:, None] + np.arange(4.0))))


def test_noise_of_the_efforts_does_not_see_the_motion() -> None:
    noise, std = effort_noise(recording(Hidden(noise=0.25), 9, seconds=20.0))
    assert np.all(np.abs(noise - 0.25) < 4.0 * std)
    assert np.all(std < 0.02)
    steps = recording(Hidden(noise=0.0), 9)
    held = Recording("held", steps.t, steps.q, None, np.round(steps.tau))
    assert np.isnan(effort_noise(held)[0]).all()
