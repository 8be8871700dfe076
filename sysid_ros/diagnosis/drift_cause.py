"""What a drift of friction follows: time, or the recorded temperature of its joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.knobs import refine
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import Depends
from sysid_ros.sample import FloatArray

_STRONG = 10.0
"""Difference of the BIC from which evidence is very strong (Kass, Raftery 1995)."""
_CLOSE = 10.0
"""Likelihood on the fitted rows by which one may be worse and still be the better of the two on held-out ones."""
_AS_WELL = 1.01
"""Error on held-out data, over that of the other, up to which one predicts as well."""
SIGNATURE = "the ribbon of the residual against the speed narrows or widens with the temperature of the joint"
RECORD_NEXT = (
    "To tell a drift of friction with time from one with temperature: the same motion after a cold start and again warm, with a "
    "pause in which the joints cool down."
)


@dataclass(frozen=True)
class DriftCause:
    """A drift of friction over one thing, against the same drift over the other.

    Attributes:
        over: "time" or "temperature", as it was fitted. joints: how many were compared.
        delta_bic: by which the other is worse; both have as many parameters.
        delta_heldout: the same on held-out data, where nothing is fitted: twice the difference of the likelihoods.
        error, error_of_other: on held-out data of the joints that drift, in units of the noise.
        reference: temperature of the friction that is stated, a joint [degrees Celsius]; empty over time.
    """

    over: str
    joints: int
    delta_bic: float
    delta_heldout: float
    error: float
    error_of_other: float
    reference: dict[str, float]

    @property
    def other(self) -> str:
        """What it was compared with."""
        return "time" if self.over == "temperature" else "temperature"

    @property
    def decided(self) -> bool:
        """True where the recordings tell the two apart."""
        return (
            self.delta_bic + self.delta_heldout > _STRONG
            and self.delta_bic > -2.0 * _CLOSE * self.joints
            and self.error <= _AS_WELL * self.error_of_other
        )

    def in_words(self) -> str:
        """For an engineer."""
        numbers = (
            f"ΔBIC {self.delta_bic:.0f}; on data that were not fitted the error is {self.error:.2f} times the noise with "
            f"{self.over}, {self.error_of_other:.2f} times with {self.other}"
        )
        said = {"time": "time", "temperature": "the recorded temperature"}
        text = (
            f"{said[self.over].capitalize()} explains the drift better than {said[self.other]} ({numbers})."
            if self.decided
            else f"These recordings don't tell whether it follows time or the recorded temperature ({numbers})."
        )
        if not self.reference:
            return text
        at = ", ".join(f"{value:g} ({joint})" for joint, value in self.reference.items())
        return f"{text} Fc and b are those at {at} degrees Celsius."

    def as_dict(self) -> dict[str, Any]:
        """As it stands in diagnosis.json."""
        return {
            "over": self.over,
            "against": self.other,
            "delta_bic": self.delta_bic,
            "delta_heldout": self.delta_heldout,
            "heldout_error": {self.over: self.error, self.other: self.error_of_other},
            "decided": self.decided,
            "reference": self.reference,
        }


def drift_cause(
    problem: Problem, library: Library, fit: Fit, held: HeldOut, terms: Sequence[Term], floor: FloatArray
) -> DriftCause | None:
    """What a drift of friction follows, None where it is none, or no temperature of its joints is known.

    Args:
        terms: of the drift, all over the same thing. floor: noise of each joint on held-out data, shape (n,) [N m].
    """
    if not all(_may_follow_temperature(t) for t in terms):
        return None
    trial, joints = _swapped(problem, library, fit, terms)
    if not joints:
        return None
    held.add(trial.terms)
    errors = [held.rms(held.residual(x))[joints] / np.maximum(floor[joints], 1e-12) for x in (fit, trial)]
    own, other = (float(np.sqrt(np.mean(e**2))) for e in errors)
    names = fit.terms[0].effect.robot.joint_names
    return DriftCause(
        over=terms[0].form or "time",
        joints=len(joints),
        delta_bic=2.0 * (fit.loglik - trial.loglik),
        delta_heldout=_worse_elsewhere(fit, trial, held, joints),
        error=own,
        error_of_other=other,
        reference={names[t.joints[0]]: float(t.effect.settings["reference"]) for t in terms if "reference" in t.effect.settings},
    )


def _may_follow_temperature(term: Term) -> bool:
    return Depends.TEMPERATURE in term.effect.depends_on


def _swapped(problem: Problem, library: Library, fit: Fit, terms: Sequence[Term]) -> tuple[Fit, list[int]]:
    """The fit with drifts over time in place of those over temperature and the other way round, and their joints."""
    swapped: dict[Term, Term] = {}
    for term in terms:
        joint = term.joints[0]
        others = [t for t in library.local_options(term.id, joint) if t.form != term.form]
        if others:
            knobs = {k.name: term.effect.settings[k.name] for k in term.effect.knobs}
            settings = {**others[0].effect.settings, **knobs}
            swapped[term] = library.local(term.id, joint, **settings)
    if not swapped:
        return fit, []
    trial = problem.fit([swapped.get(t, t) for t in fit.terms], fit.noise, inexact=fit.inexact)
    return refine(problem, library, trial, list(swapped.values())), [t.joints[0] for t in swapped]


def _worse_elsewhere(fit: Fit, trial: Fit, held: HeldOut, joints: list[int]) -> float:
    """Twice the likelihood of held-out rows that a trial loses."""
    noise = fit.noise.along(held.prepared.band)[:, joints]
    own, other = (held.residual(x)[:, joints] for x in (fit, trial))
    return float(np.sum((other**2 - own**2) / noise))
