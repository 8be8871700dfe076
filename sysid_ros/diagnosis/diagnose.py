"""diagnose: from recordings and a nominal model to the causes of what the model gets wrong."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from sysid_ros.diagnosis.channel_faults import Fault, fault_evidence, mount_evidence, undone
from sysid_ros.diagnosis.claims import LIKELIER, Judged
from sysid_ros.diagnosis.contacts import Contact, contacts_held_out, contacts_in, without
from sysid_ros.diagnosis.extended_model import extended_model, urdf_part
from sysid_ros.diagnosis.fault_findings import contact_findings, message_finding, refuted, signal_findings, with_faults
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.gain import gain_or_why_not
from sysid_ros.diagnosis.heldout import HeldOut, split
from sysid_ros.diagnosis.prepare import Prepared, prepare
from sysid_ros.diagnosis.reporting import report, with_ceiling
from sysid_ros.diagnosis.result import Diagnosis
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.sets.long_recordings import searched
from sysid_ros.diagnosis.sets.other_loads import OtherLoad, other_loads, without_loads
from sysid_ros.diagnosis.strong_contacts import strong_contacts
from sysid_ros.diagnosis.whose.left_out_channels import refuted_elsewhere
from sysid_ros.diagnosis.whose.own_factors import with_own_factors
from sysid_ros.diagnosis.whose.robot_hypotheses import judge
from sysid_ros.diagnosis.whose.told_mount import with_mount
from sysid_ros.estimators.one_thread import on_one_thread
from sysid_ros.exceptions import DataError
from sysid_ros.identification.channel_checks import frozen_messages
from sysid_ros.input_gate.message_faults import MessageFaults, despiked, in_order
from sysid_ros.input_gate.recording_check import broken, only_places, refusal_of
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.temperature import known_everywhere
from sysid_ros.simulation.simulators import installed
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.model_file import ModelFile

_MOST_CONTACTS = 8
"""Contacts after which no more are looked for."""
_WHOLLY = ("explained", "nothing_wrong")
"""Verdicts after which a URDF that was in doubt is the robot's: with everything that the library has its bodies explain the
torques."""
_REPLACED = 1
"""Most links of such a URDF that may be wrong; of another robot's several are, so that its bodies explain nothing."""

Progress = Callable[[str], None]


@on_one_thread
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
    simulator, recordings = installed(simulator), _given(recordings)
    (recordings, validation), (of_messages, _), notes, refusal = _in_order(robot, recordings, validation)
    fitted, judged = (recordings, validation) if validation else split(recordings)
    if reason := refusal or broken(robot, fitted) or broken(robot, judged):
        return Diagnosis("refused", robot.joint_names, refusal=reason, notes=notes)
    fitted, partly = known_everywhere(fitted, judged, robot.joint_names)
    notes += partly

    progress("weighing this URDF, faults of its channels and other robots")
    whose = None if known else judge(robot, fitted)
    doubt = whose.refusal if whose else None
    if whose and doubt and whose.hopeless:
        return Diagnosis("refused", robot.joint_names, refusal=doubt, notes=notes)
    faults, silent, mount = (whose.faults, whose.silent, whose.mount) if whose else ((), (), None)
    level, robot = robot, whose.robot if whose else robot  # the latter is mounted as it is
    of_data = [*signal_findings(fitted, robot.joint_names), *message_finding(of_messages, robot.joint_names)]

    effects = known.known_effects(robot) if known else []
    told, found, contacts, later, faults, silent = _told(robot, fitted, judged, faults, silent, effects, progress)
    fit, train, held = told.fit, told.train, told.held
    found = with_ceiling(found, told, progress)
    notes += whose.in_words if whose and silent else ()
    notes += tuple(f"{c.recording}: {c.in_words()}, and is left out of what the models are judged on." for c in later)
    if doubt and not _wholly_explained(fit, found):
        return Diagnosis("refused", robot.joint_names, refusal=doubt, notes=notes)

    given = [without(r, later) for r in judged]
    published = prepare(level, given, effects, silent=silent) if faults or mount else held.prepared
    others = [*of_data, *contact_findings(contacts, robot)]
    found = with_faults(found, faults, fault_evidence(robot, fitted, faults), others, published, told)
    model = extended_model(robot, known, fit, told.values, train, {r.whole: r.start for r in fitted}, provenance or {})
    urdf_model, changes = urdf_part(robot, model, train)
    progress("simulating")
    both = effects, urdf_model.known_effects(robot)
    simulation, tracking, why_not = gain_or_why_not(held.prepared, held.predictions(fit), both, told.noise, simulator)
    notes += (*changes, *found.notes, *why_not)
    found = replace(found, model=model, urdf_model=urdf_model, simulation=simulation, tracking=tracking, notes=notes)
    return with_mount(found, mount, level, told, mount_evidence(robot, level, fitted, faults)) if mount else found


