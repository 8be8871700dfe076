"""From a fit to what is claimed: findings, the torques on held-out data, what follows a temperature, which URDF, the verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sysid_ros.blackbox.ceiling import ceiling
from sysid_ros.blackbox.hybrid import Hybrid
from sysid_ros.diagnosis.claims import Judged, claims
from sysid_ros.diagnosis.drift_cause import RECORD_NEXT
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut, dates_in_words
from sysid_ros.diagnosis.leftover import Leftover, leftovers
from sysid_ros.diagnosis.result import Diagnosis, Finding, Predictions, RankedUrdf, Rest, TorqueRmse
from sysid_ros.effects.wording import listed
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_LEFT, _LEFT_SEEN = 0.1, 0.005
"""Part of the nominal residual's power that may be left where it counts as explained, and where it is seen to be no noise."""
_BEYOND = 4.0
"""Held-out error of a joint over its noise floor, in all and each frequency over its own, that is no noise. A floor learned on
other motion may be off by much: what coarse encoders cost in acceleration depends on the speed."""
_STATED = 0.01
"""Part of a mass from which it is stated."""
_WORSE = 1.2
"""Error on held-out data, over that of the nominal model and over the noise floor, from which a joint's model is called worse."""
_STANDS = 0.02
"""Speed from which the sign of a velocity means something [rad/s]."""


