"""From raw recordings of a robot on legs to an identification: the same rows, fit and judge as an arm's, behind its feet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.floating.feet_along import STANDS
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.identification.channel_checks import CheckedRecording, check_legs
from sysid_ros.identification.free_effects import free_model_on_legs
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.identify import Choices, identify
from sysid_ros.identification.least_squares import fit
from sysid_ros.identification.result import CutOff, Identification, Problem
from sysid_ros.identification.rows import FORMS, BagRows, SmoothRecording
from sysid_ros.identification.spectrum import choose_cutoff
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.shown_gravity import ShownGravity, shown_gravity
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel

_UPWARD = 2
"""The row of the force along the trunk's z axis."""

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class LegRows:
    """The rows of recordings at what is known of IMU, feet and drives.

    Attributes:
        model: the free effects. smooth: the recordings after the filter. setup: by which IMU and feet were corrected. known: the
            torques by which feet in the air were told from feet that stand; None: of the URDF's links.
    """

    model: TorqueModel
    smooth: tuple[SmoothRecording, ...]
    setup: TrunkSetup
    known: TorqueModel | None

    def rows(self) -> list[BagRows]:
        """Of each recording, for the model."""
        return [recording.rows(self.model) for recording in self.smooth]


def rows_on_legs(
    base: FloatingBase,
    recordings: Sequence[CheckedRecording],
    cutoff_hz: float,
    max_gap: float = 0.1,
    measured_velocity: bool = False,
    setup: TrunkSetup | None = None,
    known: TorqueModel | None = None,
    shown: ShownGravity | None = None,
    stands: float = STANDS[0],
) -> LegRows:
    """Filter recordings of a robot on legs; ``stands``: see :data:`.feet_along.STANDS`.

    Raises:
        DataError: a recording is too short to leave a row, or has no IMU.
    """
    smooth = []
    for c in recordings:
        if c.recording.trunk is None:
            raise DataError(
                f"{c.recording.name}: not every joint state finds a message of the IMU, which a robot on legs needs. Record "
                "sensor_msgs/Imu beside the joints, from before their first message to after their last."
            )
        name, spoiled = c.recording.name, c.spoiled
        smooth.append(
            SmoothRecording.of(
                base.legs, c.recording, name, cutoff_hz, max_gap, FORMS[0], measured_velocity, spoiled, base, setup, known, stands
            )
        )
    return LegRows(free_model_on_legs(base, shown), tuple(smooth), setup or TrunkSetup(), known)


def learned(model: TorqueModel, theta: FloatArray) -> tuple[TrunkSetup, TorqueModel]:
    """What parameters, shape (p,), of a model's free effects say of IMU and feet, and of the torques."""
    setup, known = TrunkSetup(), []
    for effect, where in zip(model.free, model.slices, strict=True):
        one = effect.as_setup(theta[where])
        if one is None:
            known.append(KnownEffect(effect, theta[where]))
        else:
            setup = setup + one
    return setup, TorqueModel(model.robot, [], known)


def identify_on_legs(
    base: FloatingBase,
    recordings: Sequence[Recording],
    validation: Sequence[Recording],
    provenance: dict[str, Any],
    choices: Choices | None = None,
    cutoff_hz: float = 0.0,
    max_gap: float = 0.1,
    measured_velocity: bool = False,
    problems: Sequence[Problem] = (),
    progress: Progress = lambda what: None,
    gravity: float = 9.81,
) -> Identification:
    """As :func:`.identify_recordings`, of a robot on legs that carries nothing (or always the same).

    Its rows are those of :class:`.FeetAlong`. What is found of IMU and feet corrects the recordings, exactly, and what is found
    of the drives tells feet in the air from feet that stand; then the rows are made again. ``gravity`` is its size [m/s^2].

    Raises:
        SettingsError: something is asked for that holds for arms only. DataError: the recordings do not determine the parameters.
    """
    choices = choices or Choices()
    _require_of_legs(choices)
    checked = [check_legs(base.legs, r, max_gap) for r in (*recordings, *validation)]
    found = [*problems, *(p for c in checked for p in c.problems)]
    cutoff = CutOff(cutoff_hz, "as given") if cutoff_hz else choose_cutoff(recordings, base.legs.joint_names, max_gap)
    first = len(recordings)
    setup, known, shown = TrunkSetup(), None, shown_by(checked[:first], gravity)
    for turn, stands in enumerate(STANDS):
        progress(f"filtering, round {turn + 1} of {len(STANDS)}")
        made = rows_on_legs(base, checked[:first], cutoff.hz, max_gap, measured_velocity, setup, known, shown, stands)
        bags = made.rows()
        prior = Prior.of(made.model, base)
        if turn == 0:
            found += _accepted(check_weight(bags, prior.mean), choices.accept_doubts)
        theta = fit(bags, prior.mean, prior.std, choices.method).theta
        if turn < len(STANDS) - 1:
            setup, known = learned(made.model, theta)
    found += _accepted(_check_alike(bags, theta), choices.accept_doubts)
    checks = rows_on_legs(base, checked[first:], cutoff.hz, max_gap, measured_velocity, setup, known, shown, stands).rows()
    progress("solving")
    result = identify(made.model, bags, checks, provenance, choices, cutoff, found, base=base)
    return replace(result, friction="coulomb")