def _given(recordings: Sequence[Recording]) -> Sequence[Recording]:
    if not recordings:
        raise DataError("no recording is given. Give at least one bag.")
    return recordings


def _wholly_explained(fit: Fit, found: Diagnosis) -> bool:
    """Whether a URDF that was in doubt is the robot's after all; what takes measured efforts away explains none of them."""
    removed = any(t.effect.from_measured for t in fit.terms)
    return not removed and found.verdict in _WHOLLY and sum(t.effect.replaces_links for t in fit.terms) <= _REPLACED


class _Told(NamedTuple):
    """What is told, the contacts that are left out of what is fitted and of what it is judged on, the faults that were undone and
    the joints whose efforts hold nothing."""

    judged: Judged
    found: Diagnosis
    contacts: list[Contact]
    later: list[Contact]
    faults: tuple[Fault, ...]
    silent: tuple[int, ...]


def _told(
    robot: RobotModel,
    fitted: Sequence[Recording],
    judged: Sequence[Recording],
    faults: tuple[Fault, ...],
    silent: tuple[int, ...],
    effects: Sequence[KnownEffect],
    progress: Progress,
) -> _Told:
    """What is told with some faults undone, without those that all that was found refutes, and without what takes torques away
    that are likelier of a kind that no effect describes."""
    not_away = set[tuple[str, int]]()
    while True:
        own = [j for f in faults for j in f.own_factors]
        prepared = partial(prepare, robot, known=effects, silent=silent, gains=own)
        train, selection, contacts = _search(robot, [undone(r, faults) for r in fitted], prepared, progress, not_away)
        corrected = [undone(r, faults) for r in judged]
        carried = None if faults else partial(other_loads, robot, train, selection)
        held, later, loads = _held_out(robot, corrected, partial(prepared, turns=train.turns), carried, selection.fit, progress)
        told = Judged(train, selection, selection.judged_with(held), held)
        if unknown := {(t.id, t.joints[0]) for t, p in told.not_unknown.items() if p < LIKELIER} - not_away:
            progress("a torque is of a kind that no effect describes: once more without what takes it away")
            not_away |= unknown
            continue
        found = report(told)
        wrong = refuted(faults, told)
        if faults:
            published = [without(r, contacts) for r in fitted], [without(r, later) for r in judged]
            wrong += refuted_elsewhere(robot, faults, told.fit, held, partial(prepare, robot, known=effects), published)
        better = faults if wrong else with_own_factors(faults, told)
        if not wrong and better == faults:
            found = replace(found, notes=(*(x.in_words() for x in loads), *found.notes))
            return _Told(told, found, contacts, later, faults, silent)
        if wrong:
            progress("the channels are as they should be after all: once more without what was undone")
        else:
            progress("the unit of the efforts is known better now: once more with that undone")
        faults = tuple(f for f in better if f not in wrong)
        silent = () if any(f.effect.absorbs for f in wrong) else silent


