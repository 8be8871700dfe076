"""What the present parameters of causes change of the rows, and of what links that are off do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term


def lean(library: Library, fit: Fit) -> None:
    """Let a library know what the terms of a fit make of links that are off, where its links are, and of all columns."""
    terms = fit.terms if fit.inexact else [t for t in fit.terms if t.effect.low_passes]
    library.lean(terms, [fit.theta_of(t) for t in terms])


def correct(problem: Problem, library: Library, terms: Sequence[Term]) -> None:
    """Rows of a problem with what terms change of the measured torque, and its links with what they have because of them.

    On a tilted base a link that is off has gravity from another side: a torque of the tilt times what the link is off by. It
    stands in the columns of what changes links, with the present tilt (:meth:`.Library.lean`); what the columns of the tilt have
    of it, with the present links, goes to the rows, so that it counts once.
    """
    rows = library.correction(terms, problem.nominal)
    for term in terms:
        carried = term.effect.settings.get("links")
        if carried and term.effect.leans and library.leans:
            twice = library.leaning(np.asarray(carried))
            rows = twice if rows is None else rows + twice
    problem.correct(rows, library.moved(problem.links))
