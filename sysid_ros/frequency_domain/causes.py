"""Which cause explains a frequency response, with its parameters and how certain they are.

Every form of :mod:`.transfer_functions` is fitted to the lines themselves, so that a resonance may be narrower than a window::

    min over x   sum_w sum_k |P_w (Y_k - H(f_k; x) U_k)|^2 / (s_w^2 + |H(f_k; x)|^2 n_k)

P_w takes a transient out, s_w^2 is the noise that the local polynomials left, n_k what the noise of the positions makes of U: the
likelihood of complex normal errors in both variables with known variances (Pintelon, Schoukens 2012, section 9.11). Where a link
swings against a motor at rest, the input is nothing but noise, and this fit still tells it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.frequency_domain.lines import ComplexArray, Record
from sysid_ros.frequency_domain.local_fit import Window
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.frequency_domain.transfer_functions import FOLDS, FORMS, UNITS, Form, LineFit, bounds
from sysid_ros.sample import FloatArray

_GRID = 60
_DAMPINGS = (0.01, 0.03, 0.1, 0.2)
_RATIOS = (0.3, 1.5)
_INTERVAL = 1.96


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of a cause: value, standard deviation, 95 % interval."""

    name: str
    value: float
    std: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True, eq=False)
class Cause:
    """What the model misses on one channel.

    Attributes:
        name: "nothing", "gain", "delay", "low_pass", "resonance", "anti_resonance" or two of them with a "+".
        parameters: of it. delta_bic: what it gains against no cause at all. held_out_gain: part of the misfit (above what noise
            makes) that it removes on lines that were not fitted. cannot_be_told_from: others that explain the lines as well.
        misfit: mean square misfit over the noise of the local fits; 1 where it explains all. form, x: for its response.
        band: of the lines that were fitted [Hz]. share: of the input beside dry friction there, see :class:`.Window`.
    """

    name: str
    parameters: tuple[Parameter, ...]
    delta_bic: float
    held_out_gain: float
    cannot_be_told_from: tuple[str, ...]
    misfit: float
    form: Form
    x: FloatArray
    band: tuple[float, float]
    share: float = 1.0

    @property
    def effect(self) -> float:
        """Largest |H - 1| over the band, as a part of input and dry friction in sum: how much the cause matters at all."""
        return float(np.max(np.abs(self.H(np.geomspace(*self.band, 200)) - 1.0))) * self.share

    @property
    def named(self) -> bool:
        """Whether it is large enough to report, and identifiable beside dry friction."""
        return (
            self.name != "nothing"
            and self.effect >= TOLERANCES.negligible
            and self.share >= TOLERANCES.mostly_smooth
            and self.explains
        )

    @property
    def explains(self) -> bool:
        """Whether it explains enough of the misfit to be believed: on data not fitted, unless a resonance stands out."""
        stands_out = self.name.endswith("resonance") and self.delta_bic > TOLERANCES.obvious
        return stands_out or self.held_out_gain >= TOLERANCES.held_out

    def H(self, f: FloatArray) -> ComplexArray:
        """Response at f (K,) [Hz]."""
        return self.form.H(self.x, f)

    def parameter(self, name: str) -> Parameter | None:
        """The parameter of that name, where it has one."""
        return next((p for p in self.parameters if p.name == name), None)

    def required(self, name: str) -> Parameter:
        """The parameter of that name, which its form has."""
        return self.parameters[self.form.parameters.index(name)]


def _at_the_edge(form: Form, x: FloatArray, f: FloatArray) -> bool:
    """Whether an oscillation was pushed out of the band: what it is taken for lies elsewhere."""
    if "frequency" not in form.parameters:
        return False
    lower, upper = bounds(form, f)
    at = [form.parameters.index("frequency"), form.parameters.index("damping")]
    return bool(np.any(x[at] > upper[at] - 1e-3) or x[at[0]] < lower[at[0]] + 1e-3)


def starts_of(form: Form, fit: LineFit, known: dict[str, float]) -> list[FloatArray]:
    """Where the search begins: for oscillations the best points of a grid, elsewhere one point."""
    usual = {"gain": 1.0, "delay": 0.0, "cutoff": float(fit.f.max()), **known}
    if "damping" not in form.parameters:
        return [form.searched(np.array([usual[name] for name in form.parameters]))]
    low, high = 1.5 * float(fit.f.min()), float(fit.f.max()) / TOLERANCES.beyond
    if high <= 1.4 * low:
        return []
    grid = []
    for frequency in np.geomspace(low, high, _GRID):
        for damping in _DAMPINGS:
            for ratio in _RATIOS if "zero_ratio" in form.parameters else (1.0,):
                usual |= {"frequency": float(frequency), "damping": damping, "zero_ratio": ratio}
                grid.append(form.searched(np.array([usual[name] for name in form.parameters])))
    kept: list[FloatArray] = []
    at = form.parameters.index("frequency")
    for i in np.argsort(fit.costs(form, grid)):
        x = grid[i]
        if all(abs(x[at] - y[at]) > 0.15 for y in kept):
            kept.append(x)
        if len(kept) == 3:
            break
    return kept


