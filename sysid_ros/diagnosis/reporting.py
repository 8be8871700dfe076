"""From a fit to what is claimed: findings with their evidence, the torques on held-out data, the verdict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.covariance import Estimates
from sysid_ros.diagnosis.events import in_words
from sysid_ros.diagnosis.evidence import Evidence, heldout_gain
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.leftover import Leftover, leftovers
from sysid_ros.diagnosis.link_masses import tolerated
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.result import Diagnosis, Finding, Predictions, TorqueRmse
from sysid_ros.diagnosis.rivals import rivals
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.sentences import sentence
from sysid_ros.diagnosis.term import Term
from sysid_ros.diagnosis.time_or_temperature import RECORD_NEXT, SIGNATURE, correlations, drift_cause
from sysid_ros.effects import EFFECTS, Parameter
from sysid_ros.effects.parameter import by_delta_method
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_MOST_RIVALS = 8
_STRONG = 10.0
"""Difference of the BIC from which evidence is very strong (Kass, Raftery 1995)."""
_SURE = 0.05
"""Probability, times the number of candidates tried, up to which what every arm has is claimed however little it gains."""
_GAINS = 0.02
"""Part of the residual's power on data that was not fitted, from which an effect is claimed however much it scatters."""
_SCATTERS = "What looks like {} differs so much from time to time that it may be something else."
_LEFT, _LEFT_SEEN = 0.1, 0.005
"""Part of the nominal residual's power that may be left where it counts as explained, and where it is seen to be no noise."""
_BEYOND = 4.0
"""Held-out error of a joint over its noise floor, in all and each frequency over its own, that is no noise. A floor learned on
other motion may be off by much: what coarse encoders cost in acceleration depends on the speed."""
_WORSE = 1.2
"""Error on held-out data, over that of the nominal model and over the noise floor, from which a joint's model is called worse."""

Values = dict[Term, Estimates]


