"""A velocity that sees more of a motion than a coarse encoder, and velocities that do not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from sysid_ros.sample import FloatArray
from sysid_ros.signals.seen_motion import clear_band
from sysid_ros.signals.velocity_channel import continued

RATE = 250.0
STEP = 1.5e-3
T = np.arange(round(30.0 * RATE)) / RATE


def motion() -> tuple[FloatArray, FloatArray]:
    """Slow moves, and a vibration of a tenth of a step."""
    slow = 0.6 * np.sin(1.1 * T) + 0.2 * np.cos(3.7 * T + 0.3)
    speed = 0.66 * np.cos(1.1 * T) - 0.74 * np.sin(3.7 * T + 0.3)
    w = 2.0 * np.pi * 6.0
    return slow + 1e-4 * np.sin(w * T), speed + 1e-4 * w * np.cos(w * T)


def channels(kind: str) -> tuple[FloatArray, FloatArray]:
    q, v = motion()
    rng = np.random.default_rng(1)
    coarse = STEP * np.round(q / STEP)
    if kind == "fine encoder":
        return 1e-5 * np.round(q / 1e-5), v + 1e-3 * rng.normal(size=len(T))
    if kind == "computed from the position":
        low = signal.butter(2, 12.0, fs=RATE)
        return coarse, signal.lfilter(*low, np.gradient(coarse, 1.0 / RATE))
    late = np.interp(T - {"late": 0.004}.get(kind, 0.0), T, v)
    gain = {"another gain": 1.02}.get(kind, 1.0)
    return coarse, gain * late + 1e-3 * rng.normal(size=len(T))


def acceleration_error(q: FloatArray) -> float:
    low = signal.butter(4, 9.0, fs=RATE, output="sos")
    found, true = (np.gradient(np.gradient(x, 1.0 / RATE), 1.0 / RATE) for x in (q, motion()[0]))
    inside = slice(round(RATE), -round(RATE))
    return float(np.std(signal.sosfiltfilt(low, found - true)[inside]))


def test_what_a_coarse_encoder_does_not_see_is_taken_from_the_velocity() -> None:
    q, v = channels("measured by itself")
    out, used = continued(q[:, None], v[:, None], RATE)
    assert acceleration_error(out[:, 0]) < 0.1 * acceleration_error(q)
    assert abs(float(np.mean(out[:, 0] - motion()[0]))) < 0.1 * STEP
    assert used[0]
    assert clear_band(v[:, None], RATE)[0] > 5.9


@pytest.mark.parametrize("kind", ["fine encoder", "computed from the position", "late", "another gain"])
def test_a_velocity_that_sees_no_more_is_not_used(kind: str) -> None:
    q, v = channels(kind)
    out, used = continued(q[:, None], v[:, None], RATE)
    np.testing.assert_array_equal(out[:, 0], q)
    assert not used[0]


def test_no_velocity_and_short_recordings_leave_the_position() -> None:
    q, v = channels("measured by itself")
    for position, velocity in ((q, np.full_like(v, np.nan)), (q[:500], v[:500])):
        out, used = continued(position[:, None], velocity[:, None], RATE)
        np.testing.assert_array_equal(out[:, 0], position)
        assert not used[0]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("still", ["q", "v", "q and v"])
def test_a_joint_that_stands_without_noise_is_left_as_it_is(still: str) -> None:
    q, v = channels("measured by itself")
    q, v = (np.full_like(x, 0.3 * (name == "q")) if name in still else x for name, x in (("q", q), ("v", v)))
    out, used = continued(q[:, None], v[:, None], RATE)
    np.testing.assert_array_equal(out[:, 0], q)
    assert not used[0]