def shown_by(recordings: Sequence[CheckedRecording], gravity: float) -> ShownGravity | None:
    """What the accelerometer shows beside its motion."""
    return shown_gravity([(c.recording.t, c.recording.trunk) for c in recordings if c.recording.trunk is not None], gravity)


def _require_of_legs(choices: Choices) -> None:
    for name, given, only in (
        ("friction", choices.friction, ("auto", "coulomb")),
        ("form", choices.form, FORMS[:1]),
        ("effects", choices.effects, ((),)),
    ):
        if given not in only:
            raise SettingsError(
                f"{name} is {given!r}; of a robot on legs it must be {' or '.join(repr(x) for x in only)}: its rows are made for "
                "the links, the usual friction, rotors and offsets. Leave it out, or set base to 'fixed' if the trunk is held."
            )


def check_weight(bags: Sequence[BagRows], nominal: FloatArray) -> Problem | None:
    """Do the torques of the legs carry the weight that the URDF says? Friction and rotors are not known yet."""
    slopes = [_weight(bag, nominal) for bag in bags]
    listed = ", ".join(f"{bag.name} {x:.3g}" for bag, x in zip(bags, slopes, strict=True))
    if not np.all(np.isfinite(slopes)):
        text = (
            f"The feet carry the robot in next to none of a recording by the torques of its legs ({listed} times the URDF's "
            "weight). Give recordings in which it stands or walks, and check sign, unit and order of the efforts."
        )
        return Problem("", "", "off_ground", text)
    if not all(TOL.slope_low < x < TOL.slope_suspicious for x in slopes):
        text = (
            f"The torques of the legs do not carry the weight of the URDF's links ({listed} times it). Set effort_scale or "
            "effort_sign in --config if the effort is in another unit or direction, or give the URDF of the robot."
        )
        return Problem("", "", "implausible_effort", text)
    return None


def _check_alike(bags: Sequence[BagRows], theta: FloatArray) -> Problem | None:
    """Does the robot weigh the same in all recordings, by the model that was fitted to all of them?"""
    slopes = [_weight(bag, theta) for bag in bags]
    if max(slopes) - min(slopes) <= TOL.weights_differ:
        return None
    listed = ", ".join(f"{bag.name} {x:.3g}" for bag, x in zip(bags, slopes, strict=True))
    text = (
        f"The robot does not weigh the same in all recordings ({listed} times what one model for all says): it carried something "
        "in some of them, or the effort was in another scale. Identify from recordings in which it carries the same."
    )
    return Problem("", "", "bags_contradict", text)


def _accepted(problem: Problem | None, accept_doubts: bool) -> list[Problem]:
    """The problem, if there is one.

    Raises:
        DataError: it is not accepted.
    """
    if problem is not None and not accept_doubts:
        raise DataError(f"{problem.text} --accept-doubts goes on regardless.")
    return [problem] if problem else []


def _weight(bag: BagRows, nominal: FloatArray) -> float:
    """What the torques of the legs carry over the weight of the URDF's links; NaN where next to nothing tells it."""
    here = bag.moving[:, _UPWARD]
    if int(here.sum()) < TOL.fewest_rows:
        return float("nan")
    asked, shown = (bag.Y @ nominal)[here, _UPWARD], bag.tau[here, _UPWARD]
    return float(asked @ shown) / max(float(asked @ asked), 1e-12)