def report(judged: Judged) -> Diagnosis:
    """The findings of a fit, in order of gain, and what they gain on the held-out recordings."""
    robot, held, fit, nominal = judged.robot, judged.held, judged.fit, judged.held.prepared.problem.y
    findings = claims(judged)
    before, after, floor = held.rms(held.prepared.problem.measured), held.rms(judged.after), judged.floor
    power_before = max(float(np.sum(judged.power(nominal))), 1e-12)
    excess = np.maximum(after**2 - floor**2, 0.0) * judged.weight
    left = float(np.sum(excess)) / power_before
    unexplained = min(1.0, left)
    follows = leftovers(judged.train, fit, held.prepared, judged.after)
    if follows:
        lost = sum(x.share * after[x.joint] ** 2 * judged.weight[x.joint] for x in follows)
        unexplained = min(1.0, max(unexplained, float(lost) / power_before))
    judged_joints = np.isin(np.arange(robot.n), judged.train.problem.active)
    worse = _worse(robot, np.where(judged_joints, before, np.inf), after, floor)
    beyond = _beyond(held, judged.after, judged.noise)
    stood = [j for j in beyond if not judged_joints[j]]
    verdict = (
        "nothing_wrong"
        if not findings and not follows and not beyond
        else "unexplained"
        if not findings
        else "explained"
        if unexplained <= (_LEFT_SEEN if follows else _LEFT) and not worse and not stood
        else "partly_explained"
    )
    torque = held.rms(held.prepared.band.rows([m.tau for m in held.prepared.motions]))
    if nothing := _explains_nothing(robot, after, torque):
        verdict = "unexplained"
    predictions = _predictions(robot, held, fit)
    power_after = float(np.sum(judged.power(judged.after))) / power_before
    shared = sum(f.heldout_gain or 0.0 for f in findings)
    return Diagnosis(
        verdict=verdict,
        joints=robot.joint_names,
        findings=tuple(findings),
        rest=Rest(1.0 - power_after - shared, power_after - left, left),
        torque=TorqueRmse(robot.joint_names, before, after, floor, torque),
        unexplained_fraction=unexplained,
        unexplained=nothing or _in_words(robot, follows) or _beyond_in_words(robot, beyond, stood, after, floor),
        record_next=(
            *_record_next(findings),
            *_of_standing(robot, stood),
            *([RECORD_NEXT] if any(f.drift and not f.drift["decided"] for f in findings) else []),
        ),
        predictions=predictions,
        temperature=correlations(predictions),
        notes=(
            *dates_in_words(held.library, {t: held.terms[t] for t in fit.terms}),
            *worse,
            *_tolerated(robot, fit),
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


def _beyond_in_words(robot: RobotModel, beyond: Sequence[int], stood: Sequence[int], after: FloatArray, floor: FloatArray) -> str:
    """Joints with more than noise, of which some stood in what was fitted; rms, shape (n,) each."""
    if not beyond:
        return ""
    parts = [f"{after[j]:.3g} N m on {robot.joint_names[j]} (noise floor {floor[j]:.3g} N m)" for j in beyond[:3]]
    sentences = [f"On held-out data more is left than noise: {', '.join(parts)}."]
    if stood:
        names = listed([robot.joint_names[j] for j in stood])
        sentences.append(f"In what was fitted {names} never moved: nothing can be told of them.")
    if len(stood) < len(beyond):
        sentences.append(f"{'Elsewhere no' if stood else 'No'} effect that is known here describes it.")
    return " ".join(sentences)


def _of_standing(robot: RobotModel, stood: Sequence[int]) -> tuple[str, ...]:
    """What to record of joints that stood in what was fitted."""
    if not stood:
        return ()
    return (f"To tell what is wrong on {listed([robot.joint_names[j] for j in stood])}: a recording to fit in which they move.",)


def _record_next(findings: Sequence[Finding]) -> tuple[str, ...]:
    sentences = [f"To tell {f.label} from {listed(f.look_alikes)}: {f.separated_by}." for f in findings if f.cannot_be_told_from]
    return tuple(dict.fromkeys(sentences))


def _predictions(robot: RobotModel, held: HeldOut, fit: Fit) -> Predictions:
    motions = held.prepared.motions
    warm = [np.full(m.q.shape, np.nan) if m.temperature is None else m.temperature for m in motions]
    return Predictions(
        t=np.concatenate([m.t for m in motions]),
        joints=robot.joint_names,
        measured=np.concatenate([m.tau for m in motions]),
        nominal=np.concatenate(held.prepared.nominal),
        extended=np.concatenate(held.predictions(fit)),
        q=np.concatenate([m.q for m in motions]),
        v=np.concatenate([m.v for m in motions]),
        a=np.concatenate([m.a for m in motions]),
        temperature=np.concatenate(warm) if any(m.temperature is not None for m in motions) else None,
    )


def _tolerated(robot: RobotModel, fit: Fit) -> tuple[str, ...]:
    """What was taken for the inexactness that every URDF has, in a sentence."""
    if not fit.inexact:
        return ()
    part = fit.links_off[::10] / np.maximum(robot.pi[::10], 1e-9)
    stated = [f"{robot.body_names[k]} {100.0 * part[k]:+.1f} %" for k in np.argsort(-np.abs(part)) if abs(part[k]) > _STATED]
    if not stated:
        return ()
    return (f"Taken for what a URDF is inexact by, and no cause: the masses of {', '.join(stated)}. model.yaml has them.",)


def with_ranking(found: Diagnosis, ranked: Sequence[RankedUrdf]) -> Diagnosis:
    """A diagnosis that says which of several URDFs it is of; the same where there was no choice."""
    if not ranked:
        return found
    best = max(ranked, key=lambda x: x.probability)
    parts = ", ".join(f"{x.urdf} {100.0 * x.probability:.3g} %" for x in ranked)
    sentence = f"Of the URDFs that were given, {best.urdf} is likeliest the robot's ({parts}): it is the one that was judged."
    refusal = f"{sentence} {found.refusal}" if found.refusal else None
    return replace(found, urdfs=tuple(ranked), refusal=refusal, notes=(sentence, *found.notes))


def correlations(p: Predictions) -> dict[str, Any] | None:
    """How what the models leave on held-out data goes with the temperature of each joint, for diagnosis.json.

    ``residual`` is the correlation of the residual itself, ``friction`` that of its part along the motion, residual times sign of
    the velocity, at equal speed (partial correlation) while the joint moves; before and after. None without a temperature.
    """
    if p.temperature is None:
        return None
    known = [j for j in range(len(p.joints)) if np.isfinite(p.temperature[:, j]).all()]
    out: dict[str, Any] = {
        "joints": [p.joints[j] for j in known],
        "range": [[round(float(limit), 2) for limit in (p.temperature[:, j].min(), p.temperature[:, j].max())] for j in known],
    }
    moves, speed = np.abs(p.v) > _STANDS, np.abs(p.v)
    for name, model in (("before", p.nominal), ("after", p.extended)):
        left = p.measured - model
        out[f"residual_{name}"] = [_correlation(left[:, j], p.temperature[:, j]) for j in known]
        out[f"friction_{name}"] = [
            _correlation(*(_at_equal(speed[m, j], x[m, j]) for x in (left * np.sign(p.v), p.temperature)))
            for j in known
            for m in (moves[:, j],)
        ]
    return out if known else None


def _at_equal(speed: FloatArray, values: FloatArray) -> FloatArray:
    """What a straight line against the speed leaves of values, shape (k,)."""
    line = np.stack([np.ones(len(speed)), speed], axis=1)
    left: FloatArray = values - line @ np.linalg.lstsq(line, values, rcond=1e-9)[0]
    return left


def _correlation(x: FloatArray, y: FloatArray) -> float | None:
    if len(x) < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return None
    return float(np.corrcoef(x, y)[0, 1])


def with_ceiling(found: Diagnosis, judged: Judged, progress: Callable[[str], None] = lambda sentence: None) -> Diagnosis:
    """A diagnosis that says what black boxes predict of what the extended model leaves, and predicts with them where they do.

    They are judged on stretches of all recordings that they were not fitted to; the hybrid is fitted as the model is, so that its
    torques on the held-out data are those of what it has not seen.
    """
    progress("asking black boxes what is left")
    robot, fit, train, held = judged.robot, judged.fit, judged.train, judged.held.prepared
    fitted = HeldOut(train, judged.selection.library, {t: t for t in fit.terms}).predictions(fit)
    rest = [m.tau - x for m, x in zip(train.motions, fitted, strict=True)]
    later = [m.tau - x for m, x in zip(held.motions, judged.held.predictions(fit), strict=True)]
    active = [int(j) for j in train.problem.active]
    top = ceiling(robot.joint_names, [*train.motions, *held.motions], [*rest, *later], active)
    if not top.claimed:
        return replace(found, ceiling=top)
    hybrid, p = Hybrid.fitted(top, train.motions, rest), found.predictions
    if p is not None and len(p.t) == sum(len(m.t) for m in held.motions):
        p = replace(p, hybrid=p.extended + np.concatenate([hybrid.rest(m) for m in held.motions]))
    return replace(found, ceiling=top, hybrid=hybrid, predictions=p)
