"""diagnose: from recordings and a nominal model to the causes of what the model gets wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import stats

from sysid_ros.diagnosis.channel_faults import Fault, find_faults, undo, wrong_robot
from sysid_ros.diagnosis.covariance import with_knobs
from sysid_ros.diagnosis.extended_model import extended_model
from sysid_ros.diagnosis.fault_findings import as_unit, finding_of, signal_findings
from sysid_ros.diagnosis.faults import refusal_of
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.forward_simulation import forward_simulation
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.leftover import Leftover, leftovers
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.parameters import coulomb_part, parameters
from sysid_ros.diagnosis.prepare import Prepared, prepare
from sysid_ros.diagnosis.recording import Recording
from sysid_ros.diagnosis.result import Diagnosis, Finding, Predictions, SimulationError, TorqueRmse
from sysid_ros.diagnosis.selection import EXPECTED, Selection
from sysid_ros.diagnosis.sentences import sentence
from sysid_ros.diagnosis.term import DRY, Term
from sysid_ros.exceptions import DataError
from sysid_ros.model_file import ModelFile
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_HELD_OUT = 0.3
"""Part of the recordings that is held out where no others are given to judge on."""
_TOLD = 5.0
"""Log-likelihood by which a rival must be worse to be told from a finding."""
_MOST_RIVALS = 8
_SAMPLING = 3e-3
"""Shorter delays come from sampling [s]."""
_LEFT = 0.1
"""Part of the nominal residual's power that may be left where it counts as explained."""

Progress = Callable[[str], None]
Values = dict[Term, tuple[FloatArray, FloatArray]]


def diagnose(
    robot: RobotModel,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    known: ModelFile | None = None,
    progress: Progress = lambda sentence: None,
    provenance: dict[str, Any] | None = None,
) -> Diagnosis:
    """What is wrong with the nominal model of a robot.

    Args:
        robot: the nominal model. recordings: to fit on. validation: to judge on, never fitted; without any, the last part of the
            recordings is held out.
        known: a model that was identified before; it is the nominal model then.
        progress: called with what is being done. provenance: written into the extended model.

    Raises:
        DataError: no recording is given, or its channels do not fit the robot.
    """
    _check(robot, [*recordings, *validation])
    if reason := refusal_of(robot, recordings):
        return Diagnosis("refused", robot.joint_names, refusal=reason)
    fitted, judged = (list(recordings), list(validation)) if validation else _split(recordings)
    effects = known.known_effects(robot) if known else []
    progress("looking for faults of units, signs and order")
    faults = [] if known else find_faults(robot, fitted)
    raw = prepare(robot, judged, effects)
    signals = signal_findings(fitted, judged, robot.joint_names)
    for fault in faults:
        fitted, judged = ([undo(r, fault.effect) for r in part] for part in (fitted, judged))
    if not known and (reason := wrong_robot(robot, fitted)):
        return Diagnosis("refused", robot.joint_names, refusal=reason)
    progress("filtering")
    train = prepare(robot, fitted, effects)
    library = Library(robot, train.band)
    progress("computing what each effect would do")
    selection = Selection(train.problem, library, train.nominal, progress=progress)
    fit = selection.run()
    progress("judging on held-out data")
    held = HeldOut.of(robot, prepare(robot, judged, effects) if faults else raw, fit)
    values = with_knobs(train.problem, library, fit)
    found = _report(robot, train, selection, fit, held, values)
    found = replace(found, findings=tuple(as_unit(found.findings, robot.joint_names)))
    if faults or signals:
        first = [finding_of(f, robot.joint_names, len(train.band.f)) for f in faults]
        found = _with_faults(found, first, signals, faults, raw, held, fit)
    model = extended_model(robot, known, fit, values, train, float(recordings[0].t[0]), provenance or {})
    progress("simulating")
    return replace(found, model=model, simulation=_simulation(robot, held, fit))


def _simulation(robot: RobotModel, held: HeldOut, fit: Fit) -> SimulationError:
    rotor = np.zeros(robot.n)
    for term in fit.terms:
        if term.id == "rotor_inertia":
            rotor[term.row] += max(float(fit.theta_of(term)[0]), 0.0)
    motions = held.prepared.motions
    return forward_simulation(robot, motions, held.prepared.nominal, held.predictions(fit, robot), rotor)


