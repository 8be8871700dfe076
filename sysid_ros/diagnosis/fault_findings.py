"""What is found beside the causes of a fit, as findings: faults of channels, signals and messages, and contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid_ros.diagnosis.channel_faults import FAULT, OWN_FACTORS, Fault, in_newton_metres
from sysid_ros.diagnosis.claims import Judged, with_headline
from sysid_ros.diagnosis.contacts import Contact
from sysid_ros.diagnosis.covariance import Gains
from sysid_ros.diagnosis.evidence import Evidence, count_interval, interval, together
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.result import Diagnosis, Finding, TorqueRmse
from sysid_ros.diagnosis.signal_faults import lattices, velocity_lag
from sysid_ros.diagnosis.whose.robot_kernels import GAIN
from sysid_ros.effects import ChannelEffect, ExternalForce, Parameter, TorqueQuantisation, TorqueUnit, VelocityLag
from sysid_ros.effects.wording import listed, of_joints, phrase
from sysid_ros.input_gate.message_faults import FAULTS, MessageFaults
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording

MESSAGE_FAULTS = "message_faults"
_UNDONE = "It was undone before anything else, since every other cause would soak it up."
_FAR, _MOST = 1.15, 0.7
"""Gains further from 1 than by this factor on this part of the joints are another unit."""


def finding_of(fault: Fault, joints: Sequence[str], evidence: Evidence, gains: Gains) -> Finding:
    """A fault of units, signs or order; the spread of a factor is that of the efforts, all that was found adjusted to it."""
    named, found = tuple(joints[j] for j in fault.joints), _parameters(fault, joints, gains)
    remark, untold = _UNDONE, [joints[j] for j in fault.own_factors if joints[j] not in {p.joint for p in found}]
    if untold:
        remark += f" On {listed(untold)} the efforts do not tell their factor well enough: they are mostly friction or noise."
    return replace(_finding(fault.effect, named, len(joints), found, evidence, remark), probability=fault.probability)


def _parameters(fault: Fault, joints: Sequence[str], gains: Gains) -> tuple[Parameter, ...]:
    found = []
    for name, joint, value, unit in fault.values:
        where = None if joint is None else joints[joint]
        measured = gains.common() if joint is None else gains.of(joint)
        if measured is None and fault.own_factors and joint in gains.joints:
            continue  # the efforts do not tell it
        if isinstance(value, str) or not fault.effect.scales or measured is None:
            found.append(Parameter(name, where, value, unit))
            continue
        told, std = value * measured[0], abs(value) * measured[1]
        low, high = interval(told, std)
        known = not fault.own_factors and low <= value <= high  # of a known unit, or a sign: the efforts do not refute it
        found.append(Parameter(name, where, value if known else told, unit, std, low, high))
    return tuple(found)


def _scaled(faults: Sequence[Fault]) -> tuple[int, ...]:
    """Joints with faults that the gains of their efforts tell."""
    return tuple(sorted({j for f in faults if f.effect.scales for j in f.joints}))


def refuted(faults: Sequence[Fault], judged: Judged) -> list[Fault]:
    """Units of efforts that all that was found says are N m: what else was wrong had looked like one."""
    out, names = [], judged.robot.joint_names
    for fault in (f for f in faults if f.effect.absorbs):
        told = _parameters(fault, names, judged.gains(_scaled(faults)))
        alike = in_newton_metres([(p.value, p.std) for p in told if isinstance(p.std, float)], GAIN)
        usual = OWN_FACTORS if fault.own_factors else FAULT
        if alike * (1.0 - usual) > (1.0 - alike) * usual:
            out.append(fault)
    return out


def as_unit(findings: Sequence[Finding], joints: Sequence[str]) -> list[Finding]:
    """Findings in which wrong gains of nearly all joints are what they are: efforts in another unit, as amperes."""
    out = []
    for f in findings:
        far = [p for p in f.parameters if TorqueUnit.takes(f.id) and not 1.0 / _FAR < p.value < _FAR]
        if len(far) < max(2, round(_MOST * len(joints))):
            out.append(f)
            continue
        unit = TorqueUnit([1.0])
        values = tuple(replace(p, name="factor") for p in f.parameters)
        out.append(
            replace(
                f,
                id=unit.id,
                label=unit.label,
                joints=tuple(joints),
                parameters=values,
                words=phrase(unit.words, unit.label, values, ""),
                remark="Currents have a factor of their own on each joint: multiply by torque constants and gear ratios.",
                signature=unit.signature,
                heldout_gain=None,
                of_data=True,
            )
        )
    return sorted(out, key=lambda f: f.of_data)


def without_gains(faults: Sequence[Fault], findings: Sequence[Finding]) -> list[Finding]:
    """Findings without wrong gains of efforts with a factor of their own on each joint, which hold them."""
    own = [f.effect for f in faults if f.own_factors]
    return [f for f in findings if not any(effect.takes(f.id) for effect in own)]


def signal_findings(fitted: Sequence[Recording], joints: Sequence[str]) -> list[Finding]:
    """Faults that need no dynamics."""
    out = []
    if (lag := velocity_lag(fitted)) is not None:
        value = Parameter("cutoff", None, lag.cutoff, "Hz", lag.std, *interval(lag.cutoff, lag.std))
        remark = (
            f"That explains {100 * lag.share:.0f} % of their difference to the derivative of the positions, which is used in "
            "their place."
        )
        out.append(_finding(VelocityLag(lag.cutoff), tuple(joints), len(joints), (value,), lag.evidence, remark))
    if found := lattices(fitted):
        named = tuple(joints[x.joint] for x in found)
        values = tuple(Parameter("step", joints[x.joint], x.step, "N m", x.std, *interval(x.step, x.std)) for x in found)
        effect = TorqueQuantisation([next((x.step for x in found if x.joint == j), 0.0) for j in range(len(joints))])
        remark = "That is coarser than their noise: no error can be smaller than the step over the square root of 12."
        out.append(_finding(effect, named, len(joints), values, together([x.evidence for x in found]), remark))
    return out


def with_faults(
    found: Diagnosis,
    faults: Sequence[Fault],
    evidence: Sequence[Evidence],
    others: Sequence[Finding],
    published: Prepared,
    judged: Judged,
) -> Diagnosis:
    """The diagnosis with contacts among its causes, by gain, faults of the data after them, and torques as they are published.

    Args:
        faults: of units, signs and order. evidence: for each. others: contacts and faults of the data, which are added.
        published: what the model is judged on, as it was published. judged: with the faults undone.
    """
    joints = found.joints
    if not any(f.effect.absorbs for f in faults):
        found = with_findings(found, as_unit(found.findings, joints))
    if not faults and not others and published is judged.held.prepared:
        return found
    gains = judged.gains(_scaled(faults), carried=any(f.own_factors for f in faults))
    own = [finding_of(f, joints, e, gains) for f, e in zip(faults, evidence, strict=True)]
    found = _with_contacts(with_findings(found, without_gains(faults, found.findings)), [f for f in others if not f.of_data])
    every = (*found.causes, *found.data_faults, *own, *(f for f in others if f.of_data))
    verdict = "explained" if found.verdict == "nothing_wrong" else found.verdict
    return _as_published(replace(found, verdict=verdict, findings=every), faults, published, judged.held, judged.fit)


def _as_published(found: Diagnosis, faults: Sequence[Fault], published: Prepared, held: HeldOut, fit: Fit) -> Diagnosis:
    """The diagnosis with torques, and their errors, in the units, signs and order in which they are published."""
    assert found.torque is not None
    assert found.predictions is not None
    if published is held.prepared:
        return found
    rows, floor, extended = held.residual(fit), found.torque.noise_floor[None], found.predictions.extended
    for fault in reversed(faults):
        rows, extended = fault.effect.publish(rows), fault.effect.publish(extended)
        floor = np.abs(fault.effect.publish(floor))
    measured = [m.tau for m in published.motions]
    before, after, torque = (held.rms(x) for x in (published.problem.y, rows, published.band.rows(measured)))
    predictions = replace(
        found.predictions, measured=np.concatenate(measured), nominal=np.concatenate(published.nominal), extended=extended
    )
    return replace(found, torque=TorqueRmse(found.joints, before, after, floor[0], torque), predictions=predictions)


def with_findings(found: Diagnosis, findings: Sequence[Finding]) -> Diagnosis:
    """The diagnosis with findings of which a cause became a fault of the data, or a part of one: the others divide the error
    that is left once that is undone."""
    lost = sum(f.heldout_gain or 0.0 for f in found.findings) - sum(f.heldout_gain or 0.0 for f in findings)
    if lost == 0.0 or lost >= 1.0:
        return replace(found, findings=tuple(findings))
    scale = 1.0 / (1.0 - lost)
    every = [f if f.of_data else replace(f, heldout_gain=scale * (f.heldout_gain or 0.0)) for f in findings]
    return replace(found, findings=tuple(with_headline(every)), rest=None if found.rest is None else found.rest.scaled(scale))


def _with_contacts(found: Diagnosis, contacts: Sequence[Finding]) -> Diagnosis:
    """The diagnosis with contacts among its causes. Their shares are of the fitted recordings' error; their windows are left out
    of what the others are judged on, so that the others divide what is left."""
    pushed = sum(f.heldout_gain or 0.0 for f in contacts)
    others = [replace(f, heldout_gain=(1.0 - pushed) * (f.heldout_gain or 0.0)) for f in found.causes]
    every = with_headline(sorted([*others, *contacts], key=lambda f: -(f.heldout_gain or 0.0)))
    rest = None if found.rest is None else found.rest.scaled(1.0 - pushed)
    return replace(found, findings=(*every, *found.data_faults), rest=rest) if contacts else found


def message_finding(found: Sequence[MessageFaults], joints: Sequence[str]) -> list[Finding]:
    """Faults of the messages' times, where they are so many that they are a finding of their own."""
    total = sum(f.count for f in found)
    values = []
    for name in FAULTS:
        count = sum(getattr(f, name) for f in found)
        if any(name in f.named() for f in found):
            values.append(Parameter(name, None, count / total, "1", *count_interval(count, total)))
    if not values:
        return []
    sizes = ", ".join(f"{100 * p.value:.1f} % {p.name}" for p in values)
    words = f"messages with faults ({sizes})"
    remarks = []
    if any(p.name != "spiked" for p in values):
        remarks.append(
            "They were put in the order of their stamps, and those that repeat another, are late, hold nothing but zeros or a "
            "frozen channel were left out before anything else. Correct the driver; two publishers on one topic look alike."
        )
    if any(f.polled for f in found):
        remarks.append("A driver that polls a slower source should publish when a sample comes, with the sample's own stamp.")
    if any(f.spiked for f in found):
        remarks.append(
            "A torque of one joint that is far from those before and after it gave way to the middle of these. Look at that "
            "joint's sensor, its cable and its driver."
        )
    signature = "stairs and jumps in the raw values of all joints at once, or a torque by itself"
    label, cure = "message faults", "stamps that the hardware sets, and one publisher"
    # stamps without any fault have no distribution that these counts could be judged by
    of_stamps = Finding(MESSAGE_FAULTS, label, tuple(joints), tuple(values), None, None, None, (), words, signature, cure)
    return [replace(of_stamps, of_data=True, remark=" ".join(remarks))]


