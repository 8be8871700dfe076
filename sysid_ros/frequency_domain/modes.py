"""Oscillations in the motion of a joint that the rigid model lacks, by a state-space model of torque and velocity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid_ros.blackbox.blocks import blocks_of, drawn_near
from sysid_ros.blackbox.mode_spread import same_mode
from sysid_ros.blackbox.moments import Moments
from sysid_ros.blackbox.series import Series
from sysid_ros.blackbox.state_space import StateSpace
from sysid_ros.blackbox.subspace import choose_order
from sysid_ros.frequency_domain.linearised import Linearised
from sysid_ros.frequency_domain.lines import ComplexArray
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray

_PAST = 0.5
"""Length of the past that predicts [s], and its bounds in samples."""
_STEPS = (12, 30)
_HIGHEST_ORDER = 8
HIGHEST = 12
"""Orders of the models that are asked for, or looked at beside each other."""
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


@dataclass(frozen=True, slots=True)
class StablePair:
    """A pair that the model of one order has, of any damping below the bound of a mode.

    Attributes:
        order: of the model of H. kind: "pole" or "zero". frequency: [Hz]. damping: relative.
        stays: the model of one order less has it with a frequency within 1 % and a damping within 5 % (Peeters, De Roeck 1999).
    """

    order: int
    kind: str
    frequency: float
    damping: float
    stays: bool


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
        stabilisation: pairs of models of all orders, as the order grows.
    """

    order: int
    singular_values: FloatArray
    errors: FloatArray
    modes: tuple[Mode, ...]
    rigid: ComplexArray
    poles: ComplexArray
    small: bool
    band: tuple[float, float]
    stabilisation: tuple[StablePair, ...] = ()

    @property
    def unmodelled(self) -> tuple[Mode, ...]:
        """Modes that the rigid model lacks."""
        return tuple(m for m in self.modes if m.unmodelled)


def find_modes(signals: Linearised, low_hz: float, top_hz: float, seed: int = 0, order: int | None = None) -> Modes | None:
    """Modes of a joint; None where the recording is too short for blocks.

    Args:
        order: of the model of H; None for the one that predicts held-out blocks best.

    An encoder on the link's side sees the link's motion, from which the torque follows only a step ahead: where the first search
    finds nothing, a second one gives the measured torque a step.
    """
    first = _find(signals, low_hz, top_hz, seed, order)
    if first is None or first.unmodelled:
        return first
    later = replace(signals, u=tuple(u[1:] for u in signals.u), y=tuple(y[:-1] for y in signals.y))
    second = _find(later, low_hz, top_hz, seed, order)
    return second if second is not None and second.unmodelled else first


def _find(signals: Linearised, low_hz: float, top_hz: float, seed: int, wanted: int | None) -> Modes | None:
    """The model whose order predicts held-out blocks best, its modes, and their spread over blocks drawn again from their
    neighbours (local block bootstrap, Paparoditis, Politis 2002).
    """
    p = int(np.clip(_PAST / signals.period, *_STEPS))
    moments = Moments(p)
    series = [Series(u[:, None], y[:, None], signals.period) for u, y in zip(signals.u, signals.y, strict=True)]
    blocks, pieces = blocks_of(series, moments, _BLOCKS)
    if len(blocks) < 2 * _FOLDS:
        return None
    choice = choose_order(moments, blocks, pieces, range(_HIGHEST_ORDER + 1), signals.period)
    n = choice.chosen["heldout"] if wanted is None else wanted
    G = blocks.sum(axis=0)
    model, values = moments.model(G, n, signals.period)
    rng = np.random.default_rng(seed)
    drawn = [moments.model(blocks[drawn_near(len(blocks), rng)].sum(axis=0), n, signals.period)[0] for _ in range(_DRAWS)]
    rigid = signals.rigid_poles
    features, again = _features(model, low_hz, top_hz), [_features(m, 0.5 * low_hz, 2.0 * top_hz) for m in drawn]
    poles = np.concatenate([rigid, model.zeros])
    modes = tuple(_mode(kind, pole, again) for kind, pole in features)
    stable = _stabilisation(moments.models(G, range(1, HIGHEST + 1), signals.period), low_hz, top_hz)
    return Modes(n, values / values[0], choice.heldout, modes, rigid, poles, signals.small, (low_hz, top_hz), stable)


def _stabilisation(models: Sequence[tuple[StateSpace, FloatArray]], low_hz: float, top_hz: float) -> tuple[StablePair, ...]:
    """Pairs of models of order 1, 2, ... and whether the order before has them."""
    out: list[StablePair] = []
    before: list[tuple[str, complex]] = []
    for order, (model, _) in enumerate(models, start=1):
        pairs = _features(model, low_hz, top_hz)
        for kind, value in pairs:
            own = [x for k, x in before if k == kind]
            last = min(own, key=lambda x: abs(x - value), default=None)
            stays = last is not None and same_mode(_frequency(last), _damping(last), _frequency(value), _damping(value))
            out.append(StablePair(order, kind, _frequency(value), _damping(value), stays))
        before = pairs
    return tuple(out)


def _frequency(pole: complex) -> float:
    return float(abs(pole) / (2.0 * np.pi))


def _damping(pole: complex) -> float:
    return float(-pole.real / abs(pole))


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
