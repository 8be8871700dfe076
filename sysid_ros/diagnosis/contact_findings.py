"""Contacts in fitted and in held-out recordings, as findings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.contacts import Contact, find_contacts, is_change
from sysid_ros.diagnosis.evidence import interval, together
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.result import Finding, Parameter
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.effects import ExternalForce
from sysid_ros.robot.robot_model import RobotModel


def contacts_in(robot: RobotModel, train: Prepared, selection: Selection, fit: Fit) -> list[Contact]:
    """Contacts in the recordings that were fitted."""
    return contacts_held_out(robot, HeldOut(train, selection.library, {t: t for t in fit.terms}), fit)


def contacts_held_out(robot: RobotModel, held: HeldOut, fit: Fit) -> list[Contact]:
    """Contacts in recordings that were not fitted."""
    prepared = held.prepared
    residuals = [m.tau - x for m, x in zip(prepared.motions, held.predictions(fit, robot), strict=True)]
    found = find_contacts(robot, prepared.names, prepared.motions, residuals, prepared.nominal, prepared.band.moving)
    dated = [s for t in fit.terms if "t0" in (s := held.terms[t].effect.settings)]
    return [c for c in found if not any(s.get("recording", "") in ("", c.recording) and is_change(c, s["t0"]) for s in dated)]


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
    shown = "; ".join(f"{c.recording}: {in_words(c)}" for c in contacts[:4]) + ("; ..." if len(contacts) > 4 else "")
    words = f"something pushed the robot ({shown})"
    evidence = together([c.evidence for c in contacts])
    return [
        Finding(
            ExternalForce.id,
            "contact",
            robot.joint_names,
            tuple(values),
            heldout_gain=evidence.gain,
            delta_bic=evidence.delta_bic,
            p_value=evidence.p_value,
            cannot_be_told_from=(),
            words=words,
            signature="a short push on all joints below one link at once, gone afterwards",
            separated_by=ExternalForce.separated_by,
            log10_p=evidence.log10_p,
            remark="These windows are kept out of every other fit.",
        )
    ]


def in_words(c: Contact) -> str:
    """A contact in half a sentence."""
    size = float(np.linalg.norm(c.force))
    direction = ", ".join(f"{x:.2f}" for x in c.force / max(size, 1e-12))
    return f"from {c.start:.2f} s to {c.end:.2f} s a force of {size:.3g} N along ({direction}) of the base acts on {c.frame}"
