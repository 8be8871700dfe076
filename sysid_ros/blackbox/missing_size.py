"""How large what a model lacks is, and not only what a black box can predict of it: what is left, less what is noise.

What is left of a joint's torque is taken for a sum of independent parts, whose sizes are those of the largest restricted likelihood:
functions of the motion, one part a kind, with random coefficients (what a ridge regression assumes); white noise; noise that is
remembered for some time; and what comes with the motion without being any of these functions (a ringing, a rattle), as far as
it is absent while the robot stands. There the torque has noise and, for dry friction, an unknown constant, and nothing else. A ridge
predicts too little of what is there, as it shrinks; the power of the parts of noise has no such bias, and an interval.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.blackbox.rest_features import Blocks
from sysid_ros.blackbox.variance_components import VarianceComponents
from sysid_ros.sample import FloatArray

_MOST_ROWS = 480
"""Rows of which the covariance is inverted, which takes the cube of their number: some 20 s below 8 Hz."""
_MEMORIES = (0.3, 2.0)
"""Times for which slow noise is remembered [s]: longer ones are a constant of a few stretches, shorter ones white."""
_BANDS = 6
"""Bands below the cut-off in which there may be what only comes with the motion."""
_HIGHEST = 100.0
"""Highest ripple that is searched for [1/rad]: what passes faster at the slowest usual speed is above the cut-off."""
_MOST_RIPPLES = 3
_START = 0.2
"""Size with which a further part begins to be fitted, of the power: none of those that were found ends at once."""
_NORMAL = 1.96


@dataclass(frozen=True, eq=False)
class JointRest:
    """What is left of one joint's torque, and what may be known of it.

    Attributes:
        y: shape (N,) [N m]. t: [s]. stretch: number of the recording's stretch, shape (N,). moving: where the joint moves. stands:
            number of the standstill of all joints, 0 where one moves, shape (N,). block: rows of one are kept together.
        functions: by kind, shape (N, c) each. harmonics: from k, shape (m,), to sines and cosines of k times the position, shape
            (N, 2 m). turn: step and end of k at which ripples are searched for. cutoff: of all channels [Hz]. white: lags [s], and
            how much of white noise is alike at them below the cut-off, shape (l,) each.
    """

    y: FloatArray
    t: FloatArray
    stretch: NDArray[np.intp]
    moving: NDArray[np.bool_]
    stands: NDArray[np.intp]
    block: NDArray[np.intp]
    functions: Blocks
    harmonics: Callable[[FloatArray], FloatArray]
    turn: tuple[float, float]
    cutoff: float
    white: tuple[FloatArray, FloatArray]


def turns_of(q: FloatArray, unit: float) -> tuple[float, float]:
    """Step and end of the ripples that a range of positions, shape (N,), can tell from each other; unit: 1 rad, or what it is."""
    width = float(np.ptp(q)) / unit
    # half of the width of a peak of the spectrum
    return float(np.clip(np.pi / max(width, 1e-9), 0.25, 1.0)) / unit, _HIGHEST / unit


def noise_of(rest: JointRest) -> tuple[float, tuple[float, float]]:
    """rms of what no function of the motion makes while the joint moves, and its 95 % interval [N m]."""
    own = _chosen(rest)
    moving = rest.moving[own]
    scale = float(np.sqrt(np.mean(rest.y[own][moving] ** 2)))
    if scale <= 0.0:
        return 0.0, (0.0, 0.0)
    stands = np.where(moving, 0, rest.stands[own])
    F = np.column_stack([moving, *(stands == k for k in np.unique(stands[stands > 0]))]).astype(float)
    functions = [_kernel(x[own], moving) for x in rest.functions.values()]
    noise = _noise(rest, own, moving)
    y = rest.y[own] / scale
    found = VarianceComponents.fitted(y, F, [*noise, *functions])
    found = _with_ripples(found, y, F, rest, own, moving)
    found = _with_bands(found, y, F, rest, own, moving)
    power, std = found.power(range(len(noise)), moving)
    ends = [scale * float(np.sqrt(max(power + k * std, 0.0))) for k in (-_NORMAL, _NORMAL)]
    return scale * float(np.sqrt(max(power, 0.0))), (ends[0], ends[1])


def _chosen(rest: JointRest) -> NDArray[np.intp]:
    """Rows in which the joint moves or the robot stands, of as many blocks as are not too many, evenly."""
    own = rest.moving | (rest.stands > 0)
    blocks = np.unique(rest.block[own])
    count = min(len(blocks), max(1, int(len(blocks) * _MOST_ROWS / max(int(own.sum()), 1))))
    kept = blocks[np.linspace(0, len(blocks) - 1, count).round().astype(int)]
    return np.flatnonzero(own & np.isin(rest.block, kept))


def _kernel(X: FloatArray, moving: NDArray[np.bool_]) -> FloatArray:
    """Covariance of a sum of columns, each of the same size while the joint moves, of power 1 then."""
    Z = X - X[moving].mean(axis=0)
    size = np.std(Z[moving], axis=0)
    told = size > 1e-9 * max(float(size.max(initial=0.0)), 1e-300)
    Z = Z[:, told] / size[told]
    return np.asarray(Z @ Z.T / max(Z.shape[1], 1))


def _apart(rest: JointRest, own: NDArray[np.intp]) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Time between rows, and whether they are of one stretch, shape (n, n)."""
    t, stretch = rest.t[own], rest.stretch[own]
    return np.abs(t[:, None] - t), stretch[:, None] == stretch


