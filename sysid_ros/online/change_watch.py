"""ChangeWatch: takes rows into the estimator, finds changes of the payload, and keeps forces that pass out of the estimate."""

from __future__ import annotations

import copy
import math

import numpy as np

from sysid_ros.estimators import Estimate, Estimator
from sysid_ros.online.change_trial import ChangeTrial, Verdict
from sysid_ros.online.free_parameters import PAYLOAD, FreeParameters
from sysid_ros.online.front_end import FrontEnd
from sysid_ros.online.model_evidence import ModelEvidence
from sysid_ros.online.payload_events import EventLog
from sysid_ros.online.put_down import SELDOM, with_row
from sysid_ros.online.rows import Rows
from sysid_ros.online.standstill import Standstill
from sysid_ros.online.tare import Tare
from sysid_ros.online.told_links import RowsSoFar
from sysid_ros.robot.urdf_bodies import reach
from sysid_ros.sample import FloatArray

_UNEXPLAINED = 1.2
"""Rows that do not fit, and that no jump explains, are a change all the same after so long [memories of the low-pass]."""


class ChangeWatch:
    """Between the rows and the estimator.

    Where the estimator finds a jump, or does not find what makes the rows misfit, an arm's rows since then are made again without
    what came before (:class:`.RowHistory`), what is carried starts anew from them, and a :class:`.ChangeTrial` keeps what was
    known before. Where that turns out to be no body, it is put back, and nothing is learned until it fits again.

    Args:
        free: what is estimated. log: takes the events.

    Attributes:
        tare: taken from what is estimated. trial: of the newest change, while it is not known what it was.
        standstill: what may have changed while the arm hardly moves. rows_so_far: what a tare may learn the links from.
        evidence: takes in the rows of an arm while nothing changes, to tell by how much its model is wrong; None where efforts do
            not hold what it weighs.
    """

    def __init__(self, free: FreeParameters, log: EventLog) -> None:
        self._free, self._log = free, log
        self._reach, self._prior_std = reach(free.model.robot), free.prior_std[PAYLOAD]
        self.tare = Tare()
        self.trial: ChangeTrial | None = None
        self.standstill = Standstill(self._prior_std**2)
        self._put_down = 0.0
        self.rows_so_far = RowsSoFar(free)
        self.evidence: ModelEvidence | None = None

    def take_tare(
        self, estimator: Estimator, front_end: FrontEnd | None, floor: FloatArray
    ) -> tuple[Estimator, tuple[float, float]]:
        """What is carried counts as nothing from now on: the estimator that goes on, and the mass [kg] with its standard
        deviation. Where the rows so far tell what the links are wrong by, that and what is carried become known; else the
        estimate is taken off from all that come."""
        told = None
        if front_end is not None and self.trial is None and not estimator.misfits:
            told = self.rows_so_far.tell(front_end, floor)
        if told is None or front_end is None:
            repeated = self._free.repeated_covariance(estimator, front_end, floor) if front_end else np.zeros((10, 10))
            self.tare = Tare.of(estimator, repeated)
            variance = float(estimator.covariance()[0, 0] + repeated[0, 0])
            return estimator, (float(self.tare.theta[0]), float(np.sqrt(variance)))
        front_end.settle_links(self._free.error_directions(), told.mean, told.root)
        self.rows_so_far.clear()
        self.standstill.clear()
        self.tare = Tare(taken=True)
        return told.estimator, told.mass

    def unlearn(self, estimator: Estimator | None) -> bool:
        """Forget all rows where their times turn out to have been wrong before the noise is known, which would be learned from
        them for minutes to come; whether that is so."""
        if estimator is None or estimator.noise_known:
            return False
        estimator.reset()
        self.rows_so_far.clear()
        self.standstill.clear()
        return True

    def stand(self, rows: Rows, quiet: bool, estimator: Estimator, front_end: FrontEnd) -> None:
        """Look whether the torques of an arm that hardly moves have changed."""
        hidden = self._free.hidden_variance(rows, estimator) if quiet and estimator.noise_known else None
        self.standstill.add(rows, quiet, estimator, hidden, front_end.memory, self.tare.theta)

    def take_on_trial(
        self, rows: Rows, hold: bool, estimator: Estimator, front_end: FrontEnd, trial: ChangeTrial
    ) -> tuple[Estimator, Estimate]:
        """Take in a row; the estimator that goes on, and what it says. ``hold``: nothing excites the parameters."""
        trial.compare(rows.Y, rows.y, self._free.extra_variance(rows, trial.before, front_end.passed), estimator, hold)
        if trial.force:
            innovation = rows.y - rows.Y @ estimator.theta
            estimate = Estimate(estimator.theta, innovation, "outlier", "a force acts on the robot")
        else:
            known, jumps = estimator.noise_known, estimator.jumps
            extra = self._free.extra_variance(rows, estimator, front_end.passed)
            estimate = estimator.update(rows.Y, rows.y, hold, extra, rows.considered)
            estimator.compensate(rows.noise, hold, extra)
            if self.evidence is not None and estimate.status == "ok" and not hold and self._due(self.evidence):
                self.evidence.add_since(rows, self._free.friction_slice, self._free.gained)
            if estimator.jumps != jumps or estimator.misfits:
                estimate = self.changed(rows, hold, estimator, front_end, estimate, estimator.jumps != jumps, known)
        assert self.trial is not None
        return self._follow(self.trial, rows.t, hold, estimator, front_end), estimate

    def status(self, t: float, status: str, reason: str) -> tuple[str, str]:
        """What is said at ``t`` [s] in place of a status and its reason while something has changed."""
        if status not in ("ok", "no_payload", "warming_up"):
            return status, reason
        if self.trial is None:
            return "warming_up", self.standstill.told
        since = f"{t - self.trial.t:.1f} s"
        if self.trial.force:
            what = "A force that no body fixed to the robot makes acts on it: a contact, or a load that moves by itself"
            return "inconsistent", f"{what}. That began {since} ago; what was carried before is held."
        return "warming_up", f"Something changed {since} ago; whether it is a body is not known yet. Keep moving."

    def watch(
        self, rows: Rows, hold: bool, extra: FloatArray | None, estimator: Estimator, front_end: FrontEnd, estimate: Estimate,
        jumped: bool, known: bool, carries: bool,
    ) -> Estimate:  # fmt: skip
        """After a row, while no trial is open: look whether something has changed; the estimate then.

        Args:
            extra: variance of the row beside its noise, shape (n,). estimate: of the row. jumped: the estimator found a jump.
            known: it knew the noise before the row. carries: that something is carried has been told.
        """
        gone = False
        if not carries or hold or not front_end.makes_anew:
            self._put_down = 0.0
        elif extra is not None and estimator.noise_known and estimate.status != "not_finite":
            noise = estimator.noise_variance, estimator.row_variance, front_end.passed, extra, self._free.extra_colour
            self._put_down = with_row(self._put_down, rows.Y, rows.y, estimate.theta, self.tare.theta, *noise)
            gone = self._put_down > 0.0 and self._put_down > math.log(SELDOM / front_end.period)
        if estimate.status != "not_finite" and (jumped or gone or estimator.misfits):
            return self.changed(rows, hold, estimator, front_end, estimate, jumped, known, gone)
        if not hold:
            self.rows_so_far.rows.append(rows)
            if self.evidence is not None and estimator.noise_known and estimate.status == "ok" and self._due(self.evidence):
                self.evidence.add(rows, self._free.friction_slice, self._free.gained)
        return estimate

    @staticmethod
    def _due(evidence: ModelEvidence) -> bool:
        """Count a row; whether it is one to be taken in."""
        evidence.waits += 1
        return evidence.waits >= evidence.every

    def changed(
        self, rows: Rows, hold: bool, estimator: Estimator, front_end: FrontEnd, estimate: Estimate, jumped: bool, known: bool,
        gone: bool = False,
    ) -> Estimate:  # fmt: skip
        """After a row that shows a jump, or one of a run that does not fit: look what has changed; the estimate then.

        Args:
            estimate: of the row. jumped: the estimator found a jump. known: it knew the noise before the row. gone: rows since a
                while say that nothing is carried any more.
        """
        period = front_end.period
        if not front_end.makes_anew:
            if jumped and known:
                mass = self._mass_before(estimator.before_jump)
                t = rows.t - front_end.delay - estimator.found_after * period
                self._log.add(t, mass, mass + float(estimator.last_jump[0]))
            return estimate
        if not (jumped or gone) and estimator.misfits * period < _UNEXPLAINED * front_end.memory:
            return estimate
        if not jumped:
            estimator.undo_misfits()
        before = copy.deepcopy(estimator)
        if self.evidence is not None and self.trial is not None:
            self.trial.likelier_until = self.evidence.another(self.trial.change(before))
        t, since = self._begin_anew(before, estimator, hold, front_end)
        if known and (self.trial is None or self.trial.rests(t)):
            mass, outer = self._mass_before(before.theta), self.trial
            if outer is not None:
                self._close_outer(outer)  # two that are open are enough: what the oldest began with has been carried since
            about = self._reach, self._prior_std, self._free.empty
            self.trial = ChangeTrial(before, t, mass, *about, front_end, outer=outer)
        elif self.trial is not None:
            began = self.trial.t
            self.trial.jumped(t, before)
            self._log.move(began, self.trial.t)
        if known and self.trial is not None:
            self._log.add(t, self._mass_before(before.theta), self.trial.mass_after(estimator, self.tare))
        return since or estimate

    def _mass_before(self, theta: FloatArray) -> float:
        return float(theta[0] - self.tare.theta[0])

    def _begin_anew(
        self, before: Estimator, estimator: Estimator, hold: bool, front_end: FrontEnd
    ) -> tuple[float, Estimate | None]:
        """Let the estimator forget what is carried, and learn it from the rows since the change: when that was [s], and what the
        estimator says of the last of them. ``before``: as it was before the change."""
        prior_variance = self._free.prior_std[PAYLOAD] ** 2
        self._put_down = 0.0
        self._drop_evidence()
        t, since = front_end.since_change(before.theta, before.row_variance, prior_variance)
        estimator.forget()
        self.rows_so_far.clear()
        estimate = None
        for rows in since:
            extra = self._free.extra_variance(rows, estimator, front_end.passed)
            estimate = estimator.update(rows.Y, rows.y, hold, extra, rows.considered)
            estimator.compensate(rows.noise, hold, extra)
        return t, estimate

    def _close_outer(self, trial: ChangeTrial) -> None:
        """A trial that was open when another one began is not followed any more: what it was is what is known until then."""
        if trial.outer is not None and not (trial.outer.force or trial.outer.changed_by(trial.before)):
            self._log.take_back(trial.outer.t)
        trial.outer = None

    def _drop_evidence(self) -> None:
        """Rows since a change that is taken for another one now, or for a force, are no payload's."""
        if self.evidence is not None:
            self.evidence.drop()

    def _follow(self, trial: ChangeTrial, t: float, hold: bool, estimator: Estimator, front_end: FrontEnd) -> Estimator:
        """Whether what has changed is a body, after a row of ``t`` [s]; the estimator that goes on."""
        was_force = trial.force
        verdict = trial.judge(t, estimator, self.tare, self.evidence.another if self.evidence is not None else None)
        if verdict is Verdict.BODY:
            self.trial = None
            if self.evidence is not None:
                self.evidence.renew()
            self._log.body((trial.after or trial).t, t, trial.mass, self._mass_before(estimator.theta))
            self._close_outer(trial)
        elif verdict in (Verdict.SAME, Verdict.BEFORE):
            self._log.withdraw((trial.after or trial).t)
            if verdict is Verdict.SAME:
                estimator.combine(PAYLOAD, trial.before.parts(PAYLOAD))
            else:
                estimator = trial.before
            self.trial = trial.resumed_outer()
            if self.evidence is not None and self.trial is None:
                self.evidence.same()
        elif verdict is Verdict.DOUBT:
            estimator = copy.deepcopy(trial.before)
            trial.jumped(self._begin_anew(trial.before, estimator, hold, front_end)[0])
        elif verdict is Verdict.FORCE and not was_force:
            estimator = copy.deepcopy(trial.before)
            self._drop_evidence()
            self._log.force((trial.after or trial).t, trial.mass)
        elif verdict is Verdict.PASSED:
            if not was_force:
                self._log.force((trial.after or trial).t, trial.mass)
            estimator, self.trial = trial.before, trial.resumed_outer()
            front_end.rest()
        elif verdict is Verdict.ALL_PASSED:
            assert trial.outer is not None
            self._log.force(trial.outer.t, trial.outer.mass)
            estimator, self.trial = trial.outer.before, None
            front_end.rest()
        elif verdict is Verdict.AGAIN:
            estimator = copy.deepcopy(trial.before)
            estimator.widen(trial.strain)
            estimator.forget()
            self.trial = trial.once_more(t, front_end)
            front_end.rest()
        return estimator
