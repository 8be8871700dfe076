"""What a fitted set of terms predicts of recordings that were not fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.diagnosis.events import OUTSIDE, dated_again
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared, inexact_links
from sysid_ros.diagnosis.refine import remake
from sysid_ros.diagnosis.term import Term
from sysid_ros.diagnosis.torques import torques
from sysid_ros.effects import LinkInertia
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Held-out rows and the terms of a fit on them.

    Attributes:
        prepared: the recordings. terms: a fitted term to the same term on these recordings.
    """

    prepared: Prepared
    library: Library
    terms: dict[Term, Term]

    @classmethod
    def of(cls, robot: RobotModel, prepared: Prepared, fit: Fit) -> HeldOut:
        """The terms of ``fit`` on held-out recordings; only the time of an event is searched again."""
        library = Library(robot, prepared.band, inside=-OUTSIDE)
        held = cls(prepared, library, {})
        held.update(fit)
        held.terms.update(dated_again(library, prepared, fit, held.terms))
        return held

    def update(self, fit: Fit) -> None:
        """Make the terms of a fit known, with the torques that it makes here."""
        links = [m.link_torque for m in self.prepared.motions]
        for _ in range(2 if any(t.on_torques for t in fit.terms) else 0):
            self.library.update(*torques(self.library, fit, links, self.prepared.nominal))
        for term in fit.terms:
            if term not in self.terms or term.on_torques:
                self.terms[term] = remake(self.library, term, term.effect.settings)

    def add(self, terms: Sequence[Term]) -> None:
        """Make terms known that are not in the fit."""
        for term in terms:
            if term not in self.terms:
                self.terms[term] = remake(self.library, term, term.effect.settings)

    def residual(self, fit: Fit) -> FloatArray:
        """Rows that a fit leaves, shape (K, n)."""
        out = self.prepared.problem.y.copy()
        for term in fit.terms:
            _subtract(out, self.terms[term], fit.theta_of(term))
        if fit.inexact:
            out -= self.prepared.problem.nuisance @ fit.theta[-self.prepared.problem.nuisance.shape[2] :]
        return out

    def rms(self, rows: FloatArray) -> FloatArray:
        """Root mean square over time of what rows stand for, a joint, shape (n,) [N m]."""
        samples = sum(len(m.t) for m in self.prepared.motions)
        rms: FloatArray = np.sqrt(np.sum(rows**2, axis=0) / samples)
        return rms

    def predictions(self, fit: Fit, robot: RobotModel) -> list[FloatArray]:
        """Torque of the extended model on the grids of the motions, shape (N, n) each [N m]."""
        out = [x.copy() for x in self.prepared.nominal]
        for term in fit.terms:
            theta = term.theta_of_effect(fit.theta_of(term))
            for i, motion in enumerate(self.library.motions):
                out[i] += self.terms[term].effect.torque_along(motion, theta)
        if fit.inexact:
            basis = inexact_links(robot)
            change = basis @ fit.theta[-basis.shape[1] :]
            for i, motion in enumerate(self.library.motions):
                out[i] += LinkInertia(robot).torque_along(motion, change)
        return out


def _subtract(rows: FloatArray, term: Term, theta: FloatArray) -> None:
    if term.row is None:
        rows -= term.columns @ theta
    else:
        rows[:, term.row] -= term.columns @ theta