def _finding(
    effect: ChannelEffect, joints: tuple[str, ...], of: int, values: tuple[Parameter, ...], evidence: Evidence, remark: str
) -> Finding:
    """A fault of the data on some joints of a robot that has ``of`` of them."""
    return Finding(
        effect.id,
        effect.label,
        joints,
        values,
        **evidence.figures(),
        cannot_be_told_from=(),
        words=phrase(effect.told_as, effect.label, values, of_joints(joints, of)),
        signature=effect.signature,
        separated_by=effect.separated_by,
        of_data=True,
        remark=remark,
    )


def contact_findings(contacts: Sequence[Contact], robot: RobotModel) -> list[Finding]:
    """One finding for all contacts, none where there is none."""
    if not contacts:
        return []
    values: list[Parameter] = []
    for c in contacts:
        ends = [interval(float(x), float(s)) for x, s in zip(c.force, c.std, strict=True)]
        low, high = [a for a, _ in ends], [b for _, b in ends]
        values += [
            Parameter("force", None, c.force.tolist(), "N", c.std.tolist(), low, high),
            # when the filters' smear begins and ends is seen, when the force does is not
            Parameter("t0", None, c.start, "s"),
            Parameter("t1", None, c.end, "s"),
            Parameter("frame", None, c.frame, ""),
        ]
    shown = "; ".join(f"{c.recording}: {c.in_words()}" for c in contacts[:4]) + ("; ..." if len(contacts) > 4 else "")
    words = f"something pushed the robot ({shown})"
    evidence = together([c.evidence for c in contacts])
    return [
        Finding(
            ExternalForce.id,
            "contact",
            robot.joint_names,
            tuple(values),
            **evidence.figures(),
            cannot_be_told_from=(),
            words=words,
            signature="a short push on all joints below one link at once, gone afterwards",
            separated_by=ExternalForce.separated_by,
            remark="These windows are kept out of every other fit.",
        )
    ]
