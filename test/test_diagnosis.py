"""Diagnosis: what is hidden in made-up recordings is found, with its size; healthy robots and bad input are told as such.

The motions are sums of sines; the torques come from the inverse dynamics, plus the hidden cause written out here anew.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from motions import Motion as Path_
from robots import robot
from unsimulated import unsimulated as unsimulated

from sysid_ros.diagnosis import Diagnosis, diagnose
from sysid_ros.diagnosis.band import Band
from sysid_ros.exceptions import DataError
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.whittle import Noise

ARM = "small_arm"
RATE = 200.0
NOISE = 0.05
Cause = Callable[[RobotModel, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray], FloatArray]


def record(
    cause: Cause | None,
    seed: int,
    seconds: float = 16.0,
    colour: float = 0.0,
    start: float = 50.0,
    speed: float = 1.2,
    rests: tuple[float, float] | None = None,
) -> Recording:
    """A recording of a motion with a cause added to the torque.

    Args:
        colour: correlation time of the noise [s]. rests: from when till when it stands, with a second to stop and to start [s].
    """
    model = robot(ARM)
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    along, pace, change = t, np.ones_like(t), np.zeros_like(t)
    if rests:
        stop, go = (np.clip(t - x, 0.0, 1.0) for x in (rests[0] - 1.0, rests[1]))
        pace = np.where(t < rests[1], 0.5 + 0.5 * np.cos(np.pi * stop), 0.5 - 0.5 * np.cos(np.pi * go))
        change, along = np.gradient(pace, t), np.cumsum(pace) / RATE
    q, dq, ddq = Path_(model, seed, speed)(along)
    v, a = dq * pace[:, None], ddq * pace[:, None] ** 2 + dq * change[:, None]
    tau = model.rnea_along(q, v, a)
    if cause is not None:
        tau = cause(model, t, q, v, a, tau)
    noise = NOISE * rng.normal(size=tau.shape)
    if colour:
        keep = np.exp(-1.0 / (RATE * colour))
        slow = np.zeros(model.n)
        for i, white in enumerate(rng.normal(size=tau.shape)):
            slow = keep * slow + NOISE * np.sqrt(1.0 - keep**2) * white
            noise[i] += slow
    return Recording(f"seed {seed}", start + t, np.round(q / 2e-5) * 2e-5, v + 1e-3 * rng.normal(size=v.shape), tau + noise)


def coulomb(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    out = tau.copy()
    out[:, 1] += 1.5 * np.sign(v[:, 1])
    return out


def viscous(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    out = tau.copy()
    out[:, 0] += 2.0 * v[:, 0]
    return out


def stribeck(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    out = tau.copy()
    out[:, 1] += np.sign(v[:, 1]) * (1.5 + 1.5 * np.exp(-((v[:, 1] / 0.2) ** 2)))
    return out


def payload(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    frame = model.frame_id(model.default_frame)
    theta = inertial_parameters.from_com(0.8, np.array([0.02, -0.03, 0.05]), 0.002 * np.eye(3))
    rows = [model.payload_regressor(*state, frame) @ theta for state in zip(q, v, a, strict=True)]
    return tau + np.stack(rows)


def scale(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    out = tau.copy()
    out[:, 1] *= 1.2
    return out


def late(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    return np.stack([np.interp(t - 0.03, t, column) for column in tau.T], axis=1)


def turned(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    out = tau.copy()
    out[:, 1] *= -1.0
    return out


def newton_millimetres(
    model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray
) -> FloatArray:
    return 1000.0 * tau


CAUSES: dict[str, tuple[Cause, tuple[str, ...], dict[str, float]]] = {
    "coulomb_friction": (coulomb, ("lift",), {"Fc": 1.5}),
    "viscous_friction": (viscous, ("turn",), {"b": 2.0}),
    "stribeck_friction": (stribeck, ("lift",), {"Fc": 1.5, "Fs": 3.0, "vs": 0.2}),
    "payload": (payload, robot(ARM).joint_names, {"mass": 0.8}),
    "torque_scale": (scale, ("lift",), {"gain": 1.2}),
    "time_delay": (late, robot(ARM).joint_names, {"delay": 0.03}),
    "torque_sign": (turned, ("lift",), {"gain": -1.0}),
    "torque_unit": (newton_millimetres, robot(ARM).joint_names, {"factor": 1000.0}),
}


@cache
def diagnosed(name: str) -> Diagnosis:
    cause = CAUSES[name][0]
    return diagnose(robot(ARM), [record(cause, 1)], [record(cause, 2, 10.0)])


QUICK = ("payload",)


@pytest.mark.parametrize("name", [pytest.param(x, marks=() if x in QUICK else pytest.mark.slow) for x in CAUSES])
def test_a_hidden_cause_is_named_with_its_joints_and_size(name: str) -> None:
    _, joints, values = CAUSES[name]
    document = diagnosed(name).as_dict()
    assert [e["name"] for e in document["effects"]] == [name]
    (effect,) = document["effects"]
    assert tuple(effect["joints"]) == tuple(joints)
    found = {p["name"]: p["value"] for p in effect["parameters"]}
    for parameter, value in values.items():
        assert found[parameter] == pytest.approx(value, rel=0.06)
    assert document["verdict"] == "explained"
    assert effect["sentence"]
    assert effect["evidence"]["delta_bic"] > 10.0


@pytest.mark.parametrize(
    "name", ["payload", *(pytest.param(x, marks=pytest.mark.slow) for x in ("coulomb_friction", "torque_unit"))]
)
def test_the_extended_model_predicts_what_is_published_down_to_the_noise(name: str) -> None:
    result = diagnosed(name)
    torque, predictions = result.torque, result.predictions
    assert torque is not None
    assert predictions is not None
    assert np.all(torque.after <= np.maximum(1.5 * torque.noise_floor, 0.02 * torque.torque))
    assert np.max(torque.before / torque.after) > 5.0
    error = np.sqrt(np.mean((predictions.measured - predictions.extended) ** 2, axis=0))
    assert np.all(error < np.sqrt(np.mean((predictions.measured - predictions.nominal) ** 2, axis=0)) + 1e-9)
    assert np.median(np.diff(predictions.t)) <= 1.0 / 40.0


def test_the_document_is_plain_json_with_the_fields_of_the_format() -> None:
    document = json.loads(json.dumps(diagnosed("payload").as_dict(), allow_nan=False))
    assert {"verdict", "refusal", "effects", "torque_rmse", "simulation", "unexplained_fraction", "record_next"} <= set(document)
    assert {"joints", "before", "after", "noise_floor"} <= set(document["torque_rmse"])
    assert {"horizon_s", "position_rmse_before", "velocity_rmse_after"} <= set(document["simulation"])
    (effect,) = document["effects"]
    com = next(p for p in effect["parameters"] if p["name"] == "com")
    np.testing.assert_allclose(com["value"], [0.02, -0.03, 0.05], atol=5e-3)
    assert len(com["ci95"][0]) == 3


@pytest.mark.parametrize("colour", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
def test_nothing_is_claimed_of_a_healthy_robot(colour: float) -> None:
    for seed in (11, 12, 13) if colour == 0.0 else (11,):
        result = diagnose(robot(ARM), [record(None, seed, colour=colour)], [record(None, seed + 50, 8.0, colour)])
        assert result.verdict == "nothing_wrong", [f.sentence for f in result.findings]
        assert not result.findings


@pytest.mark.slow
def test_without_other_recordings_the_last_part_is_held_out() -> None:
    recording = record(coulomb, 5, 18.0)
    result = diagnose(robot(ARM), [recording])
    assert [f.id for f in result.findings] == ["coulomb_friction"]
    assert result.predictions is not None
    # times count from the first stamp of the recording
    assert 0.65 * recording.seconds < result.predictions.t[0] < result.predictions.t[-1] < recording.seconds


def test_joints_that_never_moved_in_what_was_fitted_are_not_called_explained() -> None:
    model, rng, dry = robot(ARM), np.random.default_rng(4), np.full(robot(ARM).n, 1.5)
    t = np.arange(round(16.0 * RATE)) / RATE
    q, v, a = (np.zeros((len(t), model.n)) for _ in range(3))
    q[:, 1], v[:, 1], a[:, 1] = np.sin(2.0 * t), 2.0 * np.cos(2.0 * t), -4.0 * np.sin(2.0 * t)
    tau = model.rnea_along(q, v, a) + dry * np.sign(v) + NOISE * rng.normal(size=q.shape)
    one = Recording("one joint", t, q + 2e-5 * rng.normal(size=q.shape), v + 1e-3 * rng.normal(size=q.shape), tau)

    def everywhere(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
        return np.asarray(tau + dry * np.sign(v))

    result = diagnose(model, [one], [record(everywhere, 5, 12.0)])
    assert [(f.id, f.joints) for f in result.findings if f.id == "coulomb_friction"] == [
        ("coulomb_friction", (model.joint_names[1],))
    ]
    assert result.verdict == "partly_explained"
    assert "never moved: nothing can be told of them" in result.unexplained
    others = [name for name in model.joint_names if name != model.joint_names[1]]
    assert any(all(name in sentence for name in others) for sentence in result.record_next)


def test_bad_recordings_are_refused_with_the_cure() -> None:
    good = record(None, 3)
    still = replace(good, q=np.full_like(good.q, 0.2))
    frozen = replace(good, tau=np.where(np.arange(4) == 1, 3.0, good.tau))
    short = Recording("short", good.t[:400], good.q[:400], None, good.tau[:400])
    for recording, word in (
        (still, "at rest"),
        (frozen, "lift"),
        (short, "2.0 s"),
        (replace(good, q=np.rad2deg(good.q)), "degrees"),
    ):
        result = diagnose(robot(ARM), [recording])
        assert result.verdict == "refused"
        assert word in (result.refusal or "")
        assert not result.findings
        json.dumps(result.as_dict(), allow_nan=False)


def test_recordings_of_another_shape_are_an_error() -> None:
    good = record(None, 3, 6.0)
    with pytest.raises(DataError, match=r"3 joints.*has 4"):
        diagnose(robot(ARM), [Recording("other", good.t, good.q[:, :3], None, good.tau[:, :3])])
    with pytest.raises(DataError, match="shape"):
        Recording("torn", good.t[:-1], good.q, None, good.tau)
    with pytest.raises(DataError, match="no recording"):
        diagnose(robot(ARM), [])


def test_smooth_motions_keep_their_phase_and_split_at_gaps() -> None:
    recording = record(None, 4, 12.0)
    (whole,) = motions(robot(ARM), recording)
    q, v, a = Path_(robot(ARM), 4, speed=1.2)(whole.t)
    assert np.abs(whole.q - q).max() < 1e-3
    assert np.abs(whole.v - v).max() < 0.02
    assert np.sqrt(np.mean((whole.a - a) ** 2)) < 0.1
    keep = (recording.t < 55.0) | (recording.t > 56.0)
    torn = Recording("torn", recording.t[keep], recording.q[keep], None, recording.tau[keep])
    assert len(motions(robot(ARM), torn)) == 2


def test_rows_of_noise_have_its_spectrum_and_a_constant_stays_one_where_joints_stand() -> None:
    (motion,) = motions(robot(ARM), record(None, 6, 20.0))
    band = Band([motion])
    rng = np.random.default_rng(0)
    rows = np.stack([band.rows([rng.normal(size=motion.q.shape)]) for _ in range(20)])
    # the ends of each bridge count for all of it: a little more than the noise itself
    assert 0.97 < np.mean(rows**2) < 1.2
    constant = band.rows([np.ones_like(motion.q)])
    assert np.abs(constant[band.f > 0.0]).max() < 1e-9


def test_noise_is_read_from_its_coefficients() -> None:
    rng = np.random.default_rng(1)
    f = np.tile(np.arange(400) / 50.0, 6)
    true = 0.5 + 40.0 / (1.0 + (f / 0.3) ** 2)
    noise = Noise.of(f, true[:, None] * rng.normal(size=(f.size, 3)) ** 2)
    found = noise.variance(np.array([0.05, 0.3, 6.0]))
    np.testing.assert_allclose(found, np.array([[39.4], [20.5], [0.6]]).repeat(3, axis=1), rtol=0.35)
