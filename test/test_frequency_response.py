"""Frequency responses by local polynomials: unbiased, with regions that hold what they promise; periods, noise, distortion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import fft, signal

from sysid_ros.frequency_domain.beyond_linear import distortion
from sysid_ros.frequency_domain.causes import find_cause
from sysid_ros.frequency_domain.lines import Record, bridged, find_periods
from sysid_ros.frequency_domain.local_fit import circular_quantile, local_fit
from sysid_ros.frequency_domain.verdict import verdict
from sysid_ros.sample import FloatArray

PERIOD = 0.01


def band(seed: int, count: int) -> FloatArray:
    sections = signal.butter(2, [0.3, 8.0], "bandpass", fs=1.0 / PERIOD, output="sos")
    return np.asarray(signal.sosfilt(sections, np.random.default_rng(seed).standard_normal(count + 2000)))


def noise(seed: int, count: int, colour: float) -> FloatArray:
    white = np.random.default_rng([seed, 1]).standard_normal(count + 3000)
    return np.asarray(signal.lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white)[3000:])


def record(u: FloatArray, y: FloatArray, input_noise: float = 0.0, top: float = 15.0) -> Record:
    f = fft.rfftfreq(len(u), PERIOD)
    used = (f > 0.0) & (f <= top)
    U, Y = (fft.rfft(x - x.mean(), norm="ortho")[used] for x in (u, y))
    return Record(f[used], U, Y, None, True, np.full(used.sum(), input_noise), None, PERIOD, len(u) * PERIOD)


def periodic(u: FloatArray, y: FloatArray, periods: int, top: float = 15.0) -> Record:
    U, Y = (fft.rfft(x.reshape(periods, -1), axis=1, norm="ortho") for x in (u, y))
    points = len(u) // periods
    f = fft.rfftfreq(points, PERIOD)
    used = (f > 0.0) & (f <= top)
    spread = np.stack([U, Y])[:, :, used] / np.sqrt(periods)
    nothing = np.zeros(used.sum())
    return Record(f[used], U.mean(axis=0)[used], Y.mean(axis=0)[used], None, False, nothing, spread, PERIOD, len(u) * PERIOD)


LAG = 0.02


def lagged(u: FloatArray) -> FloatArray:
    """First-order lag, as an exact filter of the samples, from a past that the record does not show."""
    a = np.exp(-PERIOD / LAG)
    return np.asarray(signal.lfilter([1.0 - a], [1.0, -a], u))


def lag_response(f: FloatArray) -> FloatArray:
    a = np.exp(-PERIOD / LAG)
    return np.asarray((1.0 - a) / (1.0 - a * np.exp(-2j * np.pi * f * PERIOD)))


def coverage(make: Callable[[int], Record], seeds: int) -> tuple[float, FloatArray]:
    inside, errors = [], []
    for seed in range(seeds):
        for w in local_fit([make(seed)], 12.0):
            error = w.H - lag_response(np.array([w.f]))[0]
            inside.append(abs(error) < w.radius)
            errors.append(error / np.sqrt(w.variance))
    return float(np.mean(inside)), np.array(errors)


@pytest.mark.parametrize("colour", [0.0, 0.95])
@pytest.mark.parametrize("level", [0.03, 0.5])
def test_regions_hold_the_response_as_often_as_they_say(colour: float, level: float) -> None:
    def make(seed: int) -> Record:
        u = band(seed, 2500)
        return record(u[2000:], (lagged(u) + level * noise(seed, len(u), colour))[2000:])

    share, errors = coverage(make, 60)
    assert 0.93 < share < 0.97
    assert abs(np.mean(errors)) < 4.0 / np.sqrt(len(errors))


def test_regions_hold_it_with_whole_periods_as_well() -> None:
    def make(seed: int) -> Record:
        u = np.tile(np.random.default_rng(seed).standard_normal(800), 5)
        y = lagged(u) + 0.3 * noise(seed, len(u), 0.9)
        return periodic(u[800:], y[800:], 4)

    share, _ = coverage(make, 60)
    assert 0.93 < share < 0.97


def test_noise_of_the_input_does_not_pull_the_response_down() -> None:
    sums = np.zeros(2, dtype=complex)
    for seed in range(60):
        u = band(seed, 2000)[2000:]
        heard = u + 0.06 * noise(seed, len(u), 0.0)
        windows = local_fit([record(heard, u, 0.06**2)], 12.0)
        clear = [w for w in windows if w.clear and w.f < 8.0]
        assert all(w.input_noise < 0.1 for w in clear)
        sums += np.array([sum(w.H for w in clear), len(clear)])
    assert abs(sums[0] / sums[1] - 1.0) < 0.01


def test_frequencies_of_mere_noise_are_not_judged() -> None:
    u = band(3, 4000)[2000:]
    heard = u + 0.2 * noise(3, len(u), 0.0)
    windows = local_fit([record(heard, u, 0.2**2, 40.0)], 40.0)
    assert not any(w.clear for w in windows if w.f > 20.0)
    assert all(b.high < 20.0 for b in verdict(windows).bands)


def test_a_model_that_holds_is_said_to_hold_and_a_lag_is_seen() -> None:
    held, failed = 0, 0
    for seed in range(40):
        u = band(seed, 3000)[2000:]
        good = verdict(local_fit([record(u, u + 0.05 * noise(seed, len(u), 0.9))], 7.0))
        held += sum(b.says == "holds" for b in good.bands)
        failed += sum(b.says == "fails" for b in good.bands)
        bad = verdict(local_fit([record(u, lagged(u) + 0.05 * noise(seed, len(u), 0.9))], 7.0))
        # a lag of 20 ms is a tenth at 0.8 Hz
        assert bad.fails_from is not None
        assert 0.5 < bad.fails_from < 2.5
        assert bad.holds_to is None or bad.holds_to < 1.3
    assert failed <= 1
    assert held > 100


def test_quantile_of_the_circle() -> None:
    from scipy import stats

    for nu in (2.0, 6.0, 40.0):
        assert circular_quantile(nu) == pytest.approx(stats.f.ppf(0.95, 2, 2 * nu))


def test_periods_are_found_where_there_are_some() -> None:
    dt = 0.004
    t = np.arange(round(25.0 / dt)) * dt
    rng = np.random.default_rng(0)
    for period in (2.0, 5.003, 10.0 / 3.0):
        k = np.arange(1, 6)[:, None, None]
        q = np.sum(rng.normal(size=(5, 1, 3)) / k * np.sin(2 * np.pi * k * t[:, None] / period + rng.uniform(0, 6, (5, 1, 3))), 0)
        q += 1e-4 * rng.normal(size=q.shape)
        found = find_periods(q, dt, slice(0, len(t)))
        assert found is not None
        assert found.period == pytest.approx(period, abs=1e-3)
        assert found.count == int(25.0 / period) - 1
        cut = found.cut(q, dt)
        assert np.max(np.abs(cut - cut[0])) < 2e-3
    once = np.cumsum(np.cumsum(rng.normal(size=(len(t), 3)), axis=0), axis=0)
    assert find_periods(once / np.std(once), dt, slice(0, len(t))) is None
    assert find_periods(np.sin(2 * np.pi * t[:, None] / 20.0), dt, slice(0, len(t))) is None
    assert find_periods(np.zeros((len(t), 2)), dt, slice(0, len(t))) is None


def test_bridges_run_straight_over_rests() -> None:
    x = np.linspace(0.0, 1.0, 101)[:, None]
    broken = x.copy()
    broken[40:60] = 7.0
    assert np.max(np.abs(bridged(broken, np.array([[40.0, 60.0]])) - x)) < 0.03


def test_distortion_is_told_from_noise() -> None:
    alarms = 0
    for seed in range(60):
        u = np.tile(band(seed, 1000)[2000:], 4)
        linear = periodic(u, lagged(np.tile(u, 2))[len(u) :] + 0.1 * noise(seed, len(u), 0.9), 4)
        found = distortion([linear], local_fit([linear], 7.0))
        assert found is not None
        alarms += found.found
        bent = periodic(u, u + 3.0 * u**3 + 0.1 * noise(seed, len(u), 0.9), 4)
        seen = distortion([bent], local_fit([bent], 7.0))
        assert seen is not None
        assert seen.found
        assert seen.nonlinear > 3.0 * found.nonlinear
    assert alarms <= 4


def test_even_and_odd_harmonics_tell_the_kind_of_distortion() -> None:
    t = np.arange(1000) * PERIOD
    lines = np.array([3, 5, 9, 11, 15, 17])
    rng = np.random.default_rng(2)
    u = np.tile(np.sum(np.sin(2 * np.pi * np.outer(lines, t) / 10.0 + rng.uniform(0, 6, 6)[:, None]), axis=0), 4)
    asked = np.zeros(150)
    asked[lines - 1] = 1.0
    for kind, even in ((2, True), (3, False)):
        r = periodic(u, u + 0.1 * u**kind + 0.01 * noise(1, len(u), 0.0), 4)
        found = distortion([r], local_fit([r], 2.2), asked)
        assert found is not None
        assert found.even is not None
        assert found.odd is not None
        assert (found.even > 3.0 * found.odd) == even


@pytest.mark.slow
def test_parameters_are_in_their_intervals_as_often_as_they_say() -> None:
    inside: dict[str, list[bool]] = {"delay": [], "low_pass": [], "gain": []}
    named = dict.fromkeys(inside, 0)
    for seed in range(30):
        u = band(seed, 3000)
        f = fft.rfftfreq(len(u), PERIOD)
        truths = {"delay": 0.013, "low_pass": 9.0, "gain": 1.07}
        shapes = {
            "delay": np.exp(-2j * np.pi * f * 0.013),
            "low_pass": 1.0 / (1.0 + 1j * f / 9.0),
            "gain": np.full(len(f), 1.07),
        }
        for name, H in shapes.items():
            y = fft.irfft(fft.rfft(u) * H, len(u)) + 0.1 * noise(seed, len(u), 0.9)
            r = record(u[1500:4500], y[1500:4500])
            cause = find_cause([r], local_fit([r], 10.0))
            assert cause is not None
            if cause.name == name and len(cause.parameters) == 1:
                named[name] += 1
                p = cause.parameters[0]
                inside[name].append(p.low <= truths[name] <= p.high)
    for name, hits in inside.items():
        assert named[name] > 26, name
        assert np.mean(hits) >= 0.85, name
