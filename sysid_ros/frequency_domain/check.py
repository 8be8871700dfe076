"""check_frequency: up to which frequency a model holds, joint by joint, and what it misses beyond."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sysid_ros.estimators.one_thread import on_one_thread
from sysid_ros.exceptions import DataError
from sysid_ros.frequency_domain.beyond_linear import distortion, missing_friction
from sysid_ros.frequency_domain.causes import find_cause
from sysid_ros.frequency_domain.linearised import linearised
from sysid_ros.frequency_domain.lines import Channel, Record, joint_records
from sysid_ros.frequency_domain.local_fit import local_fit
from sysid_ros.frequency_domain.modes import Modes, find_modes
from sysid_ros.frequency_domain.result import FrequencyCheck, JointCheck, Response
from sysid_ros.frequency_domain.sentences import common_findings, with_sentences
from sysid_ros.frequency_domain.stretches import Stretch, stretches_of, top_frequency
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.frequency_domain.transfer_functions import FORMS, Form
from sysid_ros.frequency_domain.verdict import verdict
from sysid_ros.identification.channel_checks import check_channels
from sysid_ros.input_gate.message_faults import at_own_times
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import SLIDE, smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.signals.postures import Postures
from sysid_ros.signals.recording import Recording
from sysid_ros.torque.known_effect import KnownEffect

ASSUMPTIONS = (
    "Velocities and accelerations come from the positions by filters without phase that are flat below the top frequency; "
    "measured torques go through the same ones.",
    "The noise of the positions is white in the band (it is read from the spectrum above); its part of the model's torque is "
    "taken out of the response, and frequencies where it is more than a tenth are not judged.",
    "What disturbs the torque is small beside what the controller asks for: in closed loop the disturbance moves the joint, too.",
    "The model's dry friction has a response of its own beside the one that is judged, since no model is right where a velocity "
    "changes its sign: the model fails only by a misfit of 10 % of both together, and holds where the response alone is within "
    "10 %.",
    "Where a joint rests, its torque is taken from the model if dry friction hides it.",
)
_CHANNEL_FORMS = ("nothing", "gain", "delay", "low_pass")


@on_one_thread
def check_frequency(
    robot: RobotModel,
    recordings: Sequence[Recording],
    known: Sequence[KnownEffect] = (),
    top_hz: float = 0.0,
    max_gap: float = 0.1,
    progress: Callable[[int], None] = lambda steps: None,
    provenance: dict[str, Any] | None = None,
    order: int | None = None,
) -> FrequencyCheck:
    """Compare the model's torque with the measured one in the frequency domain.

    Args:
        robot: the URDF's model. recordings: of it, raw. known: effects of a model.yaml, else the URDF's links and
            ``<dynamics>`` are the model. top_hz: upper end of the band [Hz]; 0: a fifth of the rate, 40 Hz at most.
        max_gap: a longer gap between samples is not bridged [s]. progress: called with each joint that is done.
        order: of the state-space models; None for the one that predicts held-out blocks best.

    Raises:
        DataError: the recordings can't tell anything, and why.
    """
    timed = [at_own_times(r) for r in recordings]
    recordings = [r for r, _ in timed]
    top = top_frequency(recordings, top_hz)
    checked = [check_channels(robot, r, max_gap) for r in recordings]
    warnings = [f"{r.name}: {words}" for r, words in timed if words] + [f"{p.bag}: {p.text}" for c in checked for p in c.problems]
    parts = [stretches_of(robot, c, known, top, max_gap) for c in checked]
    stretches = [s for part in parts for s in part]
    if not stretches:
        raise DataError(_too_short(recordings, max_gap))
    for recording, part in zip(recordings, parts, strict=True):
        if not part:
            warnings.append(f"{recording.name}: no stretch of {TOLERANCES.shortest:g} s without a gap; it is left out.")
    _require_motion(robot, stretches)
    out = []
    for j in range(robot.n):
        out.append(_joint(robot, stretches, known, j, top, order))
        progress(1)
    lengths = tuple((r.name, float(sum(len(s.motion.t) * s.period for s in p))) for r, p in zip(recordings, parts, strict=True))
    seen = Postures(recordings[0].t, recordings[0].q)
    common, origin = common_findings(out), provenance or {}
    return FrequencyCheck(with_sentences(out), top, lengths, tuple(warnings), ASSUMPTIONS, common, origin, seen)


def _too_short(recordings: Sequence[Recording], max_gap: float) -> str:
    spans = [float(r.t[part][-1] - r.t[part][0]) for r in recordings for part in r.stretches(max_gap) if part.stop > part.start]
    return (
        f"{recordings[0].name}: the longest stretch without a gap of {max_gap:g} s lasts {max(spans, default=0.0):.1f} s; "
        f"{TOLERANCES.shortest:g} s and the length of the filters are the least that can be used. Record 20 s or more without "
        "loss."
    )


def _require_motion(robot: RobotModel, stretches: Sequence[Stretch]) -> None:
    moved = [_moved(stretches, j) for j in range(robot.n)]
    if max(moved) <= 0.0:
        raise DataError(
            f"{stretches[0].name}: no joint moves in it; nothing is excited. Record a motion, such as one of 'sysid excite', a "
            "chirp or a multisine."
        )


def _moved(stretches: Sequence[Stretch], joint: int) -> float:
    """Most of the time that a joint moves in any stretch, as a part."""
    shares = []
    for s in stretches:
        whole, _, part = s.rests(joint)
        shares.append(float(part * (whole.stop - whole.start) / len(s.motion.t)))
    return max(shares)


def _joint(
    robot: RobotModel, stretches: Sequence[Stretch], known: Sequence[KnownEffect], j: int, top: float, order: int | None
) -> JointCheck:
    weights = np.array([len(s.motion.t) for s in stretches], dtype=float)
    mean = np.average([s.inertia[0, j] for s in stretches], weights=weights)
    spread = np.sqrt(np.average([s.inertia[1, j] ** 2 + (s.inertia[0, j] - mean) ** 2 for s in stretches], weights=weights))
    gravity = float(np.average([_gravity_stiffness(s, j) for s in stretches], weights=weights))
    name, about, prismatic = robot.joint_names[j], (float(mean), float(spread)), bool(robot.is_prismatic[j])
    torque_channels = [
        Channel(s.model[:, j], s.motion.tau[:, j], lambda f, s=s: s.torque_noise(f)[:, j], _dry(s, j))  # type: ignore[misc]
        for s in stretches
    ]
    records = joint_records(stretches, j, torque_channels, top)
    if not records:
        why = (
            f"it moves {100.0 * _moved(stretches, j):.0f} % of the time of any stretch at most; "
            f"{TOLERANCES.shortest:g} s and {100.0 * TOLERANCES.moving:g} % are the least that can be used. Record a "
            "motion of this joint."
        )
        return JointCheck(name, None, None, None, why, why, about, gravity, prismatic)
    torque = _response(records, top, FORMS, _position_power(stretches, j, records, top))
    friction = missing_friction(stretches, j)
    if friction is not None:
        torque = replace(torque, cause=None)
        modes, why_no_modes = None, "the model lacks dry friction. Identify it first, with 'sysid identify'."
    else:
        modes, why_no_modes = _modes(stretches, known, j, torque, order)
    velocity = None
    published = [s for s in stretches if s.published is not None]
    if published:
        velocity_channels = [
            Channel(s.motion.v[:, j], s.published[:, j], lambda f, s=s: s.velocity_noise(f)[:, j])  # type: ignore[misc, index]
            for s in published
        ]
        lines = joint_records(published, j, velocity_channels, top, bridge=False)
        simple = [f for f in FORMS if f.name in _CHANNEL_FORMS]
        velocity = _response(lines, top, simple, None) if lines else None
    return JointCheck(name, torque, velocity, modes, "", why_no_modes, about, gravity, prismatic, friction)


def _dry(stretch: Stretch, joint: int) -> FloatArray | None:
    """Dry friction of the model, and the same sharper and softer where the velocity changes its sign, shape (N, 3)."""
    own = stretch.model[:, joint] - stretch.smooth[:, joint]
    if not own.any():
        return None
    unit = SLIDE if stretch.motion.robot.is_prismatic[joint] else 1.0
    return np.column_stack([own, *(smoothed_sign(stretch.motion.v[:, joint], w * unit) for w in TOLERANCES.turns)])


def _gravity_stiffness(stretch: Stretch, joint: int) -> float:
    robot = stretch.motion.robot
    some = stretch.motion.q[:: max(1, len(stretch.motion.q) // 50)]
    by_q, _, _ = robot.rnea_derivatives_along(some, np.zeros_like(some), np.zeros_like(some))
    return float(np.mean(by_q[:, joint, joint]))


def _response(records: list[Record], top: float, forms: Sequence[Form], positions: FloatArray | None) -> Response:
    windows = local_fit(records, top)
    step = records[0].period
    density = np.array([np.sqrt(2.0 * step * w.noise) for w in windows])
    cause = find_cause(records, windows, forms)
    return Response(
        tuple(windows),
        density,
        verdict(windows),
        cause,
        distortion(records, windows, positions, cause),
        float(sum(r.seconds for r in records)),
        tuple((r.seconds / r.spread.shape[1], r.spread.shape[1]) for r in records if r.spread is not None),
    )


def _position_power(stretches: Sequence[Stretch], joint: int, records: Sequence[Record], top: float) -> FloatArray | None:
    """Power of all joints' positions on the lines of the first periodic record, where that is the first of all."""
    first = records[0]
    if first.spread is None:
        return None
    n = stretches[0].motion.robot.n
    total = np.zeros(len(first.f))
    for j in range(n):
        channels = [Channel(s.motion.a[:, j], s.motion.q[:, j], np.zeros_like) for s in stretches]
        own = joint_records(stretches, j, channels, top, bridge=False)
        if own and own[0].spread is not None and len(own[0].f) == len(total):
            total += np.abs(own[0].Y) ** 2
    return total


