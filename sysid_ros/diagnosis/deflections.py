"""Sizes of deflections, of which the torque is far from linear: an elastic joint, play in a gear."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import optimize

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term

_SIZES = 11
_CARRIED, _SIZES_CARRIED = 1.6, 25
"""Ratio within which a compliance is looked for once it is known what the links carry, and number of sizes."""
_NARROWED = 7
_FOLLOWED = 4
_SLOPES = 3
_PROBE = 0.005
_LONGEST = 0.3
_SPREAD, _TOGETHER = (0.01, 0.3), 80
"""Of the first simplex, in the logarithm of the size and of a knob, and how often the rows are fitted on its way."""


class _Deflection:
    """Settings of one term, moved to where the rows are the most likely.

    The linear parameter must be the one that the columns were made for: a fit that wants another one costs what forcing
    it would, ``((theta - around) / std)^2 / 2``.
    """

    def __init__(self, problem: Problem, library: Library, fit: Fit, term: Term) -> None:
        self._problem, self._library, self._fit, self._old = problem, library, fit, term
        self.settings = dict(term.effect.settings)
        if not self.settings["around"]:
            self.settings["around"] = max(float(fit.theta_of(term)[0]), 1e-9)
        self.cost, self.fit, self.term = self.at(self.settings)

    def at(self, settings: dict[str, Any]) -> tuple[float, Fit, Term]:
        """Cost, fit and term with these settings."""
        new = self._library.whole(self._old.id, self._old.joints, **settings)
        fit = self._problem.fit([new if t is self._old else t for t in self._fit.terms], self._fit.noise, 2, self._fit.inexact)
        theta, std = float(fit.theta_of(new)[0]), float(fit.std_of(new)[0])
        return 0.5 * ((theta - settings["around"]) / max(std, 1e-12)) ** 2 - fit.loglik, fit, new

    def attempt(self, **changes: Any) -> float:
        """Cost with some settings changed, which are kept where it is the least so far."""
        settings = {**self.settings, **changes}
        cost, fit, term = self.at(settings)
        if cost < self.cost:
            self.cost, self.fit, self.term, self.settings = cost, fit, term, settings
        return cost

    def follow(self) -> None:
        """Take the parameter that the fit asks for as long as that is likelier: a joint that is stiff for its motion shows in its
        deflection under the load alone, which is linear in it and as good for one value that the columns are made for as another.
        """
        for _ in range(_FOLLOWED):
            cost, asked = self.cost, float(self.fit.theta_of(self.term)[0])
            if asked > 0.0:
                self.attempt(around=asked)
            if self.cost >= cost:
                break

    def scan(self, name: str, ratio: float, sizes: int = _SIZES) -> None:
        """Try values from one ratio below to one above."""
        value = float(self.settings[name])
        for x in np.geomspace(value / ratio, value * ratio, sizes):
            self.attempt(**{name: float(x)})

    def narrow(self, name: str, low: float, high: float) -> None:
        """Brent's method on the logarithm; :meth:`attempt` keeps the best."""
        bounds, steps = (np.log(low), np.log(high)), {"maxiter": _NARROWED + 2}
        optimize.minimize_scalar(
            lambda x: self.attempt(**{name: float(np.exp(x))}), bounds=bounds, method="bounded", options=steps
        )

    def together(self, names: tuple[str, ...]) -> None:
        """Nelder's and Mead's simplex on the logarithms, for what one setting after the other can't reach; :meth:`attempt` keeps
        the best. A link that flies free lands elsewhere with any change, so that there are no slopes to follow."""
        knobs = {k.name: (np.log(k.low), np.log(k.high)) for k in self._old.effect.knobs}
        bounds, at = [knobs.get(name, (-np.inf, np.inf)) for name in names], [self.settings[name] for name in names]
        start = np.clip(np.log(at), *np.transpose(bounds))
        simplex = np.vstack([start, start + np.diag([_SPREAD[name in knobs] for name in names])])
        optimize.minimize(
            lambda x: self.attempt(**{name: float(np.exp(y)) for name, y in zip(names, x, strict=True)}),
            start,
            method="Nelder-Mead",
            bounds=bounds,
            options={"initial_simplex": simplex, "maxfev": _TOGETHER},
        )

    def slopes(self, names: tuple[str, ...]) -> None:
        """A step of Gauss and Newton in the logarithms of some settings."""
        whole, others = self.term.columns[..., 0] * self.settings["around"], [t for t in self.fit.terms if t is not self.term]
        steps = []
        for name in names:
            moved = {**self.settings, name: self.settings[name] * (1.0 + _PROBE)}
            other = self._library.whole(self._old.id, self._old.joints, **moved)
            steps.append((other.columns[..., 0] * moved["around"] - whole) / np.log1p(_PROBE))
        rest = copy(self._problem)
        rest.y = self._problem.y - whole
        slope = replace(self.term, columns=np.stack(steps, axis=-1))
        step = rest.fit([*others, slope], self.fit.noise, 2, self.fit.inexact).theta_of(slope)
        step *= min(1.0, _LONGEST / float(np.max(np.abs(step))))
        self.attempt(**{name: float(self.settings[name] * np.exp(x)) for name, x in zip(names, step, strict=True)})


def fit_deflection(problem: Problem, library: Library, fit: Fit, term: Term) -> tuple[Fit, Term]:
    """The fit with the compliance of ``term`` where the rows are the most likely.

    A term that is tried for the first time is searched for to first order in the deflection, then made exact; one that was made
    exact before only follows what has changed beside it.
    """
    how, search = term.effect.deflection, _Deflection(problem, library, fit, term)
    assert how is not None
    first = not term.effect.settings["exact"]
    if first and term.effect.settings.get("links"):
        search.scan("around", _CARRIED, _SIZES_CARRIED)
    search.follow()
    if first:
        search.scan("around", how.scanned)
        for side in how.sides:
            search.attempt(side=side)
        for name, ratio in how.steps:
            value = float(search.settings[name])
            knob = next((k for k in term.effect.knobs if k.name == name), None)
            low, high = (value / ratio, value * ratio) if ratio or knob is None else (knob.low, knob.high)
            search.narrow(name, low, high)
        search.settings["exact"] = True
        search.cost, search.fit, search.term = search.at(search.settings)
        if not how.smooth:
            search.together(("around", *(k.name for k in term.effect.knobs)))
    if how.smooth:
        for _ in range(_SLOPES if first else 1):
            search.slopes(("around", *(k.name for k in term.effect.knobs)))
    else:
        value = float(search.settings["around"])
        search.narrow("around", value / 1.02, value * 1.02)
    return search.fit, search.term