def report(robot: RobotModel, train: Prepared, selection: Selection, fit: Fit, held: HeldOut, values: Values) -> Diagnosis:
    """The findings of a fit, in order of gain, and what they gain on the held-out recordings.

    Args:
        train: what was fitted. held: what it is judged on. values: of each term, with their covariance.
    """
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
    rich = _beside_simplest(fit.terms, n)
    undecided = False
    scattering: list[str] = []
    for (name, _), terms in groups.items():
        if not any(t.effect.notable(fit.theta_of(t)) for t in terms):
            continue  # in the model, but no fault
        others = [t for t in fit.terms if t not in terms]
        richer = [t for t in rich if t.simplest is terms[0].kind]
        if richer:
            others = [t for t in others if t not in richer]
        elif any(t in rich for t in terms):
            others += [selection.library.local(t.simplest.id, t.joints[0]) for t in terms if t.simplest]
            held.add(others)
        rest = problem.fit(others, fit.noise, inexact=fit.inexact)
        without = held.residual(rest)
        gain = heldout_gain(held.rms(without) ** 2 * weight, held.rms(after) ** 2 * weight, power_before)
        cost = sum(t.cost for t in terms)
        rise = 2.0 * (fit.loglik - rest.loglik) / max(values[t].scatter for t in terms)
        rows = len(train.band.f) * (len(active) if terms[0].row is None else len(terms))
        evidence = Evidence(rise, cost, rows, selection.tried, gain)
        weak = evidence.p_value > _SURE if terms[0].expected else evidence.delta_bic < _STRONG
        if weak and gain < _GAINS:
            continue  # in the model, but not claimed: its scatter over time leaves too little of its evidence
        found = tuple(p for t in terms for p in t.effect.as_parameters(*values[t][:2], t.basis))
        if richer:
            terms = sorted([*terms, *richer], key=lambda t: t.joints)
            found = tuple(_dry_friction(t, values[t]) for t in terms)
        if evidence.p_value > _SURE:
            scattering.append(terms[0].effect.label)
        joints = tuple(dict.fromkeys(robot.joint_names[j] for t in terms for j in t.joints))
        words = sentence(terms[0].effect.label, joints, found, gain, n)
        drift = drift_cause(problem, selection.library, fit, held, terms, floor)
        if drift is not None:
            words, undecided = f"{words} {drift.in_words()}", undecided or not drift.decided
        findings.append(
            Finding(
                id=name,
                label=terms[0].effect.label,
                joints=joints,
                parameters=found,
                heldout_gain=evidence.gain,
                delta_bic=evidence.delta_bic,
                p_value=evidence.p_value,
                cannot_be_told_from=rivals(selection, [t for t in terms if t in fit.terms], len(groups) <= _MOST_RIVALS),
                sentence=words,
                signature=SIGNATURE if drift is not None and drift.over == "temperature" else terms[0].effect.signature,
                separated_by=terms[0].effect.separated_by,
                drift=None if drift is None else drift.as_dict(),
                log10_p=evidence.log10_p,
            )
        )
    findings = _companions_last(findings)
    follows = leftovers(train, fit, held.prepared, after)
    if follows:
        rms = held.rms(after)
        lost = sum(x.share * rms[x.joint] ** 2 * weight[x.joint] for x in follows)
        unexplained = min(1.0, max(unexplained, float(lost) / max(power_before, 1e-12)))
    worse = _worse(robot, held.rms(before), held.rms(after), floor)
    beyond = _beyond(held, after, noise)
    verdict = (
        "nothing_wrong"
        if not findings and not follows and not beyond
        else "unexplained"
        if not findings
        else "explained"
        if unexplained <= (_LEFT_SEEN if follows else _LEFT) and not worse and not scattering
        else "partly_explained"
    )
    torque = held.rms(held.prepared.band.rows([m.tau for m in held.prepared.motions]))
    if nothing := _explains_nothing(robot, held.rms(after), torque):
        verdict = "unexplained"
    predictions = _predictions(robot, held, fit)
    return Diagnosis(
        verdict=verdict,
        joints=robot.joint_names,
        findings=tuple(findings),
        torque=TorqueRmse(robot.joint_names, held.rms(before), held.rms(after), floor, torque),
        unexplained_fraction=unexplained,
        unexplained=nothing or _in_words(robot, follows) or _beyond_in_words(robot, beyond, held.rms(after), floor),
        record_next=(*_record_next(findings), *([RECORD_NEXT] if undecided else [])),
        predictions=predictions,
        temperature=correlations(predictions),
        notes=(
            *in_words(held.library, {t: held.terms[t] for t in fit.terms}),
            *worse,
            *(_SCATTERS.format(label) for label in scattering),
            *tolerated(robot, fit),
        ),
    )


def _explains_nothing(robot: RobotModel, after: FloatArray, torque: FloatArray) -> str:
    """That the model's error exceeds the torque itself on most joints, in words; else empty. rms, shape (n,) each."""
    larger = [name for j, name in enumerate(robot.joint_names) if after[j] > torque[j]]
    if 2 * len(larger) <= robot.n:
        return ""
    return (
        f"The model explains nothing: on held-out data its error exceeds the torque itself on {', '.join(larger)}. The causes "
        "above are not to be relied on; check that the efforts are joint torques in N m."
    )


def _worse(robot: RobotModel, before: FloatArray, after: FloatArray, floor: FloatArray) -> tuple[str, ...]:
    """Joints whose torque the extended model predicts worse than the nominal one, in words; rms, shape (n,) each."""
    return tuple(
        f"{robot.joint_names[j]}: on held-out data the extended model is worse than the nominal one ({after[j]:.3g} against "
        f"{before[j]:.3g} N m, noise floor {floor[j]:.3g} N m): what was found there does not hold on other motion. Record for "
        "longer, with this joint in fast and in slow moves of its own."
        for j in range(robot.n)
        if after[j] > _WORSE * max(before[j], floor[j])
    )