def _modes(
    stretches: Sequence[Stretch], known: Sequence[KnownEffect], joint: int, torque: Response, order: int | None
) -> tuple[Modes | None, str]:
    carried = np.array([w.clear and w.coherence > TOLERANCES.coherent for w in torque.windows], dtype=float)
    share = np.cumsum(carried) / np.arange(1, len(carried) + 1)
    enough = np.flatnonzero((share >= TOLERANCES.mostly) & (carried > 0.0))
    top = torque.windows[enough[-1]].high if enough.size else 0.0
    if top < TOLERANCES.least_top:
        return None, (
            f"measured and modelled torque go together up to {top:.2g} Hz only; {TOLERANCES.least_top:g} Hz are needed. Record a "
            "chirp or a multisine of this joint."
        )
    smooth = float(np.sqrt(np.mean([w.share**2 for w in torque.windows if w.high <= top])))
    if smooth < TOLERANCES.mostly_smooth:
        return None, (
            f"dry friction makes {100.0 * np.sqrt(1.0 - smooth**2):.0f} % of its torque up to {top:.2g} Hz and moves the joint "
            "itself where the velocity changes its sign. Record a faster motion of this joint."
        )
    signals = linearised(stretches, joint, known, top)
    modes = None if signals is None else find_modes(signals, TOLERANCES.least_low, top, order=order)
    return modes, "" if modes else "the recording is too short to hold parts of it out. Record 20 s or more."