def find_cause(records: Sequence[Record], windows: Sequence[Window], forms: Sequence[Form] = FORMS) -> Cause | None:
    """The simplest of some forms that explains the lines; None where no window tells anything.

    Misfit that no form removes (nonlinear friction, a wrong mass) is taken for noise: the criterion is divided by it. A more
    complicated form must gain on it, and on every fourth window held out in turn.
    """
    fit = LineFit(records, windows)
    if fit.count < 8 or fit.freedom < 12.0:
        return None
    found = _fitted(forms, fit)
    worst = max(min((cost / max(2.0 * fit.freedom - form.p, 1.0) * 2.0) for form, _, cost in found), 1.0)
    size = np.log(2.0 * fit.freedom)
    # the sum of |r|^2 is half of chi squared
    score = [2.0 * cost / worst + form.p * size for form, _, cost in found]
    order = sorted(range(len(found)), key=lambda i: (found[i][0].p, score[i]))
    best = order[0]
    for i in order[1:]:
        gains = score[i] < score[best] - TOLERANCES.step_up
        if gains and _held_out(found[i], fit).sum() < _held_out(found[best], fit).sum():
            best = i
    form, x, cost = found[best]
    alike = (found[i][0] for i in order if score[i] < score[best] + TOLERANCES.as_good)
    rivals = dict.fromkeys(
        other.name for other in alike if not set(form.name.split("+")) <= set(other.name.split("+")) and other.p <= form.p + 1
    )
    misfit = cost / max(fit.freedom - 0.5 * form.p, 1.0)
    return Cause(
        form.name,
        _parameters(form, x, fit, max(misfit, 1.0)),
        float(score[order[0]] - score[best]),
        _held_out_gain(found[best], fit) if form.p else 0.0,
        tuple(r for r in rivals if r != "nothing") if form.p else (),
        misfit,
        form,
        x,
        (float(fit.f.min()), float(fit.f.max())),
        fit.share,
    )


def _fitted(forms: Sequence[Form], fit: LineFit) -> list[tuple[Form, FloatArray, float]]:
    """The forms with their best parameters (as searched) and costs, without those whose oscillation lies outside of the band."""
    found: list[tuple[Form, FloatArray, float]] = []
    known: dict[str, float] = {}
    for form in forms:
        starts = starts_of(form, fit, known) if form.p else [np.zeros(0)]
        if not starts:
            continue
        x, cost = fit.fit(form, starts)
        if _at_the_edge(form, x, fit.f):
            continue
        if form.name in ("gain", "delay"):
            known |= dict(zip(form.parameters, form.values(x), strict=True))
        found.append((form, x, cost))
    return found


def _held_out(item: tuple[Form, FloatArray, float], fit: LineFit) -> FloatArray:
    """Cost on each fold, fitted to the others."""
    form, x, _ = item
    out = []
    for k in range(FOLDS):
        own = fit.fold == k
        there = fit.fit(form, [x], ~own)[0] if form.p else x
        out.append(float(np.sum(np.abs(fit.residual(form.H(there, fit.f))[own]) ** 2)))
    return np.array(out)


def _held_out_gain(item: tuple[Form, FloatArray, float], fit: LineFit) -> float:
    nothing = float(np.sum(np.abs(fit.residual(np.ones(fit.count, dtype=complex))) ** 2))
    above = max(nothing - fit.freedom, 1e-9 * nothing)
    return float(np.clip((nothing - _held_out(item, fit).sum()) / above, -1.0, 1.0))


def _parameters(form: Form, x: FloatArray, fit: LineFit, scale: float) -> tuple[Parameter, ...]:
    if not form.p:
        return ()
    J = fit.jacobian(form, x)
    # noise of variance 1 in all has 1/2 in each of the real and the imaginary part
    covariance = 0.5 * scale * np.linalg.pinv(J.T @ J)
    std, value = np.sqrt(np.maximum(np.diag(covariance), 0.0)), form.values(x)
    ends = [form.values(x + sign * _INTERVAL * std) for sign in (-1.0, 1.0)]
    slope = np.where(form.logarithmic, value, 1.0)
    return tuple(
        Parameter(name, float(v), float(s * g), float(a), float(b), UNITS[name])
        for name, v, s, g, a, b in zip(form.parameters, value, std, slope, *ends, strict=True)
    )
