"""diagnose: from recordings and a nominal model to the causes of what the model gets wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sysid_ros.diagnosis.channel_faults import deviation_of, fault_evidence, undo
from sysid_ros.diagnosis.contact_search import contact_findings, contacts_held_out, contacts_in, in_words, strong_contacts
from sysid_ros.diagnosis.contacts import without
from sysid_ros.diagnosis.covariance import with_knobs
from sysid_ros.diagnosis.extended_model import extended_model, urdf_part
from sysid_ros.diagnosis.fault_findings import (
    as_unit,
    finding_of,
    message_finding,
    signal_findings,
    with_faults,
    with_findings,
    with_scales,
)
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.gain import with_gain
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared, prepare
from sysid_ros.diagnosis.reporting import report
from sysid_ros.diagnosis.result import Diagnosis
from sysid_ros.diagnosis.robot_hypotheses import judge
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.exceptions import DataError
from sysid_ros.input_gate.message_faults import in_order
from sysid_ros.input_gate.recording_check import refusal_of
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.temperature import known_everywhere
from sysid_ros.simulation.simulators import installed
from sysid_ros.torque.model_file import ModelFile

_HELD_OUT = 0.3
"""Part of the recordings that is held out where no others are given to judge on."""
_MOST_CONTACTS = 8
"""Contacts after which no more are looked for."""
_WHOLLY = ("explained", "nothing_wrong")
"""Verdicts after which a URDF that was in doubt is the robot's: with everything that the library has its bodies explain the
torques."""
_REPLACED = 1
"""Most links of such a URDF that may be wrong; of another robot's several are, so that its bodies explain nothing."""

Progress = Callable[[str], None]


def diagnose(
    robot: RobotModel,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    known: ModelFile | None = None,
    progress: Progress = lambda sentence: None,
    provenance: dict[str, Any] | None = None,
    simulator: str | None = None,
) -> Diagnosis:
    """What is wrong with the nominal model of a robot.

    Args:
        robot: the nominal model. recordings: to fit on. validation: to judge on, never fitted; without any, the last part of the
            recordings is held out.
        known: a model that was identified before; it is the nominal model then.
        progress: called with what is being done. provenance: written into the extended model.
        simulator: one of :data:`sysid_ros.simulation.simulators.SIMULATORS`; None: the first that is installed.

    Raises:
        DataError: no recording is given, or its channels do not fit the robot. SettingsError: the simulator is not installed.
    """
    simulator = installed(simulator)
    _check(robot, [*recordings, *validation])
    ordered = [in_order(r) for r in recordings]
    ordered_validation = [in_order(r) for r in validation]
    notes = tuple(f"{r.name}: {words}" for r, f in [*ordered, *ordered_validation] if (words := f.in_words()))
    recordings, validation = [r for r, _ in ordered], [r for r, _ in ordered_validation]
    if reason := refusal_of(robot, recordings, validation):
        return Diagnosis("refused", robot.joint_names, refusal=reason, notes=notes)
    fitted, judged = (list(recordings), list(validation)) if validation else _split(recordings)
    fitted, partly = known_everywhere(fitted, judged, robot.joint_names)
    notes += partly
    effects = known.known_effects(robot) if known else []
    progress("weighing this URDF, faults of its channels and other robots")
    judged_robot = None if known else judge(robot, fitted)
    reason = judged_robot.refusal if judged_robot else None
    if reason and judged_robot is not None and judged_robot.hopeless:
        return Diagnosis("refused", robot.joint_names, refusal=reason, notes=notes)
    faults = judged_robot.faults if judged_robot else ()
    published, published_fitted = judged, fitted
    signals = [
        *signal_findings(fitted, robot.joint_names),
        *message_finding([f for _, f in ordered], robot.joint_names),
    ]
    for fault in faults:
        fitted, judged = ([undo(r, fault.effect) for r in part] for part in (fitted, judged))
    progress("filtering")
    train = prepare(robot, fitted, effects)
    progress("looking for contacts")
    contacts = strong_contacts(robot, train)
    if contacts:
        fitted = [without(r, contacts) for r in fitted]
        train = prepare(robot, fitted, effects)
    search = _search(robot, train, progress)
    # a strong contact hides a weaker one
    while len(contacts) < _MOST_CONTACTS and (more := contacts_in(robot, search.train, search.selection, search.fit)):
        progress("leaving contacts out")
        contacts += more
        fitted = [without(r, more) for r in fitted]
        search = _search(robot, prepare(robot, fitted, effects), progress)
    train, library, selection, fit = search.train, search.library, search.selection, search.fit
    progress("judging on held-out data")
    held = HeldOut.of(robot, prepare(robot, judged, effects, train.turns), fit)
    if later := contacts_held_out(robot, held, fit):
        judged = [without(r, later) for r in judged]
        held = HeldOut.of(robot, prepare(robot, judged, effects, train.turns), fit)
        notes += tuple(f"{c.recording}: {in_words(c)}, and is left out of what the models are judged on." for c in later)
    posterior = selection.judged_with(held)
    fit = selection.fit
    values = with_knobs(train.problem, library, fit)
    found = report(robot, train, selection, posterior, held, values)
    if reason and (found.verdict not in _WHOLLY or sum(t.effect.replaces_links for t in fit.terms) > _REPLACED):
        return Diagnosis("refused", robot.joint_names, refusal=reason, notes=notes)
    found = with_findings(found, as_unit(found.findings, robot.joint_names))
    signals += contact_findings(contacts, robot)
    if faults or signals:
        known_faults, rest = with_scales(faults, found.findings, robot.joint_names)
        found = with_findings(found, rest)
        evidence, deviation = fault_evidence(robot, published_fitted, faults), deviation_of(train, fit)
        first = [finding_of(f, robot.joint_names, e, deviation) for f, e in zip(known_faults, evidence, strict=True)]
        raw = prepare(robot, published, effects) if faults and not later else held.prepared
        found = with_faults(found, [*first, *signals], faults, raw, held, fit)
    model = extended_model(robot, known, fit, values, train, {r.name: r.start for r in fitted}, provenance or {})
    urdf_model, changes = urdf_part(robot, model, train)
    notes += changes
    progress("simulating")
    both, noise = (effects, urdf_model.known_effects(robot)), fit.noise.variance(held.prepared.band.f)
    found = with_gain(found, held.prepared, held.predictions(fit, robot), both, noise, simulator)
    return replace(found, model=model, urdf_model=urdf_model, notes=(*notes, *found.notes))


@dataclass(frozen=True, eq=False)
class _Search:
    """A search for the causes, and what it is made of."""

    train: Prepared
    library: Library
    selection: Selection
    fit: Fit


def _search(robot: RobotModel, train: Prepared, progress: Progress) -> _Search:
    library = Library(robot, train.band)
    progress("computing what each effect would do")
    selection = Selection(train.problem, library, train.nominal, progress=progress)
    return _Search(train, library, selection, selection.run())


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
            part.append(r.at(s, f"{r.name} ({word})"))
    return first, last
