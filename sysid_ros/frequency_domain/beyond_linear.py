"""What no linear response explains: distortion, and dry friction that the model lacks.

Whole periods tell noise, which changes from one to the next, from distortion, which does not. Dry friction that is missing looks
like other causes, so it is looked for before them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.frequency_domain.causes import Cause
from sysid_ros.frequency_domain.lines import Record
from sysid_ros.frequency_domain.local_fit import Window
from sysid_ros.frequency_domain.stretches import Stretch
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.robot.smoothed_sign import SLIDE, TURNS, smoothed_sign
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class Distortion:
    """What repeats itself from period to period and no smooth response explains (Pintelon, Schoukens 2012, section 4.3).

    Attributes:
        noise, nonlinear: root mean square over the band that is judged, of a period [N m]. p_value: of an F test of the misfit's
            power against that of the noise, were all of it noise. periods: that were compared.
        even, odd: root mean square of the measured torque on lines that are not excited, by the parity of the harmonic [N m];
            None where there are no such lines.
    """

    noise: float
    nonlinear: float
    p_value: float
    periods: int
    even: float | None
    odd: float | None

    @property
    def found(self) -> bool:
        """Whether more than chance repeats itself."""
        return self.p_value < TOLERANCES.sure


def distortion(
    records: Sequence[Record], windows: Sequence[Window], positions: FloatArray | None = None, cause: Cause | None = None
) -> Distortion | None:
    """Distortion of one channel; None where no record is periodic.

    Args:
        cause: what explains the response; a narrow resonance may be followed by it and not by the windows.
        positions: power of the position's harmonics on the lines of the first periodic record, shape (K,), where it is known.
    """
    from scipy import stats

    repeated = [(i, r) for i, r in enumerate(records) if r.spread is not None]
    if not repeated:
        return None
    misfit, freedom, noise, free, lines = 0.0, 0.0, 0.0, 0.0, 0
    for window in windows:
        here = sum(len(window.lines[i]) for i, _ in repeated)
        if not window.clear or here != sum(len(k) for k in window.lines) or not here:
            continue
        by_cause = _left(records, window, cause)
        if by_cause / here < window.noise:
            misfit, freedom = misfit + by_cause, freedom + here
        else:
            misfit, freedom = misfit + window.noise * window.freedom, freedom + window.freedom
        lines += here
        for i, record in repeated:
            power, count = _noise(record, window, i, cause)
            noise, free = noise + power, free + count
    if freedom < 3.0 or free < 3.0:
        return None
    whole, by_noise = misfit / freedom, noise / free
    p = float(stats.f.sf(whole / max(by_noise, 1e-300), 2.0 * freedom, 2.0 * free))
    # two sides of the spectrum, of a transform whose sum of squares is that of the samples
    record = repeated[0][1]
    assert record.spread is not None
    periods = record.spread.shape[1]
    points = record.seconds / periods / record.period
    scale = 2.0 * lines / points
    even, odd = _between(record, positions, by_noise)
    return Distortion(
        float(np.sqrt(scale * by_noise * periods)),
        float(np.sqrt(scale * max(whole - by_noise, 0.0))),
        p,
        periods,
        even,
        odd,
    )


def _left(records: Sequence[Record], window: Window, cause: Cause | None) -> float:
    """Sum of |Y - H U|^2 over a window's lines with the cause's H; infinite without one, and beside dry friction."""
    if cause is None or any(r.D is not None for r in records):
        return np.inf
    total = 0.0
    for record, here in zip(records, window.lines, strict=True):
        total += float(np.sum(np.abs(record.Y[here] - cause.H(record.f[here]) * record.U[here]) ** 2))
    return total


def _noise(record: Record, window: Window, which: int, cause: Cause | None) -> tuple[float, float]:
    """Sum of |noise of the mean|^2 over a window's lines with its degrees of freedom, from the spread of the periods."""
    assert record.spread is not None
    here = window.lines[which]
    U, Y = record.spread[:, :, here]
    rest = Y - (window.H if cause is None else cause.H(record.f[here])) * U
    rest = rest - rest.mean(axis=0)
    return float(np.sum(np.abs(rest) ** 2)), float((len(rest) - 1) * rest.shape[1])


def _between(record: Record, positions: FloatArray | None, noise: float) -> tuple[float | None, float | None]:
    """Measured torque on harmonics that no joint was asked to make."""
    if positions is None:
        return None, None
    excited = positions > TOLERANCES.harmonic * positions.max()
    last = int(np.flatnonzero(excited)[-1])
    order = np.arange(1, len(excited) + 1)
    spare = ~excited & (order <= last + 1)
    if spare.sum() < 2:
        return None, None
    assert record.spread is not None
    points = record.seconds / record.spread.shape[1] / record.period
    power = np.abs(record.Y) ** 2
    out: list[float | None] = []
    for parity in (0, 1):
        own = spare & (order % 2 == parity)
        level = float(np.sum(power[own] - noise)) if own.any() else None
        out.append(None if level is None else float(np.sqrt(max(2.0 * level / points, 0.0))))
    return out[0], out[1]


@dataclass(frozen=True, slots=True)
class MissingFriction:
    """``tau_measured - tau_model = Fc sign(v) + b v + offset + g tau_model - d dtau_model/dt + e d2tau_model/dt2``.

    The last three are what a gain, a delay and a spring do at first, and keep them from being taken for friction.

    Attributes:
        coulomb, viscous: Fc [N m], b [N m s/rad]. part: of the misfit's power that both explain.
    """

    coulomb: float
    viscous: float
    part: float


def missing_friction(stretches: Sequence[Stretch], joint: int) -> MissingFriction | None:
    """Dry friction that the model lacks on a joint, by least squares while it moves; None where it is nothing to speak of."""
    rest, speed, torque, others = [], [], [], []
    prismatic = bool(stretches[0].motion.robot.is_prismatic[joint])
    for stretch in stretches:
        motion = stretch.motion
        whole, _, _ = stretch.rests(joint)
        rest.append((motion.tau[:, joint] - stretch.model[:, joint])[whole])
        speed.append(motion.v[whole, joint])
        torque.append(motion.tau[whole, joint])
        model = stretch.smooth[:, joint]
        rate = motion.rate_of(model)
        others.append(np.stack([model, rate, motion.rate_of(rate)], axis=1)[whole])
    e, v = np.concatenate(rest), np.concatenate(speed)
    if len(e) < 50:
        return None
    turns = TURNS * (SLIDE if prismatic else 1.0)
    beside = np.column_stack([np.ones_like(v), np.concatenate(others)])
    columns = np.column_stack([smoothed_sign(v, turns), v, beside])
    theta, left = _least_squares(columns, e)
    power = max(float(np.sum((e - e.mean()) ** 2)), 1e-300)
    dry, both = ((_least_squares(columns[:, first:], e)[1] - left) / power for first in (1, 2))
    size = float(np.sqrt(np.mean(np.concatenate(torque) ** 2)))
    named = dry > TOLERANCES.friction or (dry > TOLERANCES.some_friction and both > TOLERANCES.all_friction and theta[1] > 0.0)
    return MissingFriction(float(theta[0]), float(theta[1]), both) if named and theta[0] > TOLERANCES.notable * size else None


def _least_squares(columns: FloatArray, e: FloatArray) -> tuple[FloatArray, float]:
    """Parameters and sum of squares that is left."""
    size = np.maximum(np.sqrt(np.sum(columns**2, axis=0)), 1e-300)
    theta = np.linalg.lstsq(columns / size, e, rcond=None)[0] / size
    return theta, float(np.sum((e - columns @ theta) ** 2))
