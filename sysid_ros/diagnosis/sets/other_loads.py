"""What is carried in recordings that were not fitted, where it is something else than in those that were.

Tools are changed between recordings. A model that is judged on one with another tool is wrong there by what that weighs, and
every cause is misjudged. That one recording has another payload is a cause like any other: it is weighed beside them on all
recordings together, and its torque alone is taken from what was measured, as if the recording carried what the others do.

A constant says nothing of what is carried: where a recording hardly moves, whatever is wrong with a model in that posture is one,
and the stretches of that recording all tell the same. Each joint has one of its own in each recording, as large as its torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sysid_ros.diagnosis.claims import LIKELIER
from sysid_ros.diagnosis.covariance import with_knobs
from sysid_ros.diagnosis.fit import Problem, allowed
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared, assemble
from sysid_ros.diagnosis.scoring import event
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.sets.long_recordings import thinned, too_long
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects.wording import capital
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, eq=False)
class OtherLoad:
    """What one recording carries beside what the fitted ones do.

    Attributes:
        term: of the effect. theta: its parameters, shape (effect.p,). words: what it is told as.
    """

    term: Term
    theta: FloatArray
    words: str

    def in_words(self) -> str:
        """A sentence for an engineer."""
        return f"{capital(self.words)}: the torque of that is taken from what was measured there before anything is judged on it."


def other_loads(robot: RobotModel, train: Prepared, selection: Selection, held: Prepared) -> list[OtherLoad]:
    """Of the recordings that were not fitted those that carry something else, if that is in the most probable set of causes.

    Nothing is asked where a body is picked up or set down in a recording: when that was is found anew in the held-out ones, and
    may be before they begin.

    Args:
        selection: what was found in the fitted recordings, ``train``. held: the others.
    """
    new = {m.recording for m in held.motions} - {m.recording for m in train.motions}
    if not new or any(t.instant is not None for t in selection.fit.terms):
        return []
    both = assemble(
        robot, [*train.motions, *held.motions], [*train.nominal, *held.nominal], train.band.silent, train.problem.gains
    )
    both = _with_constants(thinned(robot, both) if too_long(both) else both, sorted(new))
    library = Library(robot, both.band)
    options = [t for t in library.whole_options(lambda kind: kind.of_recording) if t.recording in new]
    found = selection.on(both.problem, library, both.nominal)
    step = event(both.problem, library, found.fit, options, partial(allowed, both.problem), found.price)
    if step is None:
        return []
    found.fit, found.pool = step.fit, [*found.pool, *options]
    found.climb()
    loads = [t for t in found.fit.terms if t.effect.of_recording and t.recording in new]
    if not loads:
        return []
    values, out = with_knobs(both.problem, library, found.fit), []
    for term in loads:
        known, own, others = values.of[term], slice(0, term.p), [t for t in found.fit.terms if t is not term]
        if found.prior.surely(term, others, known.values[own], known.covariance[own, own]) < LIKELIER:
            continue
        parameters = term.effect.as_parameters(known.values, known.covariance, known.basis)
        out.append(OtherLoad(term, term.theta_of_effect(known.values), term.effect.in_words(parameters, "")))
    return out


def _with_constants(both: Prepared, recordings: Sequence[str]) -> Prepared:
    """The same with a constant of each joint in each of some recordings, of unknown size, beside the inexact links."""
    n, rows, links = both.band.n, [], both.problem
    for name in recordings:
        for j in range(n):
            one = np.zeros(n)
            one[j] = 1.0
            rows.append(both.band.rows([np.tile(one * (m.recording == name), (len(m.t), 1)) for m in both.motions]))
    size = np.sqrt(np.mean(np.concatenate([m.tau for m in both.motions]) ** 2, axis=0))
    own = np.tile(np.maximum(size, np.finfo(float).eps), len(recordings))
    columns = np.concatenate([np.stack(rows, axis=2), links.nuisance], axis=2)
    std = np.concatenate([own, 1.0 / np.sqrt(links.usual_prior)])
    scaled_by = np.concatenate([np.zeros(len(own), dtype=np.intp), links.scaled_by])
    return replace(both, problem=Problem(both.band, links.y, columns, std, scaled_by, links.links))


def without_loads(held: Prepared, loads: Sequence[OtherLoad]) -> Prepared:
    """Recordings as if they carried what the fitted ones do."""
    if not loads:
        return held
    return held.less([sum((x.term.effect.torque_along(m, x.theta) for x in loads), np.zeros_like(m.tau)) for m in held.motions])
