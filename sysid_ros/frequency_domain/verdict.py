"""In which band a model holds: responses of neighbouring windows pooled, each with the circle that holds it with 95 %."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.frequency_domain.local_fit import Window, circular_quantile, smoothed_noise
from sysid_ros.frequency_domain.tolerances import TOLERANCES

_THIRD_OCTAVE = 2.0 ** (1.0 / 3.0)


@dataclass(frozen=True, slots=True)
class Band:
    """Windows over a third of an octave or more, pooled.

    Attributes:
        low, high: its ends [Hz]; it begins in the middle of a first window of an octave or more, whose response is that of its
            middle. H: mean response. radius: of the 95 % circle about it. says: "holds" where the whole circle is
            within the tolerance of 1, "fails" where none of the larger circle is that holds H with 1 - 5 % / (number of bands),
            else "untold": a band that fails by chance alone is then rare in all of them. Beside dry friction, which has
            a response of its own, a misfit fails only as a part of both; where dry friction prevails it moves the joint itself,
            and nothing is said to fail. What holds is held to the tolerance without that allowance.
    """

    low: float
    high: float
    H: complex
    radius: float
    says: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """The conclusion from all bands.

    Attributes:
        holds_from, holds_to: the lowest bands in a row that hold [Hz]; None where none does. fails_from: low end of
            the first band from there on that fails [Hz]. told_to: high end of the last band that says anything [Hz].
            fails_below: high end of the last band below those that hold that fails [Hz]. None where there is none.
    """

    bands: tuple[Band, ...]
    holds_from: float | None
    holds_to: float | None
    fails_from: float | None
    told_to: float | None
    fails_below: float | None


def verdict(windows: Sequence[Window], tolerance: float = TOLERANCES.misfit) -> Verdict:
    """Bands of windows in which the input stands above its noise."""
    clear = [w for w in windows if w.clear]
    noise = smoothed_noise(clear)
    groups: list[list[int]] = []
    group: list[int] = []
    for i, window in enumerate(clear):
        group.append(i)
        first = clear[group[0]]
        low = first.low if first.low > 0.0 else first.f
        last = i == len(clear) - 1 or clear[i + 1].low > window.high * 1.001
        if window.high >= _THIRD_OCTAVE * max(low, 1e-9) or last:
            groups.append(group)
            group = []
    bands = [_band([clear[k] for k in group], noise[group].tolist(), tolerance, len(groups)) for group in groups]
    holding: list[Band] = []
    for band in bands:
        if band.says == "holds":
            holding.append(band)
        elif holding:
            break
    start = holding[0].low if holding else 0.0
    failing = [b.low for b in bands if b.says == "fails" and b.low >= start]
    below = [b.high for b in bands if b.says == "fails" and b.low < start]
    judged = [b.high for b in bands if b.says != "untold"]
    return Verdict(
        tuple(bands),
        holding[0].low if holding else None,
        holding[-1].high if holding else None,
        failing[0] if failing else None,
        max(judged) if judged else None,
        max(below) if below else None,
    )


def _band(windows: Sequence[Window], noise: Sequence[float], tolerance: float, bands: int) -> Band:
    variance = np.array([w.variance / max(w.noise, 1e-300) * n for w, n in zip(windows, noise, strict=True)])
    weight = 1.0 / np.maximum(variance, 1e-300)
    H = complex(np.sum(weight * np.array([w.H for w in windows])) / weight.sum())
    freedom = float(sum(w.freedom for w in windows))
    radius = float(np.sqrt(circular_quantile(freedom) / weight.sum()))
    surely = float(np.sqrt(circular_quantile(freedom, 1.0 - (1.0 - TOLERANCES.level) / bands) / weight.sum()))
    misfit = abs(H - 1.0)
    share = float(np.sqrt(np.mean([w.share**2 for w in windows])))
    fails = (misfit - surely) * share > tolerance and share > TOLERANCES.mostly_smooth
    says = "holds" if misfit + radius <= tolerance else "fails" if fails else "untold"
    first = windows[0]
    return Band(first.f if first.high >= 2.0 * first.low else first.low, windows[-1].high, H, radius, says)
