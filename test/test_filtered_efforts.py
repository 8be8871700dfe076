"""Efforts that a driver has low-passed: told as that, beside what is there, and nothing in its place."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from motions import Motion as Path_
from robots import robot, urdf
from scipy.signal import butter, lfilter
from test_diagnosis import ARM, NOISE, RATE

from sysid_ros.diagnosis import Diagnosis, diagnose
from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.effects import EffortLag, TorqueOffset
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.driver_filter import driver_filter
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.recording import Recording
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel

FRICTION = (1.2, 1.5, 0.6, 0.4)
FILTERS = [(1, 5.0), (2, 5.0), pytest.param(1, 2.0, marks=pytest.mark.long)]
IN_WORDS = {1: "first", 2: "second"}


def behind(values: FloatArray, order: int, cutoff: float, rate: float) -> FloatArray:
    """SciPy's Butterworth filter, from rest at the first value."""
    b, a = butter(order, cutoff / (0.5 * rate))
    return np.asarray(lfilter(b, a, values - values[0], axis=0) + values[0])


def lag_of(order: int, cutoff: float) -> float:
    return float(np.sqrt(order) / (2.0 * np.pi * cutoff))


def recording(seed: int, order: int = 0, cutoff: float = 0.0, late: float = 0.0, seconds: float = 14.0) -> Recording:
    """An arm with dry friction whose efforts are filtered, or late."""
    model, rng = robot(ARM), np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    q, v, a = Path_(model, seed, speed=1.2)(t)
    tau = model.rnea_along(q, v, a) + np.array(FRICTION) * np.tanh(v / 0.005)
    tau = behind(tau, order, cutoff, RATE) if order else tau
    tau = np.stack([np.interp(t - late, t, x) for x in tau.T], axis=1)
    return Recording(str(seed), t, q, v, tau + NOISE * rng.normal(size=q.shape))


@cache
def diagnosed(order: int, cutoff: float) -> Diagnosis:
    return diagnose(robot(ARM), [recording(1, order, cutoff)], [recording(2, order, cutoff, seconds=10.0)])


@pytest.mark.parametrize("order", [1, 2])
def test_the_filter_is_a_butterworth_low_pass(order: int) -> None:
    t = np.arange(0.0, 2.0, 1e-4)
    x = np.column_stack([np.sin(7.0 * t), np.cos(30.0 * t)])
    own = driver_filter(x, 1e-4 / lag_of(order, 5.0), order)
    late = t > 1.0  # SciPy's begins at rest, and forgets that
    np.testing.assert_allclose(own[late], behind(x, order, 5.0, 1e4)[late], atol=2e-6)
    np.testing.assert_array_equal(driver_filter(x.T, 1e-4 / lag_of(order, 5.0), order, axis=1), own.T)


@pytest.mark.parametrize("order", [1, 2])
def test_a_recording_may_begin_in_motion(order: int) -> None:
    t = np.arange(0.0, 4.0, 1e-3)
    x, steps = np.sin(7.0 * t)[:, None], 1e-3 / lag_of(order, 5.0)
    whole, starts = driver_filter(x, steps, order), range(2000, 2900, 60)
    off = [np.abs(driver_filter(x[k:], steps, order) - whole[k:]).max() for k in starts]
    from_rest = [np.abs(behind(x[k:], order, 5.0, 1e3) - whole[k:]).max() for k in starts]
    assert np.linalg.norm(off) < 0.6 * np.linalg.norm(from_rest)


@pytest.mark.parametrize("order", [1, 2])
def test_all_torque_is_low_passed_the_offset_of_the_sensor_too(order: int) -> None:
    model, lag = robot(ARM), lag_of(order, 3.0)
    t = np.arange(0.0, 6.0, 1e-3)
    q, v, a = Path_(model, 5, speed=1.2)(t)
    effect, offset = EffortLag(model, around=lag, order=order), TorqueOffset(model)
    known = [KnownEffect(effect, np.array([lag])), KnownEffect(offset, np.array(FRICTION))]
    found = TorqueModel(model, [], known).torque_along(Motion(model, t, q, v, a, np.zeros_like(q)))
    late = t > 1.0
    np.testing.assert_allclose(found[late], behind(model.rnea_along(q, v, a) + FRICTION, order, 3.0, 1e3)[late], atol=1e-3)


def test_columns_are_exact_where_they_are_made_and_the_delay_of_what_is_slow() -> None:
    model = robot(ARM)
    t = np.arange(0.0, 6.0, 0.005)
    q, v, a = Path_(model, 5, speed=1.2)(t)
    motion = Motion(model, t, q, v, a, np.zeros_like(q))
    effect = EffortLag(model, around=0.05)
    np.testing.assert_allclose(effect.columns_along(motion) @ [0.05], effect.torque_along(motion, np.array([0.05])), atol=1e-12)
    short, slope = (EffortLag(model, around=x).columns_along(motion)[200:] for x in (0.002, 0.0))
    assert np.abs(short - slope).max() < 0.05 * np.abs(slope).max()


@pytest.mark.slow
@pytest.mark.parametrize(("order", "cutoff"), FILTERS)
def test_it_is_told_with_the_friction_beside_it_and_nothing_else(order: int, cutoff: float) -> None:
    found = diagnosed(order, cutoff)
    assert found.verdict == "explained"
    told = {f.id: f.joints for f in found.findings}
    assert told == {"effort_lag": robot(ARM).joint_names, "coulomb_friction": robot(ARM).joint_names}


@pytest.mark.slow
@pytest.mark.parametrize(("order", "cutoff"), FILTERS)
def test_its_cutoff_and_the_friction_are_what_they_are(order: int, cutoff: float) -> None:
    found = {f.id: f for f in diagnosed(order, cutoff).findings}
    sizes = {p.name: p for p in found["effort_lag"].parameters}
    for name, true in (("cutoff", cutoff), ("lag", lag_of(order, cutoff))):
        assert isinstance(sizes[name].std, float)
        assert sizes[name].value == pytest.approx(true, abs=3.0 * sizes[name].std)
        assert sizes[name].std < 0.05 * true
    levels = [p.value for p in found["coulomb_friction"].parameters if p.name == "Fc"]
    np.testing.assert_allclose(levels, FRICTION, rtol=0.03)
    assert f"low-pass filter of the {IN_WORDS[order]} order (cut-off" in found["effort_lag"].words


@pytest.mark.parametrize("how", [{"late": 0.05}, {"order": 1, "cutoff": 3.0}, {"order": 2, "cutoff": 4.0}])
def test_declared_friction_does_not_turn_slowly_where_efforts_are_late(how: dict[str, float]) -> None:
    model = RobotModel.from_urdf(urdf(ARM).replace("<limit", '<dynamics friction="1.0"/><limit'))
    assert (model.friction > 0.0).any()
    on_time, late = (prepare(model, [recording(3, **x)], []).turns for x in ({}, how))  # type: ignore[arg-type]
    assert on_time is not None
    assert late is not None
    assert np.all(on_time < 0.006)
    assert np.all(late < 0.02)


@pytest.mark.slow
def test_a_filter_whose_cutoff_is_above_what_is_judged_is_a_delay() -> None:
    found = {f.id: f for f in diagnosed(2, 12.0).findings}
    assert set(found) == {"time_delay", "coulomb_friction"}
    assert "effort_lag" in found["time_delay"].cannot_be_told_from
    (delay,) = found["time_delay"].parameters
    assert delay.value == pytest.approx(lag_of(2, 12.0), rel=0.05)
