"""How sure the modes of a subspace model are: by blocks drawn again, and by whether they stay as the order grows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from sysid_ros.blackbox.moments import Moments
from sysid_ros.blackbox.state_space import ComplexArray, ModalPair
from sysid_ros.blackbox.subspace import Subspace
from sysid_ros.sample import FloatArray

_DRAWS = 200
_LEVEL = 0.95
_SAME = 0.3
"""Part of its frequency within which a redrawn pole is that of a mode."""
_STAYS_F, _STAYS_DAMPING, _STAYS_SHAPE = 0.01, 0.05, 0.98
"""From one order to the next a mode stays where frequency and damping change by less than these parts and the modal assurance
criterion of its shape is above this (Peeters, De Roeck 1999: 1 %, 5 %, 2 %)."""


@dataclass(frozen=True, slots=True)
class ModeEstimate:
    """A mode with the spread of its frequency and its damping.

    Attributes:
        frequency, damping: undamped [Hz] and relative. frequency_std, damping_std; frequency_ci95, damping_ci95: from redrawn
            blocks; None where it was found again in too few of them. found_again: part of the draws that have it.
        shape: of the outputs, shape (p,), complex, the largest 1.
    """

    frequency: float
    damping: float
    frequency_std: float | None
    damping_std: float | None
    frequency_ci95: tuple[float, float] | None
    damping_ci95: tuple[float, float] | None
    found_again: float
    shape: ComplexArray


@dataclass(frozen=True, slots=True)
class StableMode:
    """A mode of one order of a stabilisation diagram.

    Attributes:
        order: of the model. pair: the mode. frequency_stays, damping_stays, shape_stays: whether the next lower order has it.
    """

    order: int
    pair: ModalPair
    frequency_stays: bool
    damping_stays: bool
    shape_stays: bool

    @property
    def stays(self) -> bool:
        """In all three."""
        return self.frequency_stays and self.damping_stays and self.shape_stays


def mode_estimates(model: Subspace, draws: int = _DRAWS, seed: int = 0, light: float = 0.7) -> list[ModeEstimate]:
    """Modes of a fitted model with intervals by the bootstrap over its blocks, each of which has a weight of its own in a draw.

    The weights are those of Rubin's Bayesian bootstrap (1981): no block is ever lost, so that short recordings do not break. The
    interval is that of Student's t with the blocks' degrees of freedom about the estimate, of the logarithm for the damping.
    """
    moments, blocks, own = model.moments, model.blocks, model.as_state_space()
    assert moments is not None
    rng, count = np.random.default_rng(seed), len(blocks)
    found: list[list[ModalPair]] = []
    for _ in range(draws if count > 1 else 0):
        weights = rng.dirichlet(np.ones(count)) * count
        drawn, _ = moments.model(np.tensordot(weights, blocks, axes=1), own.order, own.period)
        found.append(drawn.modes(light=1.0))
    return [_estimate(pair, found, count) for pair in own.modes(light=light)]


def _estimate(pair: ModalPair, found: Sequence[Sequence[ModalPair]], blocks: int) -> ModeEstimate:
    near = []
    for pairs in found:
        best = min(pairs, key=lambda x: abs(x.pole - pair.pole), default=None)
        if best is not None and abs(best.frequency - pair.frequency) < _SAME * pair.frequency:
            near.append(best)
    again = len(near) / max(len(found), 1)
    if len(near) < max(3, 0.5 * len(found)):
        return ModeEstimate(pair.frequency, pair.damping, None, None, None, None, again, pair.shape)
    # a variance over weights that sum up is that over blocks times (count - 1) / count twice over
    wide = np.sqrt((blocks + 1.0) / max(blocks - 1.0, 1.0))
    t = float(stats.t.ppf(0.5 + 0.5 * _LEVEL, max(blocks - 1, 1)))
    f = wide * float(np.std([x.frequency for x in near], ddof=1))
    d = wide * float(np.std([x.damping for x in near], ddof=1))
    factor = np.exp(t * d / max(abs(pair.damping), 1e-12))
    ends = sorted((pair.damping / factor, pair.damping * factor))
    return ModeEstimate(
        pair.frequency,
        pair.damping,
        f,
        d,
        (pair.frequency - t * f, pair.frequency + t * f),
        (float(ends[0]), float(ends[1])),
        again,
        pair.shape,
    )


def stabilisation(moments: Moments, G: FloatArray, orders: Sequence[int], period: float, light: float = 0.3) -> list[StableMode]:
    """Modes of models of growing order, and which of them stay (stabilisation diagram).

    Args:
        G: moments. orders: in growing order. light: relative damping of the modes that are kept.
    """
    out: list[StableMode] = []
    before: list[ModalPair] = []
    for order, (model, _) in zip(orders, moments.models(G, orders, period), strict=True):
        pairs = [p for p in model.modes(light=light) if p.damping > 0.0]
        out += [_stays(order, pair, before) for pair in pairs]
        before = pairs
    return out


def _stays(order: int, pair: ModalPair, before: Sequence[ModalPair]) -> StableMode:
    last = min(before, key=lambda x: abs(x.frequency - pair.frequency), default=None)
    if last is None:
        return StableMode(order, pair, False, False, False)
    f = _near(last.frequency, pair.frequency, _STAYS_F)
    return StableMode(
        order, pair, f, _near(last.damping, pair.damping, _STAYS_DAMPING), assurance(last.shape, pair.shape) > _STAYS_SHAPE
    )


def same_mode(f: float, damping: float, other_f: float, other_damping: float) -> bool:
    """Whether frequencies and dampings of models of neighbouring orders are of one mode."""
    return _near(f, other_f, _STAYS_F) and _near(damping, other_damping, _STAYS_DAMPING)


def _near(a: float, b: float, part: float) -> bool:
    return bool(abs(a - b) < part * abs(b))


def assurance(a: ComplexArray, b: ComplexArray) -> float:
    """Modal assurance criterion of two shapes, from 0 to 1 (Allemang, Brown 1982)."""
    size = float(np.real(np.vdot(a, a)) * np.real(np.vdot(b, b)))
    return float(abs(np.vdot(a, b)) ** 2 / size) if size > 0.0 else 0.0