def _check(robot: RobotModel, recordings: Sequence[Recording]) -> None:
    if not recordings:
        raise DataError("no recording is given. Give at least one bag.")
    for recording in recordings:
        if recording.q.shape[1] != robot.n:
            raise DataError(
                f"{recording.name} has {recording.q.shape[1]} joints, the robot has {robot.n}: {', '.join(robot.joint_names)}."
            )


def _split(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """The first and the last part of each recording."""
    first: list[Recording] = []
    last: list[Recording] = []
    for r in recordings:
        cut = int(np.searchsorted(r.t, r.t[0] + (1.0 - _HELD_OUT) * r.seconds))
        for part, s, word in ((first, slice(None, cut), "first part"), (last, slice(cut, None), "held-out part")):
            v = None if r.v is None else r.v[s]
            part.append(replace(r, name=f"{r.name} ({word})", t=r.t[s], q=r.q[s], v=v, tau=r.tau[s]))
    return first, last


def _groups(terms: Sequence[Term]) -> dict[tuple[str, tuple[int, ...]], list[Term]]:
    """Terms of one finding: those with the same name, and each coupling of two joints by itself."""
    groups: dict[tuple[str, tuple[int, ...]], list[Term]] = {}
    for term in sorted(terms, key=lambda t: t.joints):
        key = (term.id, term.joints if term.id == "joint_coupling" else ())
        groups.setdefault(key, []).append(term)
    return groups


def _beside_coulomb(terms: Sequence[Term], n: int) -> list[Term]:
    """Richer forms of dry friction where most joints have the simplest: their Coulomb part is named with the others'."""
    plain = [t for t in terms if t.id == "coulomb_friction"]
    rich = [t for t in terms if t.id in DRY and t.id != "coulomb_friction"]
    return rich if len(plain) >= len(rich) and len(plain) + len(rich) > n // 2 else []


def _rivals(selection: Selection, terms: Sequence[Term]) -> tuple[str, ...]:
    """Effects that explain the rows as well as the terms of a finding do."""
    if terms[0].id in EXPECTED and len(terms) > 2:
        return ()
    close = [
        p.terms[0].id
        for p in selection.rivals(terms)
        if p.terms and p.fit.loglik > selection.fit.loglik - _TOLD and p.terms[0].id != terms[0].id
    ]
    return tuple(dict.fromkeys(close))


def _report(robot: RobotModel, train: Prepared, selection: Selection, fit: Fit, held: HeldOut, values: Values) -> Diagnosis:
    problem, n = train.problem, robot.n
    active = problem.active
    before, after = held.prepared.problem.y, held.residual(fit)
    noise = fit.noise.variance(held.prepared.band.f)
    floor = held.rms(np.sqrt(noise))
    weight = np.zeros(n)
    weight[active] = 1.0 / np.maximum(floor[active], 1e-9) ** 2
    power_before = float(np.sum(held.rms(before) ** 2 * weight))
    excess = float(np.sum(np.maximum(held.rms(after) ** 2 - floor**2, 0.0) * weight))
    unexplained = min(1.0, excess / max(power_before, 1e-12))
    findings = []
    groups = _groups(fit.terms)
    rich = _beside_coulomb(fit.terms, n)
    for (name, _), terms in groups.items():
        if name == "time_delay" and abs(float(fit.theta_of(terms[0])[0])) < _SAMPLING:
            continue  # in the model, but no fault: the effort is held between two samples
        others = [t for t in fit.terms if t not in terms]
        if name == "coulomb_friction":
            others = [t for t in others if t not in rich]
        elif any(t in rich for t in terms):
            others += [selection.library.local("coulomb_friction", t.joints[0]) for t in terms]
            held.add(others)
        rest = problem.fit(others, fit.noise, inexact=fit.inexact)
        without = held.residual(rest)
        gain = float(np.sum((held.rms(without) ** 2 - held.rms(after) ** 2) * weight)) / max(power_before, 1e-12)
        cost = sum(t.cost for t in terms)
        rise = 2.0 * (fit.loglik - rest.loglik)
        rows = len(train.band.f) * (len(active) if terms[0].row is None else len(terms))
        found = tuple(p for t in terms for p in parameters(t, *values[t]))
        if name == "coulomb_friction" and rich:
            terms = sorted([*terms, *rich], key=lambda t: t.joints)
            found = tuple(p for t in terms for p in coulomb_part(t, *values[t]))
        joints = tuple(dict.fromkeys(robot.joint_names[j] for t in terms for j in t.joints))
        findings.append(
            Finding(
                id=name,
                label=terms[0].effect.label,
                joints=joints,
                parameters=found,
                heldout_gain=min(gain, 1.0),
                delta_bic=rise - cost * float(np.log(rows)),
                p_value=float(min(1.0, stats.chi2.sf(max(rise, 0.0), cost) * selection.tried)),
                cannot_be_told_from=_rivals(selection, terms) if len(groups) <= _MOST_RIVALS else (),
                sentence=sentence(terms[0].effect.label, joints, found, gain),
                signature=terms[0].effect.signature,
                separated_by=terms[0].effect.separated_by,
            )
        )
    findings.sort(key=lambda f: -f.heldout_gain)
    follows = leftovers(train, fit, held.prepared, after)
    if follows:
        rms = held.rms(after)
        lost = sum(x.share * rms[x.joint] ** 2 * weight[x.joint] for x in follows)
        unexplained = min(1.0, max(unexplained, float(lost) / max(power_before, 1e-12)))
    verdict = (
        "nothing_wrong"
        if not findings and not follows
        else "unexplained"
        if not findings
        else "explained"
        if unexplained <= _LEFT
        else "partly_explained"
    )
    torque = held.rms(held.prepared.band.rows([m.tau for m in held.prepared.motions]))
    return Diagnosis(
        verdict=verdict,
        joints=robot.joint_names,
        findings=tuple(findings),
        torque=TorqueRmse(robot.joint_names, held.rms(before), held.rms(after), floor, torque),
        unexplained_fraction=unexplained,
        unexplained=_in_words(robot, follows),
        record_next=_record_next(findings),
        predictions=_predictions(robot, held, fit),
    )


def _with_faults(
    found: Diagnosis,
    first: list[Finding],
    signals: list[Finding],
    faults: Sequence[Fault],
    raw: Prepared,
    held: HeldOut,
    fit: Fit,
) -> Diagnosis:
    """The diagnosis with the faults of the channels before its causes, and its torques as they are published."""
    assert found.torque is not None
    assert found.predictions is not None
    rows, floor, extended = held.residual(fit), found.torque.noise_floor[None], found.predictions.extended
    for fault in reversed(faults):
        rows, extended = fault.effect.publish(rows), fault.effect.publish(extended)
        floor = np.abs(fault.effect.publish(floor))
    torque, predictions = found.torque, found.predictions
    if faults:
        measured = np.concatenate([m.tau for m in raw.motions])
        torque = TorqueRmse(
            found.joints,
            held.rms(raw.problem.y),
            held.rms(rows),
            floor[0],
            held.rms(raw.band.rows([m.tau for m in raw.motions])),
        )
        predictions = replace(predictions, measured=measured, nominal=np.concatenate(raw.nominal), extended=extended)
    # the share of each later cause is that of what the faults leave
    left = 1.0 - max((f.heldout_gain for f in first), default=0.0)
    later = [replace(f, heldout_gain=left * f.heldout_gain) for f in found.findings]
    findings = tuple(first) + tuple(sorted([*later, *signals], key=lambda f: -f.heldout_gain))
    verdict = "explained" if found.verdict == "nothing_wrong" else found.verdict
    return replace(found, verdict=verdict, findings=findings, torque=torque, predictions=predictions)


def _in_words(robot: RobotModel, follows: Sequence[Leftover]) -> str:
    if not follows:
        return ""
    parts = [f"on {robot.joint_names[x.joint]} it follows the {', the '.join(x.follows[:2])}" for x in follows[:3]]
    return f"What is left still depends on the motion: {'; '.join(parts)}. No effect that is known here describes it."


def _record_next(findings: Sequence[Finding]) -> tuple[str, ...]:
    return tuple(
        f"To tell {f.id} from {' and '.join(f.cannot_be_told_from)}: {f.separated_by}." for f in findings if f.cannot_be_told_from
    )


def _predictions(robot: RobotModel, held: HeldOut, fit: Fit) -> Predictions:
    motions = held.prepared.motions
    return Predictions(
        t=np.concatenate([m.t for m in motions]),
        joints=robot.joint_names,
        measured=np.concatenate([m.tau for m in motions]),
        nominal=np.concatenate(held.prepared.nominal),
        extended=np.concatenate(held.predictions(fit, robot)),
        q=np.concatenate([m.q for m in motions]),
        v=np.concatenate([m.v for m in motions]),
        a=np.concatenate([m.a for m in motions]),
    )