def _companions_last(findings: Sequence[Finding]) -> list[Finding]:
    """In order of gain; what an effect brings along comes after it, whichever gains more."""
    gain = {f.id: f.heldout_gain or 0.0 for f in findings}
    by_name = {f.id: f for f in reversed(findings)}
    for f in findings:
        other = by_name.get(EFFECTS[f.id].companion)
        if other is not None and set(other.joints) <= set(f.joints):
            gain[f.id] = max(gain[f.id], gain[other.id] + 1e-9)
    return sorted(findings, key=lambda f: -gain[f.id])


def _groups(terms: Sequence[Term]) -> dict[tuple[str, str], list[Term]]:
    """Terms of one finding: those of one effect, but for what keeps them apart, as an event."""
    groups: dict[tuple[str, str], list[Term]] = {}
    for term in sorted(terms, key=lambda t: t.joints):
        groups.setdefault((term.id, term.effect.apart), []).append(term)
    return groups


def _beside_simplest(terms: Sequence[Term], n: int) -> list[Term]:
    """Richer forms of dry friction where most joints have the simplest: their level is named with the others'."""
    out = []
    rubbing = [t for t in terms if t.effect.as_dry_friction(np.ones(t.effect.p)).any()]
    for kind in dict.fromkeys(t.simplest for t in rubbing if t.simplest):
        plain, rich = [t for t in rubbing if t.kind is kind], [t for t in rubbing if t.simplest is kind]
        if len(plain) >= len(rich) and len(plain) + len(rich) > n // 2:
            out += rich
    return out


def _dry_friction(term: Term, estimates: Estimates) -> Parameter:
    """The level of dry friction that any form of it has on its joint."""
    effect, (joint, *_) = term.effect, term.joints

    def level(x: FloatArray) -> float:
        return float(effect.as_dry_friction(x[: effect.p])[joint])

    return by_delta_method("Fc", effect.robot.joint_names[joint], effect.units[0], level, *estimates[:2])


def _in_words(robot: RobotModel, follows: Sequence[Leftover]) -> str:
    if not follows:
        return ""
    parts = [f"on {robot.joint_names[x.joint]} it follows the {', the '.join(x.follows[:2])}" for x in follows[:3]]
    return f"What is left still depends on the motion: {'; '.join(parts)}. No effect that is known here describes it."


def _beyond(held: HeldOut, after: FloatArray, noise: FloatArray) -> list[int]:
    """Joints whose held-out rows have far more than noise, of rows and variances of shape (K, n)."""
    in_all = np.sum(after**2, axis=0) > _BEYOND**2 * np.sum(noise, axis=0)
    in_each = np.mean(after**2 / noise, axis=0) > _BEYOND**2
    return [int(j) for j in held.prepared.problem.active if in_all[j] and in_each[j]]


def _beyond_in_words(robot: RobotModel, beyond: Sequence[int], after: FloatArray, floor: FloatArray) -> str:
    if not beyond:
        return ""
    parts = [f"{after[j]:.3g} N m on {robot.joint_names[j]} (noise floor {floor[j]:.3g} N m)" for j in beyond[:3]]
    return f"On held-out data more is left than noise: {', '.join(parts)}. No effect that is known here describes it."


def _record_next(findings: Sequence[Finding]) -> tuple[str, ...]:
    return tuple(
        f"To tell {f.id} from {' and '.join(f.cannot_be_told_from)}: {f.separated_by}." for f in findings if f.cannot_be_told_from
    )


def _predictions(robot: RobotModel, held: HeldOut, fit: Fit) -> Predictions:
    motions = held.prepared.motions
    warm = [np.full(m.q.shape, np.nan) if m.temperature is None else m.temperature for m in motions]
    return Predictions(
        t=np.concatenate([m.t for m in motions]),
        joints=robot.joint_names,
        measured=np.concatenate([m.tau for m in motions]),
        nominal=np.concatenate(held.prepared.nominal),
        extended=np.concatenate(held.predictions(fit, robot)),
        q=np.concatenate([m.q for m in motions]),
        v=np.concatenate([m.v for m in motions]),
        a=np.concatenate([m.a for m in motions]),
        temperature=np.concatenate(warm) if any(m.temperature is not None for m in motions) else None,
    )