def _search(
    robot: RobotModel,
    fitted: Sequence[Recording],
    prepared: Callable[..., Prepared],
    progress: Progress,
    not_away: Collection[tuple[str, int]] = (),
) -> tuple[Prepared, Selection, list[Contact]]:
    """The rows to fit, the causes that were found in them, and the contacts that were left out of them."""
    progress("filtering")
    whole = prepared(fitted)
    progress("looking for contacts")
    contacts = unproven = strong_contacts(robot, whole)
    while True:
        train = prepared([without(r, contacts) for r in fitted]) if contacts else whole
        progress("computing what each effect would do")
        selection = searched(robot, train, progress, not_away)
        # a strong contact hides a weaker one
        if more := contacts_in(robot, train, selection) if len(contacts) < _MOST_CONTACTS else []:
            contacts = [*contacts, *more]
            continue
        explained = _explained(unproven, robot, prepared(fitted, turns=train.turns), selection) if unproven else []
        if not explained:
            return train, selection, contacts
        contacts, unproven = [c for c in contacts if c not in explained], []


def _explained(contacts: Sequence[Contact], robot: RobotModel, whole: Prepared, selection: Selection) -> list[Contact]:
    """Those that stand out of the whole recordings no longer: they were a cause that was not known when they were found."""
    still = contacts_held_out(robot, HeldOut.of(robot, whole, selection.fit), selection.fit)
    return [c for c in contacts if not any(c.overlaps(x) for x in still)]


def _held_out(
    robot: RobotModel,
    judged: Sequence[Recording],
    prepared: Callable[[Sequence[Recording]], Prepared],
    carried: Callable[[Prepared], list[OtherLoad]] | None,
    fit: Fit,
    progress: Progress,
) -> tuple[HeldOut, list[Contact], list[OtherLoad]]:
    """What is judged on, the contacts that were left out of it, and what its recordings carry beside what the fitted ones do."""
    progress("judging on held-out data")
    rows = prepared(judged)
    loads = carried(rows) if carried else []
    held = HeldOut.of(robot, without_loads(rows, loads), fit)
    if later := contacts_held_out(robot, held, fit):
        held = HeldOut.of(robot, without_loads(prepared([without(r, later) for r in judged]), loads), fit)
    return held, later, loads


def _in_order(
    robot: RobotModel, *groups: Sequence[Recording]
) -> tuple[list[list[Recording]], list[list[MessageFaults]], tuple[str, ...], str | None]:
    """The recordings of each group with their messages in order, what was wrong with these, that in words, and why they can't be
    used at all.

    Raises:
        DataError: a recording is of other joints than the robot's, or its stamps have no order.
    """
    for recording in chain(*groups):
        if recording.q.shape[1] != robot.n:
            raise DataError(
                f"{recording.name} has {recording.q.shape[1]} joints, the robot has {robot.n}: {', '.join(robot.joint_names)}."
            )
    ordered = [[in_order(r) for r in group] for group in groups]
    # before spikes are gone: a count of few bits has some where it wraps
    refusal = refusal_of(robot, *([r for r, _ in group] for group in ordered))
    thawed, counted = list[str](), [f.frozen for _, f in chain(*ordered)]
    if not refusal:  # before spikes are gone, too: what stands has no noise, which others were judged by
        try:
            ordered = [[_thawed(robot, *x, thawed) for x in group] for group in ordered]
        except DataError as error:
            refusal = str(error)
    found = [[despiked(*x) for x in group] for group in ordered]
    # what single channels add is said by joint, and once
    said = [(r.name, replace(f, frozen=n).in_words()) for (r, f), n in zip(chain(*found), counted, strict=True)]
    notes = (*only_places(robot), *(f"{name}: {words}" for name, words in said if words), *thawed)
    return [[r for r, _ in group] for group in found], [[f for _, f in group] for group in found], notes, refusal


def _thawed(robot: RobotModel, recording: Recording, faults: MessageFaults, notes: list[str]) -> tuple[Recording, MessageFaults]:
    """A recording without messages in which a channel of one joint is frozen, which are noted and counted among the faults."""
    frozen, words = frozen_messages(robot, recording)
    if not frozen.any():
        return recording, faults
    notes += [f"{recording.name}: {x}" for x in words]
    return recording.at(np.flatnonzero(~frozen)), replace(faults, frozen=faults.frozen + int(np.sum(frozen)))
