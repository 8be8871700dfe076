"""Faults of the published channels as findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid_ros.diagnosis.channel_faults import Fault
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.message_faults import MessageFaults
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.result import Diagnosis, Finding, Parameter, TorqueRmse
from sysid_ros.diagnosis.signal_faults import quantisation, velocity_lag
from sysid_ros.effects import ChannelEffect, TorqueQuantisation, TorqueUnit, VelocityLag
from sysid_ros.signals.recording import Recording

MESSAGE_FAULTS = "message_faults"
_95 = 1.959964
_FAR, _MOST = 1.15, 0.7
"""Gains further from 1 than by this factor on this part of the joints are another unit."""


def finding_of(fault: Fault, joints: Sequence[str], rows: int) -> Finding:
    """A fault of units, signs or order.

    Args:
        rows: independent rows that speak for it.
    """
    found = []
    for name, joint, value, unit, std in fault.values:
        low, high = (value, value) if isinstance(value, str) else (value - _95 * std, value + _95 * std)
        found.append(Parameter(name, None if joint is None else joints[joint], value, unit, std, low, high))
    named = tuple(joints[j] for j in fault.joints)
    sizes = ", ".join(_size(p) for p in found)
    sentence = (
        f"{_capital(fault.effect.label)} on {', '.join(named)} ({sizes}): undone before anything else, since every other cause "
        "would soak it up."
    )
    share = max(fault.share, 1e-3)
    return _finding(fault.effect, named, tuple(found), share, -rows * float(np.log(max(1.0 - share, 1e-6))), sentence)


def as_unit(findings: Sequence[Finding], joints: Sequence[str]) -> list[Finding]:
    """Findings in which wrong gains of nearly all joints are what they are: efforts in another unit, as amperes."""
    out = []
    for f in findings:
        far = [p for p in f.parameters if f.id == "torque_scale" and not 1.0 / _FAR < p.value < _FAR]
        if len(far) < max(2, round(_MOST * len(joints))):
            out.append(f)
            continue
        unit = TorqueUnit([1.0])
        values = tuple(replace(p, name="factor") for p in f.parameters)
        sizes = ", ".join(_size(p) for p in values)
        sentence = (
            f"The efforts are in another unit than N m, with a factor of its own on each joint ({sizes}), as currents are: "
            "multiply them by the torque constants and the gear ratios."
        )
        out.append(
            replace(
                f,
                id=unit.id,
                label=unit.label,
                joints=tuple(joints),
                parameters=values,
                sentence=sentence,
                signature=unit.signature,
            )
        )
    return out


def with_scales(faults: Sequence[Fault], findings: Sequence[Finding], joints: Sequence[str]) -> tuple[list[Fault], list[Finding]]:
    """Wrong gains that are left after currents were turned into torques belong to the factors of the currents."""
    per_joint = [f for f in faults if isinstance(f.effect, TorqueUnit) and all(v[1] is not None for v in f.values)]
    if not per_joint:
        return list(faults), list(findings)
    unit = per_joint[0]
    gains = {p.joint: p for f in findings if f.id == "torque_scale" for p in f.parameters}
    values = []
    for name, j, factor, what, std in unit.values:
        assert j is not None
        if (p := gains.get(joints[j])) is not None and not isinstance(factor, str):
            factor, std = factor * p.value, factor * p.std
        values.append((name, j, factor, what, std))
    better = replace(unit, values=tuple(values))
    return [better if f is unit else f for f in faults], [f for f in findings if f.id != "torque_scale"]


def signal_findings(fitted: Sequence[Recording], judged: Sequence[Recording], joints: Sequence[str]) -> list[Finding]:
    """Faults that need no dynamics."""
    out = []
    if (lag := velocity_lag(fitted)) is not None:
        other = velocity_lag(judged)
        names = tuple(joints)
        value = Parameter("cutoff", None, lag.cutoff, "Hz", lag.std, lag.cutoff - _95 * lag.std, lag.cutoff + _95 * lag.std)
        sentence = (
            f"The published velocity went through a low-pass of about {lag.cutoff:.3g} Hz, which explains "
            f"{100 * lag.share:.0f} % of its difference to the derivative of the position; "
            "velocities are taken from the positions here."
        )
        share = other.share if other is not None else 0.0
        out.append(_finding(VelocityLag(lag.cutoff), names, (value,), share, 1e3 * lag.share, sentence))
    steps = quantisation(fitted)
    if np.any(steps > 0.0):
        named = tuple(name for name, step in zip(joints, steps, strict=True) if step > 0.0)
        values = tuple(
            Parameter("step", name, float(s), "N m", 1e-3 * float(s), 0.998 * float(s), 1.002 * float(s))
            for name, s in zip(joints, steps, strict=True)
            if s > 0.0
        )
        sentence = (
            f"The effort of {', '.join(named)} comes in steps of {', '.join(f'{p.value:.3g}' for p in values)} N m, coarser "
            "than its noise: the noise floor can't be lower than the step over the square root of 12."
        )
        out.append(_finding(TorqueQuantisation(steps.tolist()), named, values, 0.0, 1e3, sentence))
    return out


def with_faults(
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


def message_finding(found: Sequence[MessageFaults], joints: Sequence[str]) -> list[Finding]:
    """Faults of the messages' times, where they are so many that they are a finding of their own."""
    total = sum(f.count for f in found)
    values = []
    for name in ("repeated", "dropped", "late", "unordered"):
        share = sum(f.shares()[name] * f.count for f in found) / max(total, 1)
        if any(name in f.named() for f in found):
            values.append(Parameter(name, None, share, "1", 0.0, share, share))
    if not values:
        return []
    sizes = ", ".join(f"{100 * p.value:.1f} % {p.name}" for p in values)
    sentence = (
        f"The messages are not in order ({sizes}): they were put in the order of their stamps, and those that repeat another or "
        "are late were left out before anything else. Correct the driver; two publishers on one topic look alike."
    )
    signature = "stairs and jumps in the raw values of all joints at once"
    label, cure = "message faults", "stamps that the hardware sets, and one publisher"
    return [Finding(MESSAGE_FAULTS, label, tuple(joints), tuple(values), 0.0, 0.0, 0.0, (), sentence, signature, cure)]


def _finding(
    effect: ChannelEffect, joints: tuple[str, ...], values: tuple[Parameter, ...], share: float, rise: float, sentence: str
) -> Finding:
    return Finding(effect.id, effect.label, joints, values, share, rise, 0.0, (), sentence, effect.signature, effect.separated_by)


def _size(p: Parameter) -> str:
    where = f" of {p.joint}" if p.joint else ""
    return f"{p.name}{where} = {p.value if isinstance(p.value, str) else format(p.value, '.4g')}"


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]
