"""Lines: input and output of one joint in the frequency domain, record after record; Periods: what of a motion repeats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, interpolate

from sysid_ros.frequency_domain.stretches import Stretch
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray

_TREND = 4


@dataclass(frozen=True, slots=True)
class Periods:
    """A periodic part of a motion.

    Attributes:
        first: index where it begins. period: T [s]. count: whole periods in it.
    """

    first: int
    period: float
    count: int

    def cut(self, x: FloatArray, grid_period: float) -> FloatArray:
        """The periods of channels (N, ...) one by one, on M points each, shape (count, M, ...): what a Fourier series needs."""
        points = round(self.period / grid_period)
        span = int(np.ceil(self.count * self.period / grid_period)) + 2
        here = x[self.first : self.first + span]
        at = np.arange(self.count * points) * (self.period / points / grid_period)
        even = interpolate.CubicSpline(np.arange(len(here)), here, axis=0)(np.minimum(at, len(here) - 1.0))
        return np.asarray(even.reshape(self.count, points, *x.shape[1:]))


def find_periods(q: FloatArray, grid_period: float, moving: slice) -> Periods | None:
    """Whole periods of the positions (N, n) in the part where joints move; None where it does not repeat itself twice.

    Mean square difference of the motion from itself a lag later, over all joints, by correlation; its first deep minimum is the
    period, refined by a parabola. Where there are three periods or more the first is left to the transient.
    """
    x = q[moving] - q[moving].mean(axis=0)
    count = len(x)
    if count * grid_period < 2.0 * TOLERANCES.shortest_period:
        return None
    size = fft.next_fast_len(2 * count, real=True)
    correlation = fft.irfft(np.sum(np.abs(fft.rfft(x, size, axis=0)) ** 2, axis=1), size)[:count]
    power = np.concatenate([[0.0], np.cumsum(np.sum(x**2, axis=1))])
    lags = np.arange(count // 2 + 2)
    both = (power[count] - power[lags]) + power[count - lags]
    difference = np.maximum(both - 2.0 * correlation[lags], 0.0) / np.maximum(both, 1e-30)
    left = np.flatnonzero(difference > TOLERANCES.leaves)
    if not left.size:
        return None
    first = max(int(left[0]), int(TOLERANCES.shortest_period / grid_period))
    deep = np.flatnonzero(difference[first:] < TOLERANCES.repeats) + first
    if not deep.size:
        return None
    # up to where the valley rises again
    out_of = np.flatnonzero(difference[deep[0] :] > 2.0 * TOLERANCES.repeats)
    valley = slice(int(deep[0]), int(deep[0] + out_of[0]) if out_of.size else len(difference))
    best = valley.start + int(np.argmin(difference[valley]))
    lag = float(best)
    if 0 < best < len(difference) - 1:
        a, b, c = difference[best - 1 : best + 2]
        if a + c - 2.0 * b > 0.0:
            lag += 0.5 * (a - c) / (a + c - 2.0 * b)
    periods = int((count + 1.5) / lag)
    if periods < 2:
        return None
    skipped = 1 if periods > 2 else 0
    begin = moving.start + round(skipped * lag)
    return Periods(begin, lag * grid_period, periods - skipped)


def bridged(values: FloatArray, standing: FloatArray) -> FloatArray:
    """Channels (N, c) with straight lines over the rests of a joint, where dry friction leaves its torque undetermined.

    Args:
        standing: (first, end) of each rest, shape (r, 2).
    """
    out = values.copy()
    for a, b in standing.astype(int):
        if a > 0 and b < len(values):
            before = values[max(a - _TREND, 0) : a].mean(axis=0)
            after = values[b : b + _TREND].mean(axis=0)
            part = (np.arange(1, b - a + 1) / (b - a + 1.0))[:, None]
            out[a:b] = (1.0 - part) * before + part * after
    return out


ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Record:
    """Lines of one stretch (or of its periodic part) of one joint, ``Y = H U + Hd D + T + noise``.

    Attributes:
        f: frequencies, ascending, without 0, shape (K,) [Hz]. U, Y: orthonormal transforms, shape (K,).
        transient: whether T, smooth in f, stands for what begins before and ends after the record (Pintelon, Schoukens 2012,
            section 6.3.2); of whole periods there is none.
        D: of the model's dry friction, which is no part of U: where the velocity changes its sign no model is right, and D has
            responses Hd of its own, so that H is not blamed for it, shape (K, c); None where the model has none.
        input_noise: E|noise of U|^2, shape (K,).
        spread: of whole periods: U and Y of each, over sqrt(periods), shape (2, P, K); else None.
        period: of the grid [s]. seconds: that the record covers.
    """

    f: FloatArray
    U: ComplexArray
    Y: ComplexArray
    D: ComplexArray | None
    transient: bool
    input_noise: FloatArray
    spread: ComplexArray | None
    period: float
    seconds: float

    @property
    def spacing(self) -> float:
        """Of the lines [Hz]."""
        return (1.0 if self.spread is None else self.spread.shape[1]) / self.seconds


@dataclass(frozen=True, slots=True)
class Channel:
    """What goes in and what comes out, of one stretch: shapes (N,), noise of the input as a function of f (K,) -> (K,).

    ``dry`` is what the input may have of dry friction, shape (N, c), the model's own in the first column, or None.
    """

    model: FloatArray
    measured: FloatArray
    noise: Callable[[FloatArray], FloatArray]
    dry: FloatArray | None = None


def joint_records(
    stretches: Sequence[Stretch], joint: int, channels: Sequence[Channel], top_hz: float, bridge: bool = True
) -> list[Record]:
    """Records of one joint; stretches in which it hardly moves are left out.

    Args:
        channels: of the joint, one a stretch. top_hz: lines above are left out. bridge: whether dry friction may hide the output.
    """
    out = []
    for stretch, channel in zip(stretches, channels, strict=True):
        whole, still, part = stretch.rests(joint)
        if not stretch.tells(whole, part):
            continue
        dry = np.zeros((len(channel.model), 1)) if channel.dry is None else channel.dry
        both = np.column_stack([channel.model, channel.measured, dry])
        periods = find_periods(stretch.motion.q, stretch.period, _all_moving(stretch))
        if bridge:
            both[whole, 1] = _without_stiction(both[whole, :2], still)
        both[:, 0] -= dry[:, 0]
        if periods is not None:
            out.append(_periodic(both, periods, stretch, channel, top_hz))
            continue
        count = whole.stop - whole.start
        spectrum = fft.rfft(both[whole.start : whole.start + count] - both[whole].mean(axis=0), axis=0, norm="ortho")
        f = fft.rfftfreq(count, stretch.period)
        used = (f > 0.0) & (f <= top_hz)
        out.append(
            Record(
                f[used],
                spectrum[used, 0],
                spectrum[used, 1],
                spectrum[used, 2:] if dry.any() else None,
                True,
                channel.noise(f[used]),
                None,
                stretch.period,
                count * stretch.period,
            )
        )
    return out


def cleaned_torque(stretch: Stretch, joint: int) -> FloatArray:
    """Measured torque of a joint, shape (N,), without what dry friction makes of its rests, as in :func:`joint_records`."""
    whole, still, _ = stretch.rests(joint)
    both = np.stack([stretch.model[:, joint], stretch.motion.tau[:, joint]], axis=1)
    both[whole, 1] = _without_stiction(both[whole], still)
    return np.asarray(both[:, 1])


def _without_stiction(both: FloatArray, still: FloatArray) -> FloatArray:
    """Measured torque, shape (N,), whose difference from the model's runs straight over the rests of the joint.

    Only where the rests disagree clearly more with the model than the motion does: else there is no dry friction to hide.
    """
    rest = both[:, 1] - both[:, 0]
    straight = bridged(rest[:, None], still)[:, 0]
    at_rest = np.zeros(len(rest), dtype=bool)
    for a, b in still.astype(int):
        at_rest[a:b] = True
    if not at_rest.any():
        return np.asarray(both[:, 1])
    moving = rest[~at_rest]
    hidden = np.mean((rest[at_rest] - moving.mean()) ** 2) > TOLERANCES.stiction * np.var(moving)
    return np.asarray(both[:, 0] + (straight if hidden else rest))


def _all_moving(stretch: Stretch) -> slice:
    spans = [s for s in (stretch.rests(j)[0] for j in range(stretch.motion.robot.n)) if s.stop > s.start]
    return slice(min((s.start for s in spans), default=0), max((s.stop for s in spans), default=0))


def _periodic(both: FloatArray, periods: Periods, stretch: Stretch, channel: Channel, top_hz: float) -> Record:
    """Lines of the mean period: noise of both sides, also what is correlated between them, falls with their number."""
    cut = periods.cut(both, stretch.period)
    points = cut.shape[1]
    step = periods.period / points
    spectra = np.moveaxis(fft.rfft(cut - cut.mean(axis=(0, 1)), axis=1, norm="ortho"), 2, 0)
    f = fft.rfftfreq(points, step)
    used = (f > 0.0) & (f <= top_hz)
    root = np.sqrt(periods.count)
    spread = spectra[:2, :, used] / root
    # as if the mean period were a record of its own
    U, Y, *D = spectra.mean(axis=1)[:, used]
    return Record(
        f[used],
        U,
        Y,
        np.stack(D, axis=1) if cut[..., 2].any() else None,
        False,
        channel.noise(f[used]) / periods.count,
        spread,
        step,
        periods.count * periods.period,
    )
