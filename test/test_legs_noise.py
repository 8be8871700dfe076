"""Noise of recordings of a robot on legs: what every step repeats, rows whose errors are one, torques at their limits, feet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.legs.leg_noise import Gait, NoiseOfEach
from sysid_ros.effects import FootRadius, Motion
from sysid_ros.identification.channel_checks import check_legs
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.repetition import repeated_power, step_period

pytest.importorskip("pybullet_data", reason="PyBullet, which brings the quadruped, is not installed (extra sim)")

from test_legs_identified import BASE, LEGS, recording

PERIOD, STEP = 0.02, 0.5
N = BASE.robot.n


def motion(name: str, seconds: float) -> Motion:
    t: FloatArray = np.asarray(np.arange(round(seconds / PERIOD)) * PERIOD, dtype=np.float64)
    still = np.zeros((len(t), N))
    out = Motion(BASE.robot, t, still, still, still, still)
    out.recording = name
    return out


def every_step(t: FloatArray) -> FloatArray:
    """The same at every step, shape (N,)."""
    return np.asarray(np.sin(2.0 * np.pi * t / STEP) + np.sin(6.0 * np.pi * t / STEP + 1.0))


def test_the_period_of_steps_is_that_of_the_feet() -> None:
    t: FloatArray = np.asarray(np.arange(700) * PERIOD, dtype=np.float64)
    lengths = 0.4 + 0.02 * np.stack([every_step(t), every_step(t + 0.5 * STEP)], axis=1) + 0.01 * t[:, None]
    assert step_period([lengths], PERIOD) == pytest.approx(STEP, rel=0.02)
    assert step_period([np.random.default_rng(0).normal(size=(700, 2))], PERIOD) == 0.0
    assert step_period([lengths[:5]], PERIOD) == 0.0


def test_repeated_power_is_that_of_what_repeats() -> None:
    t: FloatArray = np.asarray(np.arange(700) * PERIOD, dtype=np.float64)
    rng = np.random.default_rng(1)
    noise = rng.normal(size=(700, 2))
    both = noise + np.stack([2.0 * every_step(t), 0.0 * t], axis=1)
    power = repeated_power([both], PERIOD, STEP)
    # 2 sin + 2 sin has the power 4; three standard deviations of chance are taken off
    assert 3.0 < power[0] < 4.3
    assert power[1] < 0.1


def test_what_every_step_repeats_counts_once_and_each_recording_has_its_own_noise() -> None:
    rng, found = np.random.default_rng(2), [motion("quiet", 14.0), motion("steps", 14.0)]
    band = Band(found, np.arange(N) < FREE)
    gaits = {"quiet": Gait(0.0, 14.0), "steps": Gait(STEP, 14.0)}
    y = [0.1 * rng.normal(size=m.tau.shape) for m in found]
    y[1] += every_step(found[1].t)[:, None]
    variance = NoiseOfEach.of([(band, band.rows(y))], gaits).along(band)
    quiet = np.repeat([band.motions[i].recording == "quiet" for i, _, _ in band.slices], [c for _, _, c in band.slices])
    assert np.median(variance[quiet, :FREE]) == pytest.approx(0.01, rel=0.3)
    # a constant column that follows the steps is known as well as one step of 0.5 s tells it, not 28
    column = band.rows([0.0 * found[0].tau, np.repeat(every_step(found[1].t)[:, None], N, axis=1)])[:, 0]
    information = float(np.sum(column**2 / variance[:, 0]))
    assert 0.3 < information / (2.0 * 8.0 * STEP) < 3.0


def test_rows_that_are_multiplied_come_back() -> None:
    rng, found = np.random.default_rng(3), [motion("a", 8.0), motion("b", 8.0)]
    mixed = [np.tril(rng.normal(size=(FREE, FREE)), -1) + np.eye(FREE) for _ in found]
    values = [rng.normal(size=m.tau.shape) for m in found]
    plain = Band(found, np.arange(N) < FREE)
    band = Band(found, np.arange(N) < FREE, mixed=mixed)
    rows = band.rows(values)
    np.testing.assert_allclose(band.unmixed(rows), plain.rows(values), atol=1e-9)
    first = np.repeat([i == 0 for i, _, _ in band.slices], [c for _, _, c in band.slices])
    np.testing.assert_allclose(rows[first, :FREE], plain.rows(values)[first, :FREE] @ mixed[0].T, atol=1e-9)
    one = np.zeros((len(band.f), N))
    one[:, 1] = 2.0
    spread = band.unmixed_variance(one)
    np.testing.assert_allclose(spread[first][0, :FREE], 2.0 * np.linalg.inv(mixed[0])[:, 1] ** 2, atol=1e-9)


def test_torques_at_their_limits_are_left_out_and_said() -> None:
    run = recording(1)
    assert not check_legs(LEGS, run, 0.1).spoiled.any()
    tau = run.tau.copy()
    tau[100:105, 2] = LEGS.effort_limit[2]
    checked = check_legs(LEGS, replace(run, tau=tau), 0.1)
    assert checked.spoiled[100:105, 2].all()
    assert checked.spoiled.sum() == 5
    assert [p.kind for p in checked.problems] == ["saturated_effort"]
    assert LEGS.joint_names[2] in checked.problems[0].text
    # a limit that is exceeded is none
    tau[300, 2] = 1.5 * LEGS.effort_limit[2]
    assert not check_legs(LEGS, replace(run, tau=tau), 0.1).spoiled.any()


def test_a_foot_is_no_hole_and_no_ball_that_a_leg_could_not_lift() -> None:
    effect = FootRadius(BASE.robot, feet=BASE.contact_frames)
    nothing = np.zeros(4)
    sure = np.full(4, 1e-4)
    assert effect.possible(nothing, sure, "each")
    assert effect.possible(nothing + 0.012, sure, "each")
    assert not effect.possible(np.array([0.0, 0.0, 0.113, 0.0]), sure, "each")
    assert not effect.possible(np.array([-0.04]), sure[:1], "all alike")
    assert effect.possible(np.array([-0.04]), np.array([0.02]), "all alike")  # it may be less
    assert effect.possible(np.array([0.01]), sure[:1], BASE.contact_frames[0])
