"""What the figure and the page of a frequency check show, free of any drawing library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.frequency import FrequencyCheck, JointCheck, Response
from sysid_ros.sample import FloatArray

MEASURED = "#0072B2"
FITTED = "#D55E00"
SAYS = {"holds": "#009E73", "fails": "#D55E00", "untold": "#C8C8C8"}
SMALLEST, LARGEST = 0.1, 10.0
_POINTS = 400


@dataclass(frozen=True, slots=True)
class Bode:
    """Curves of one response: f (w,) [Hz]; magnitude and phase [degrees] with lower and upper ends, shape (3, w); coherence
    (w,); the fitted cause on its own grid: fit_f (m,), fit_magnitude, fit_phase; bands: (low, high, what it says).

    Windows in which the input is mostly noise, or whose 95 % circle is wider than the response, are left out of magnitude and
    phase, as NaN.
    """

    f: FloatArray
    magnitude: FloatArray
    phase: FloatArray
    coherence: FloatArray
    fit_f: FloatArray
    fit_magnitude: FloatArray
    fit_phase: FloatArray
    bands: tuple[tuple[float, float, str], ...]


def bode(response: Response) -> Bode:
    """Curves of a response."""
    f = np.array([w.f for w in response.windows])
    told = [w.clear and w.radius < max(abs(w.H), 1.0) for w in response.windows]
    H = np.array([w.H if ok else np.nan + 0j for w, ok in zip(response.windows, told, strict=True)])
    radius = np.array([w.radius if ok else np.nan for w, ok in zip(response.windows, told, strict=True)])
    size = np.abs(H)
    # where the circle holds 0 the phase is not known
    part = np.where(radius < size, radius / np.maximum(size, 1e-12), np.nan)
    magnitude = np.clip([size, size - radius, size + radius], SMALLEST, LARGEST)
    width = np.degrees(np.arcsin(part))
    angle = np.where(np.isfinite(part), np.degrees(np.angle(H)), np.nan)
    fit_f, fit = np.zeros(0), np.zeros(0, dtype=complex)
    cause = response.cause
    if cause is not None and cause.named:
        fit_f = np.geomspace(*cause.band, _POINTS)
        fit = cause.H(fit_f)
    return Bode(
        f,
        magnitude,
        np.array([angle, angle - width, angle + width]),
        np.array([w.coherence for w in response.windows]),
        fit_f,
        np.clip(np.abs(fit), SMALLEST, LARGEST),
        np.degrees(np.angle(fit)),
        tuple((b.low, b.high, b.says) for b in response.verdict.bands),
    )


def shown(result: FrequencyCheck) -> list[JointCheck]:
    """Joints with a response."""
    return [c for c in result.joints if c.torque is not None and c.torque.windows]


def span(checks: Sequence[JointCheck]) -> tuple[float, float]:
    """Frequencies that the axes show [Hz]: a little more than what any joint tells."""
    windows = [w for c in checks if c.torque for w in c.torque.windows]
    clear = [w for w in windows if w.clear and w.radius < max(abs(w.H), 1.0)] or windows
    fitted = [c.torque.cause.band[1] for c in checks if c.torque and c.torque.cause and c.torque.cause.named]
    return max(min(w.f for w in clear) / 1.15, 0.05), max([w.high for w in clear] + fitted) * 1.1


def short(check: JointCheck) -> str:
    """The finding of a joint in a few words."""
    assert check.torque is not None
    v, cause = check.torque.verdict, check.torque.cause
    held = f"holds to {v.holds_to:.2g} Hz" if v.holds_to else "holds in no band"
    if check.friction is not None:
        return f"{held}; lacks dry friction"
    if cause is None or not cause.named:
        return held
    words = []
    for p in cause.parameters:
        if p.name in ("delay", "cutoff", "frequency") or (p.name == "gain" and cause.name == "gain"):
            words.append(f"{1e3 * p.value:.3g} ms" if p.name == "delay" else f"{p.value:.3g} {p.unit}".strip())
    return f"{held}; {cause.name.replace('_', '-').replace('+', ' and ')} {', '.join(words)}"
