"""The ceiling in a sentence: how much is left, how much of it is no noise, where and with what."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sysid_ros.sample import FloatArray

if TYPE_CHECKING:
    from sysid_ros.blackbox.ceiling import Ceiling, JointCeiling

_MOST_NAMED = 3
_MOSTLY, _PARTLY = 0.5, 0.2
"""Parts of the gain from which one channel alone is said to make most of it, or to be among what makes it."""
_NUMBERS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five", 6: "six", 7: "seven"}


def in_words(found: Ceiling) -> str:
    """One or two sentences."""
    judged = [j for j in found.joints if j.left is not None]
    if not judged:
        return "How much of what is left is noise can not be told: no joint moves for long enough to leave parts of it out."
    boxes = f"the best of {_NUMBERS.get(found.tried, str(found.tried))} black boxes"
    first = f"What is left: {_percent(found.left)} of the torque"
    if not found.claimed:
        best = max(judged, key=lambda j: (j.gain or 0.0) / max(j.gain_std or 0.0, 1e-12))
        if not (best.gain or 0.0) > 0.0:
            return (
                f"{first}; {boxes} predicts nothing of it on data that were not fitted: noise, as far as these recordings tell."
            )
        return (
            f"{first}; {boxes} predicts {_points(best.gain or 0.0)} ({_spread(best)}) of the {_percent(best.left or 0.0)} of "
            f"{best.joint}'s torque that are left, and less elsewhere, on data that were not fitted: noise, as far as these "
            "recordings tell."
        )
    parts = [_of_joint(j) for j in found.claimed[:_MOST_NAMED]]
    more = len(found.claimed) - len(parts)
    others = f"; and less on {more} more" if more > 0 else ""
    return f"{first}; {boxes} predicts, on data that were not fitted, {'; '.join(parts)}{others}: something is missing there."


def _of_joint(j: JointCeiling) -> str:
    left, gain = j.left or 0.0, j.gain or 0.0
    where = f", around {j.frequency:.2g} Hz" if j.frequency is not None else ""
    with_what = ""
    if j.follows is not None and j.follows[1] >= _PARTLY:
        with_what = f" and {'' if j.follows[1] >= _MOSTLY else 'partly '}with {j.follows[0]}"
    return f"{_points(gain)} ({_spread(j)}) of the {_percent(left)} of {j.joint}'s torque that are left{where}{with_what}"


def _spread(j: JointCeiling) -> str:
    return "spread unknown" if j.gain_std is None else f"± {100.0 * 2.0 * j.gain_std:.2g}"


def _percent(part: float) -> str:
    return f"{100.0 * part:.2g} %" if part < 0.995 else f"{100.0 * part:.0f} %"


def _points(part: float) -> str:
    return f"{100.0 * part:.2g} points"


def middle_frequency(rest: FloatArray, prediction: FloatArray, block: NDArray[np.intp], period: float) -> float | None:
    """Frequency below which half of the power is that a prediction takes from a residual, shape (N,) each [Hz].

    Args:
        block: number of each row. period: between rows [s].
    """
    total: dict[int, FloatArray] = {}
    length = int(np.median(np.bincount(block)[np.unique(block)]))
    for b in np.unique(block):
        own = np.flatnonzero(block == b)[:length]
        if len(own) < length or not prediction[own].any():
            continue
        window = np.hanning(length)
        before, after = (np.abs(np.fft.rfft(x[own] * window)) ** 2 for x in (rest, rest - prediction))
        total[0] = total.get(0, np.zeros(len(before))) + before - after
    if not total:
        return None
    gained = np.maximum(total[0], 0.0)
    if not gained.any():
        return None
    f = np.fft.rfftfreq(length, period)
    return float(np.interp(0.5, np.cumsum(gained) / gained.sum(), f))
