"""Search for the stiffness or the play of a compliant joint, whose torque is far from linear in either."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy import optimize

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term

_SCANNED = 11
_NARROWED = 7
_FOLLOWED = 4
_SLOPES = 3
_PROBE = 0.005
_LONGEST = 0.3


class _Search:
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

    def scan(self, name: str, ratio: float) -> None:
        """Try values from one ratio below to one above."""
        value = float(self.settings[name])
        for x in np.geomspace(value / ratio, value * ratio, _SCANNED):
            self.attempt(**{name: float(x)})

    def narrow(self, name: str, low: float, high: float) -> None:
        """Brent's method on the logarithm; :meth:`attempt` keeps the best."""
        bounds, steps = (np.log(low), np.log(high)), {"maxiter": _NARROWED + 2}
        optimize.minimize_scalar(
            lambda x: self.attempt(**{name: float(np.exp(x))}), bounds=bounds, method="bounded", options=steps
        )

    def slopes(self, names: tuple[str, ...]) -> None:
        """A step of Gauss and Newton in the logarithms of some settings."""
        whole, others = self.term.columns[..., 0] * self.settings["around"], [t for t in self.fit.terms if t is not self.term]
        steps = []
        for name in names:
            moved = {**self.settings, name: self.settings[name] * (1.0 + _PROBE)}
            other = self._library.whole(self._old.id, self._old.joints, **moved)
            steps.append((other.columns[..., 0] * moved["around"] - whole) / np.log1p(_PROBE))
        rest = Problem(self._problem.band, self._problem.y - whole, self._problem.nuisance, self._problem.prior**-0.5)
        slope = replace(self.term, columns=np.stack(steps, axis=-1))
        step = rest.fit([*others, slope], self.fit.noise, 2, self.fit.inexact).theta_of(slope)
        step *= min(1.0, _LONGEST / float(np.max(np.abs(step))))
        self.attempt(**{name: float(self.settings[name] * np.exp(x)) for name, x in zip(names, step, strict=True)})


def fit_deflection(problem: Problem, library: Library, fit: Fit, term: Term) -> tuple[Fit, Term]:
    """The fit with the compliance of ``term`` where the rows are the most likely.

    A term that is tried for the first time is searched for to first order in the deflection, then made exact; one that was made
    exact before only follows what has changed beside it.
    """
    how, search = term.effect.deflection, _Search(problem, library, fit, term)
    assert how is not None
    first = not term.effect.settings["exact"]
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
    if how.smooth:
        for _ in range(_SLOPES if first else 1):
            search.slopes(("around", *(k.name for k in term.effect.knobs)))
    else:
        value = float(search.settings["around"])
        search.narrow("around", value / 1.02, value * 1.02)
    return search.fit, search.term
