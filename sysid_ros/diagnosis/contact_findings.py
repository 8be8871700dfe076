"""Contacts in fitted and in held-out recordings, as findings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.contacts import Contact, find_contacts, is_change
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.result import Finding, Parameter
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.effects import ExternalForce
from sysid_ros.robot.robot_model import RobotModel

_95 = 1.959964
_EDGE = 0.03
"""Standard deviation of the times at which a contact begins and ends: about half of what the filters smear [s]."""


def contacts_in(robot: RobotModel, train: Prepared, selection: Selection, fit: Fit) -> list[Contact]:
    """Contacts in the recordings that were fitted."""
    return contacts_held_out(robot, HeldOut(train, selection.library, {t: t for t in fit.terms}), fit)


def contacts_held_out(robot: RobotModel, held: HeldOut, fit: Fit) -> list[Contact]:
    """Contacts in recordings that were not fitted."""
    prepared = held.prepared
    residuals = [m.tau - x for m, x in zip(prepared.motions, held.predictions(fit, robot), strict=True)]
    found = find_contacts(robot, prepared.names, prepared.motions, residuals, prepared.band.moving)
    changes = [held.terms[t].effect.settings for t in fit.terms if t.id == "payload_change"]
    return [c for c in found if not any(s.get("recording", "") in ("", c.recording) and is_change(c, s["t0"]) for s in changes)]


def contact_findings(contacts: Sequence[Contact], joints: Sequence[str]) -> list[Finding]:
    """One finding for all contacts, none where there is none."""
    if not contacts:
        return []
    values: list[Parameter] = []
    for c in contacts:
        low, high = c.force - _95 * c.std, c.force + _95 * c.std
        values += [
            Parameter("force", None, c.force.tolist(), "N", c.std.tolist(), low.tolist(), high.tolist()),
            Parameter("t0", None, c.start, "s", _EDGE, c.start - _95 * _EDGE, c.start + _95 * _EDGE),
            Parameter("t1", None, c.end, "s", _EDGE, c.end - _95 * _EDGE, c.end + _95 * _EDGE),
            Parameter("frame", None, c.frame, "", 0.0, c.frame, c.frame),
        ]
    shown = "; ".join(f"{c.recording}: {in_words(c)}" for c in contacts[:4]) + ("; ..." if len(contacts) > 4 else "")
    sentence = f"Something pushed the robot. {shown}. These windows are kept out of every other fit."
    share = float(sum(c.share for c in contacts))
    rows = sum(c.rows for c in contacts)
    least = max(1.0 - min(c.explained for c in contacts), 1e-6)
    return [
        Finding(
            ExternalForce.id,
            "contact",
            tuple(joints),
            tuple(values),
            min(share, 1.0),
            float(-rows * np.log(least)),
            0.0,
            (),
            sentence,
            "a short push on all joints below one link at once, gone afterwards",
            ExternalForce.separated_by,
        )
    ]


def in_words(c: Contact) -> str:
    """A contact in half a sentence."""
    size = float(np.linalg.norm(c.force))
    direction = ", ".join(f"{x:.2f}" for x in c.force / max(size, 1e-12))
    return f"from {c.start:.2f} s to {c.end:.2f} s a force of {size:.3g} N along ({direction}) of the base acts on {c.frame}"
