"""When values were true, learned live: stamps that jitter and drivers that poll are put right, good stamps stay as they are."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from test_sample_times import motion, polled

from sysid_ros.estimators import JumpRule, Problem, VariableForgetting
from sysid_ros.input_gate.clock_kernel import SHARE
from sysid_ros.online.arm_rows import Cadence
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.simulation.description import arm_description

SEEDS = range(5)


def taken(t: FloatArray, q: FloatArray, tau: FloatArray) -> tuple[Cadence, FloatArray, FloatArray]:
    """What is put at its own time live: which messages, and when they were true."""
    cadence, index, times = Cadence(0.25, q.shape[1]), {}, []
    for k in range(len(t)):
        m = Measurement(float(t[k]), q[k].copy(), None, tau[k].copy())
        index[m.q.tobytes()] = k
        assert cadence.follows(m.t)
        times += [(index[x.q.tobytes()], x.t) for x in cadence.take(m)]
    return cadence, np.array([k for k, _ in times]), np.array([at for _, at in times])


def noisy(true: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
    """Positions with the noise of encoders, and efforts."""
    rng = np.random.default_rng(seed)
    return motion(true, seed) + 2e-5 * rng.standard_normal((len(true), 5)), rng.standard_normal((len(true), 5))


def bends(times: FloatArray, true: FloatArray) -> float:
    """What errors of times bend a motion by, after some seconds to learn [s]."""
    return float(np.std(np.diff((times - true)[len(true) // 4 :], 2)))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("rate", "size"), [(1000, 0.2), (250, 0.05), (100, 0.1)])
def test_stamps_that_jitter_about_an_even_clock_are_put_right(rate: int, size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    true = np.arange(8 * rate) / rate
    stamps = true + size / rate * rng.standard_normal(len(true))
    kept = np.concatenate([[True], stamps[1:] > np.maximum.accumulate(stamps)[:-1]])  # the gate refuses those before the last
    true, stamps = true[kept], stamps[kept]
    cadence, index, times = taken(stamps, *noisy(true, seed))
    assert np.all(np.diff(times) > 0.0)
    assert len(times) == len(true)
    assert bends(times, true[index]) < 0.05 * bends(stamps, true)
    assert cadence.clock is not None
    assert cadence.clock.off == pytest.approx(size / rate, rel=0.2)
    assert "The stamps are off by" in " ".join(cadence.in_words)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("walks", [False, True])
def test_uneven_sampling_that_is_stamped_truly_is_left_as_it_is(walks: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    errors = 1e-3 * rng.standard_normal(1500)
    true = np.cumsum(0.01 + errors) if walks else 0.01 * np.arange(1500) + errors
    cadence, index, times = taken(true, *noisy(true, seed))
    assert bends(times, true[index]) < 0.01 * 1e-3 * np.sqrt(6.0)
    assert not cadence.in_words


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("stamps", [True, False])
def test_what_is_more_even_is_believed(stamps: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    uneven, off = (0.5e-3, 1e-3) if stamps else (1e-3, 0.5e-3)
    true = 0.01 * np.arange(2000) + uneven * rng.standard_normal(2000)
    stamped = true + off * rng.standard_normal(2000)
    cadence, index, times = taken(stamped, *noisy(true, seed))
    assert cadence.clock is not None
    assert cadence.clock.state[0][SHARE] == pytest.approx(1.0 if stamps else 0.0, abs=1e-6)
    assert bends(times, true[index]) == pytest.approx(0.5e-3 * np.sqrt(6.0), rel=0.15)


@pytest.mark.parametrize("seed", SEEDS)
def test_even_stamps_of_which_some_are_lost_stay_to_the_last_digit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    true = np.arange(4000) / 500.0
    true = true[rng.uniform(size=len(true)) > 0.01]
    _, index, times = taken(100.0 + true, *noisy(true, seed))
    np.testing.assert_array_equal(times, 100.0 + true[index])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("source", [0.0340, 0.0352, 0.0401, 0.06])
def test_a_driver_that_polls_a_slower_source(source: float, seed: int) -> None:
    stamps, q, tau, true = polled(source, 1.0 / 30.0, seed)
    cadence, index, times = taken(stamps, q, tau)
    assert np.all(np.diff(times) > 0.0)
    assert cadence.clock is not None
    assert cadence.clock.repeated == len(true) - len(times)
    # of the first value alone no speed is known yet
    assert len(np.unique(true)) <= len(times) <= len(np.unique(true)) + 1
    assert bends(times, true[index]) < 0.1 * bends(stamps[index], true[index])
    assert f"slower source of {1.0 / source:.3g}"[:-1] in " ".join(cadence.in_words)


@pytest.mark.parametrize("late", [0.0, 1e-4])
def test_the_sawtooth_of_a_driver_that_polls_does_not_move_the_clock(late: float) -> None:
    """250 Hz, polled 1.02 times as often by a driver that is up to ``late`` [s] late itself: a line drawn after each stamp would
    follow the sawtooth of 4 ms and bend the motion by 4 us, ten times a second."""
    rng = np.random.default_rng(0)
    stamps = np.arange(0.0012, 14.0, 0.004 / 1.02)
    stamps += late * rng.uniform(size=len(stamps))
    newest = np.floor(stamps / 0.004).astype(int)
    grid = 0.004 * np.arange(newest[-1] + 1)
    q, tau = noisy(grid, 0)
    _, index, times = taken(stamps, q[newest], tau[newest])
    assert bends(times, grid[newest[index]]) < 0.1e-6 + 0.01 * late


def test_a_robot_that_stands_still_to_the_last_bit_is_not_polled() -> None:
    t = 0.01 * np.arange(1500)
    q = motion(np.minimum(t, 5.0), 0)
    tau = np.repeat(q[:, :1], 5, axis=1)
    cadence, times = Cadence(0.25, 5), []
    for k in range(len(t)):
        assert cadence.follows(float(t[k]))
        times += [m.t for m in cadence.take(Measurement(float(t[k]), q[k].copy(), None, tau[k].copy()))]
    np.testing.assert_array_equal(times, t)


@pytest.mark.parametrize("seed", range(3))
def test_the_payload_of_an_arm_that_is_polled(seed: int) -> None:
    """94.3 Hz, polled at 100 Hz, 20 s: the mass of 2 kg, which stamps as they are tell to 1 to 12 %."""
    robot = RobotModel.from_urdf(arm_description())
    rng = np.random.default_rng(seed)
    source, poll = 0.0106, 0.01
    grid = source * np.arange(round(20.0 / source))
    f, size, phase = rng.uniform(0.1, 0.5, (3, robot.n)), rng.uniform(0.2, 0.5, (3, robot.n)), rng.uniform(0.0, 6.0, (3, robot.n))
    w = 2.0 * np.pi * f
    angle = w * grid[:, None, None] + phase
    q, v = np.sum(size * np.sin(angle), axis=1), np.sum(size * w * np.cos(angle), axis=1)
    a = -np.sum(size * w**2 * np.sin(angle), axis=1)
    theta = pin.Inertia(2.0, np.array([0.02, -0.03, 0.05]), 0.01 * np.eye(3)).toDynamicParameters()
    frame = robot.frame_id(robot.default_frame)
    tau = np.array([robot.rnea(*x) + robot.payload_regressor(*x, frame) @ theta for x in zip(q, v, a, strict=True)])
    q, tau = q + 2e-5 * rng.standard_normal(q.shape), tau + 0.1 * rng.standard_normal(tau.shape)
    estimation, latest = OnlineEstimation(robot, OnlineSettings()), None
    for stamp in np.arange(0.005, grid[-1], poll):
        k = int(stamp / source)
        latest = estimation.step(Measurement(1.0 + float(stamp), q[k].copy(), None, tau[k].copy())) or latest
    assert latest is not None
    assert latest.status == "ok"
    assert latest.mass == pytest.approx(2.0, rel=0.005)
    assert not estimation.events
    assert "slower source of 94.3" in " ".join(estimation.warnings)


@pytest.mark.parametrize("source", [0.0352, 0.0401])
def test_the_clock_is_first_believed_once(source: float) -> None:
    stamps, q, tau, _ = polled(source, 1.0 / 30.0, 0)
    cadence, turned, periods = Cadence(0.25, q.shape[1]), 0, []
    for k in range(len(stamps)):
        assert cadence.follows(float(stamps[k]))
        cadence.take(Measurement(float(stamps[k]), q[k].copy(), None, tau[k].copy()))
        turned += cadence.turned
        periods.append(cadence.period)
    assert turned == 1
    assert abs(periods[-1] - source) < 0.4 * abs(periods[0 if periods[0] else 24] - source)  # known better by then


@pytest.mark.parametrize("known", [False, True])
def test_noise_is_not_learned_from_rows_whose_times_were_wrong(known: bool) -> None:
    """While the clock is not believed yet the rows hold the edges of a sawtooth; what is known by then stays."""
    robot = RobotModel.from_urdf(arm_description())
    changes = OnlineEstimation(robot, OnlineSettings())._changes
    about = np.full(10, 1.0), np.full(robot.n, 1e-3), 0.01, 60.0, JumpRule(slice(0, 10), np.full(10, np.inf), 0.0)
    estimator, rng = VariableForgetting(Problem(*about)), np.random.default_rng(0)
    for _ in range(300 if known else 50):
        estimator.update(rng.standard_normal((robot.n, 10)), rng.standard_normal(robot.n))
    assert estimator.noise_known == known
    before = estimator.theta
    assert changes.unlearn(estimator) != known
    np.testing.assert_array_equal(estimator.theta, before if known else np.zeros(10))
