"""Oscillations in the motion of a joint that the rigid model lacks, by a state-space model of torque and velocity."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sysid_ros.blackbox.blocks import blocks_of, drawn_near, prediction_error
from sysid_ros.blackbox.moments import Moments
from sysid_ros.blackbox.series import Series
from sysid_ros.blackbox.state_space import StateSpace
from sysid_ros.frequency_domain.linearised import Linearised
from sysid_ros.frequency_domain.lines import ComplexArray
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray

_PAST = 0.5
"""Length of the past that predicts [s], and its bounds in samples."""
_STEPS = (12, 30)
_HIGHEST_ORDER = 8
_BLOCKS = 32
_FOLDS = 4
_DRAWS = 100


@dataclass(frozen=True, slots=True)
class Mode:
    """A pair of poles, or of zeros, of torque to velocity.

    Attributes:
        kind: "pole" or "zero". frequency, frequency_std: undamped [Hz]. damping, damping_std: relative. found_again: part of the
            redrawn data that has it. unmodelled: the rigid model lacks it, and it is no accident of the data.
    """

    kind: str
    frequency: float
    frequency_std: float
    damping: float
    damping_std: float
    found_again: float
    unmodelled: bool


@dataclass(frozen=True, eq=False)
class Modes:
    """The state-space check of one joint.

    Attributes:
        order: of the model of H, see :mod:`.linearised`; 0 where the rigid model needs nothing more.
        singular_values: of past to future, over the largest. errors: held-out error of prediction for orders 0, 1, 2, ..., over
            that of the first.
        modes: pairs in the band. rigid: poles of the rigid model [1/s]. poles: all from torque to velocity: those of the rigid
            model and what comes to them [1/s].
        small: the motion was small about the posture. band: [Hz].
    """

    order: int
    singular_values: FloatArray
    errors: FloatArray
    modes: tuple[Mode, ...]
    rigid: ComplexArray
    poles: ComplexArray
    small: bool
    band: tuple[float, float]

    @property
    def unmodelled(self) -> tuple[Mode, ...]:
        """Modes that the rigid model lacks."""
        return tuple(m for m in self.modes if m.unmodelled)


def find_modes(signals: Linearised, low_hz: float, top_hz: float, seed: int = 0) -> Modes | None:
    """Modes of a joint; None where the recording is too short for blocks.

    An encoder on the link's side sees the link's motion, from which the torque follows only a step ahead: where the first search
    finds nothing, a second one gives the measured torque a step.
    """
    first = _find(signals, low_hz, top_hz, seed)
    if first is None or first.unmodelled:
        return first
    later = replace(signals, u=tuple(u[1:] for u in signals.u), y=tuple(y[:-1] for y in signals.y))
    second = _find(later, low_hz, top_hz, seed)
    return second if second is not None and second.unmodelled else first


def _find(signals: Linearised, low_hz: float, top_hz: float, seed: int) -> Modes | None:
    """The model whose order predicts held-out blocks best, its modes, and their spread over blocks drawn again from their
    neighbours (local block bootstrap, Paparoditis, Politis 2002).
    """
    p = int(np.clip(_PAST / signals.period, *_STEPS))
    moments = Moments(p)
    series = [Series(u[:, None], y[:, None], signals.period) for u, y in zip(signals.u, signals.y, strict=True)]
    blocks, pieces = blocks_of(series, moments, _BLOCKS)
    if len(blocks) < 2 * _FOLDS:
        return None
    orders = list(range(_HIGHEST_ORDER + 1))
    errors = np.zeros((_FOLDS, len(orders)))
    for fold in range(_FOLDS):
        own = np.arange(len(blocks)) % _FOLDS == fold
        found = moments.models(blocks[~own].sum(axis=0), orders, signals.period)
        held = [piece for piece, here in zip(pieces, own, strict=True) if here]
        errors[fold] = [prediction_error(model, held, p) for model, _ in found]
    total = errors.sum(axis=0)
    best = int(np.argmin(total))
    # within one standard error of the best the smallest order is taken (Breiman et al. 1984)
    order = best
    for i in range(best):
        apart = errors[:, i] - errors[:, best]
        if apart.sum() < max(np.std(apart) * np.sqrt(_FOLDS), 0.01 * total[best]):
            order = i
            break
    n = orders[order]
    G = blocks.sum(axis=0)
    model, values = moments.model(G, n, signals.period)
    rng = np.random.default_rng(seed)
    drawn = [moments.model(blocks[drawn_near(len(blocks), rng)].sum(axis=0), n, signals.period)[0] for _ in range(_DRAWS)]
    rigid = signals.rigid_poles
    features, again = _features(model, low_hz, top_hz), [_features(m, 0.5 * low_hz, 2.0 * top_hz) for m in drawn]
    poles = np.concatenate([rigid, model.zeros])
    modes = tuple(_mode(kind, pole, again) for kind, pole in features)
    return Modes(n, values / values[0], total / total[0], modes, rigid, poles, signals.small, (low_hz, top_hz))


def _features(model: StateSpace, low_hz: float, top_hz: float) -> list[tuple[str, complex]]:
    """Lightly damped poles and zeros of torque to velocity in a band, without those that cancel."""
    out = []
    # the response of the measured torque to the model's is the inverse
    sets = {"pole": model.zeros, "zero": model.poles}
    for kind, values in sets.items():
        others = sets["zero" if kind == "pole" else "pole"]
        for value in values[values.imag > 0.0]:
            f, damping = abs(value) / (2.0 * np.pi), -value.real / abs(value)
            cancelled = bool(np.any(np.abs(others - value) < TOLERANCES.cancels * abs(value)))
            if low_hz <= f <= top_hz and abs(damping) < TOLERANCES.light and not cancelled:
                out.append((kind, complex(value)))
    return out


def _mode(kind: str, value: complex, again: list[list[tuple[str, complex]]]) -> Mode:
    f = abs(value) / (2.0 * np.pi)
    near = []
    for features in again:
        own = [x for k, x in features if k == kind]
        if own:
            closest = min(own, key=lambda x: abs(x - value))
            if abs(abs(closest) - abs(value)) < TOLERANCES.same * abs(value):
                near.append(closest)
    found = len(near) / len(again)
    frequencies, dampings = np.abs(near) / (2.0 * np.pi), [-x.real / abs(x) for x in near]
    f_std = float(np.std(frequencies)) if len(near) > 2 else float("inf")
    d_std = float(np.std(dampings)) if len(near) > 2 else float("inf")
    return Mode(
        kind,
        float(f),
        f_std,
        float(-value.real / abs(value)),
        d_std,
        found,
        found >= TOLERANCES.often and f_std < TOLERANCES.mode_std * f,
    )