def _noise(rest: JointRest, own: NDArray[np.intp], moving: NDArray[np.bool_]) -> list[FloatArray]:
    """Slow noise, which does not know whether the joint moves, and white noise, which may: that of a drive grows with its work."""
    dt, same = _apart(rest, own)
    out = [np.where(same, np.exp(-dt / memory), 0.0) for memory in _MEMORIES]
    lag, alike = rest.white
    white = np.where(same, np.interp(dt, lag, alike, right=0.0), 0.0)
    out += [white * np.outer(x, x) for x in (moving, ~moving)]
    return out if not moving.all() else out[:-1]


def _with_bands(
    found: VarianceComponents,
    y: FloatArray,
    F: FloatArray,
    rest: JointRest,
    own: NDArray[np.intp],
    moving: NDArray[np.bool_],
) -> VarianceComponents:
    """With what lies in one band and is there while the joint moves alone, for bands in which the data are likelier with it than
    there are bands to choose from; none where no standstill tells it from noise."""
    if moving.all():
        return found
    dt, same = _apart(rest, own)
    width = rest.cutoff / _BANDS
    decay = np.where(same & np.outer(moving, moving), np.exp(-dt * width / 0.4), 0.0)
    bands = [decay * np.cos(2.0 * np.pi * k * width * dt) for k in range(_BANDS)]
    for _ in range(_BANDS):
        gain = [found.gained_by(K) for K in bands]
        best = int(np.argmax(gain))
        if gain[best] <= np.log(_BANDS):
            break
        more = VarianceComponents.fitted(y, F, [*found.kernels, bands[best]], np.append(found.sizes, _START))
        if more.log_likelihood - found.log_likelihood <= np.log(_BANDS):
            break
        found = more
    return found


def _with_ripples(
    found: VarianceComponents,
    y: FloatArray,
    F: FloatArray,
    rest: JointRest,
    own: NDArray[np.intp],
    moving: NDArray[np.bool_],
) -> VarianceComponents:
    """With ripples over the position of the harmonics that make the data likelier than the number of harmonics to choose from."""
    step, end = rest.turn
    k = np.arange(step, end + 0.5 * step, step)
    columns = rest.harmonics(k)[own]
    sin, cos = columns[:, : len(k)], columns[:, len(k) :]
    least = float(np.log(len(k)))
    for _ in range(_MOST_RIPPLES):
        saved = (sin.T @ found.weights) ** 2 + (cos.T @ found.weights) ** 2
        usual = np.einsum("ij,ij->j", sin, found.P @ sin) + np.einsum("ij,ij->j", cos, found.P @ cos)
        ratio = np.maximum(saved / np.maximum(usual, 1e-9 * float(usual.max())), 1.0)
        gain = ratio - 1.0 - np.log(ratio)
        best = int(np.argmax(gain))
        if gain[best] <= least:
            break
        pair = np.column_stack([sin[:, best], cos[:, best]])
        K = pair @ pair.T
        K /= max(float(np.mean(np.diag(K)[moving])), 1e-300)
        more = VarianceComponents.fitted(y, F, [*found.kernels, K], np.append(found.sizes, _START))
        if more.log_likelihood - found.log_likelihood <= least:
            break
        found = more
    return found
