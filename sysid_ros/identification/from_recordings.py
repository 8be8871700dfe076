"""From raw recordings to an identification: checks, cut-off, rows, friction, fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from sysid_ros.blackbox.ceiling import ceiling
from sysid_ros.blackbox.ceiling_result import Ceiling
from sysid_ros.estimators.one_thread import on_one_thread
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.identification.carried_check import check_carried
from sysid_ros.identification.channel_checks import check_channels
from sysid_ros.identification.effect_choice import choose_effects
from sysid_ros.identification.free_effects import free_model, wishes
from sysid_ros.identification.from_legs import identify_on_legs
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.identify import Choices, identify, require_motion
from sysid_ros.identification.least_squares import METHODS
from sysid_ros.identification.plausibility import check_plausible
from sysid_ros.identification.result import CutOff, Identification, Problem, ResidualSeries
from sysid_ros.identification.rows import FORMS, SmoothRecording
from sysid_ros.identification.spectrum import choose_cutoff
from sysid_ros.input_gate.message_faults import at_own_times
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.recording import Recording

_SHORTEST = 2.0
"""Stretches that black boxes are asked of [s]."""


@on_one_thread
def identify_recordings(
    robot: RobotModel,
    recordings: Sequence[Recording],
    validation: Sequence[Recording],
    provenance: dict[str, Any],
    choices: Choices | None = None,
    cutoff_hz: float = 0.0,
    max_gap: float = 0.1,
    measured_velocity: bool = False,
    problems: Sequence[Problem] = (),
    loaded: Sequence[Recording] = (),
    progress: Callable[[str], None] = lambda what: None,
    base: FloatingBase | None = None,
    gravity: float = 9.81,
) -> Identification:
    """Identify an arm from recordings in which it carries nothing (or always the same).

    Args:
        robot: the arm. recordings: to identify from. validation: to judge on, never fitted.
        provenance: written into the model file. choices: how. cutoff_hz: of the low-pass [Hz]; 0 to choose it.
        max_gap: a longer gap between samples is not bridged [s]. measured_velocity: take the messages' velocity where there is
            one.
        problems: found before. loaded: runs in which the arm carries a payload, which is found as the difference.
        progress: called with what is being done, in words.
        base: of a robot on legs, see :func:`.identify_on_legs`. gravity: its size, by which a bias of its IMU is told [m/s^2].

    Raises:
        SettingsError: a choice is unknown, or the cut-off is no frequency.
        DataError: the recordings do not determine the robot's parameters, and why.
    """
    choices = choices or Choices()
    _require(choices)
    if not 0.0 <= cutoff_hz < math.inf:
        raise SettingsError(f"the cut-off is {cutoff_hz} Hz; it must be 0, to choose it, or above.")
    if base is not None:
        if loaded:
            said = "recordings with a payload are given of a robot on legs, whose payload 'sysid replay --model' estimates. "
            raise SettingsError(f"{said}Leave them out here.")
        return identify_on_legs(
            base, recordings, validation, provenance, choices, cutoff_hz, max_gap, measured_velocity, problems, progress, gravity
        )
    (recordings, validation, loaded), off = _at_own_times(recordings, validation, loaded)
    checked = [check_channels(robot, r, max_gap) for r in (*recordings, *validation, *loaded)]
    found = [*problems, *off, *(p for c in checked for p in c.problems)]
    found += _check_empty(robot, (*recordings, *validation), choices.accept_doubts)
    cutoff = CutOff(cutoff_hz, "as given") if cutoff_hz else choose_cutoff(recordings, robot.joint_names, max_gap)
    smooth = []
    for c in checked:
        progress(f"filtering {c.recording.name}")
        filtered = (c.recording.name, cutoff.hz, max_gap, choices.form, measured_velocity, c.spoiled)
        smooth.append(SmoothRecording.of(robot, c.recording, *filtered))
    first, second = len(recordings), len(recordings) + len(validation)
    fitted, judged, carrying = smooth[:first], smooth[first:second], smooth[second:]
    found += _check_motion(robot, fitted, choices.accept_doubts)
    chosen, knobs = choose_effects(robot, choices.friction, choices.effects, choices.method, fitted, progress)
    model = free_model(robot, chosen)
    bags, checks, with_load = ([x.rows(model) for x in part] for part in (fitted, judged, carrying))
    progress("solving")
    result = identify(model, bags, checks, provenance, choices, cutoff, found, knobs, with_load)
    return replace(result, ceiling=_ceiling(robot, result.series))


def _ceiling(robot: RobotModel, series: Sequence[ResidualSeries]) -> Ceiling | None:
    """What black boxes predict of what the model leaves where it was not fitted; None where no stretch is long enough to ask."""
    motions, rest = [], []
    for s in series:
        cuts = np.flatnonzero(np.diff(s.t) > 1.5 * s.period) + 1
        for a, b in pairwise([0, *cuts.tolist(), len(s.t)]):
            if (b - a) * s.period >= _SHORTEST:
                rows = slice(a, b)
                even = s.t[a] + s.period * np.arange(b - a)
                motions.append(Motion(robot, even, s.q[rows], s.v[rows], s.a[rows], s.tau_measured[rows], s.tau_nominal[rows]))
                rest.append(s.residual[rows])
    return ceiling(robot.joint_names, motions, rest) if motions else None


def _at_own_times(*groups: Sequence[Recording]) -> tuple[list[list[Recording]], list[Problem]]:
    """The recordings of each group with their values at the times at which they were true, and what their stamps were off by."""
    each = [[at_own_times(r) for r in group] for group in groups]
    off = [Problem(r.name, "", "stamps", words) for group in each for r, words in group if words]
    return [[r for r, _ in group] for group in each], off


def _check_empty(robot: RobotModel, recordings: Sequence[Recording], accept_doubts: bool) -> list[Problem]:
    """What was carried for a part of a recording.

    Raises:
        DataError: something was, and that is not accepted.
    """
    found = [problem for recording in recordings for problem in check_carried(robot, recording)]
    if found and not accept_doubts:
        raise DataError(f"{found[0].bag}: {found[0].text} --accept-doubts goes on regardless.")
    return found


def _check_motion(robot: RobotModel, recordings: Sequence[SmoothRecording], accept_doubts: bool) -> list[Problem]:
    """What is doubtful about the motion and the effort.

    Raises:
        DataError: a joint hardly moves, or the effort can't be this robot's and that is not accepted.
    """
    model = free_model(robot)
    bags = [recording.rows(model) for recording in recordings]
    require_motion(robot, bags)
    try:
        return check_plausible(robot, bags, Prior.of(model).mean)
    except DataError as error:
        if not accept_doubts:
            raise DataError(f"{error} --accept-doubts goes on regardless.") from None
        return [Problem("", "", "implausible_effort", f"{str(error)[0].upper()}{str(error)[1:]}")]


def _require(choices: Choices) -> None:
    wishes(choices.friction, choices.effects)
    for name, value, allowed in (("method", choices.method, METHODS), ("form", choices.form, FORMS)):
        if value not in allowed:
            raise SettingsError(f"{name} is '{value}'; it must be one of {', '.join(allowed)}.")
    if choices.prior_weight is not None and not choices.prior_weight > 0.0:
        raise SettingsError(
            f"the weight of the prior is {choices.prior_weight}; it must be above 0, or inf for the URDF's own links."
        )
