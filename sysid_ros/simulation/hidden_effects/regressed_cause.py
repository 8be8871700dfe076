"""RegressedCause: any effect of the library, hidden by its own columns."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.signal import butter, sosfiltfilt

from sysid_ros.effects import Acts, Effect, Knob, Motion
from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects.cause import HiddenCause
from sysid_ros.simulation.hidden_effects.channels import Signals
from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect, TrueParameter
from sysid_ros.simulation.hidden_effects.sensor_noise import BAND
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot

_ATTEMPTS = 20
_KEPT = 0.7
"""Part of the torque that lies below ``BAND`` where the knobs are well drawn: a ripple above it is hidden from everyone."""


class RegressedCause(HiddenCause):
    """``Y(q, v, a) theta`` of an effect that has no equation of its own here, added to the torque that the robot publishes.

    What moves is not changed by it. Knobs are drawn within their ranges, and theta so that the torque is a visible share of the
    usual one on the joint where it is largest, with columns of about equal size.

    Args:
        effect: of the library.
    """

    def __init__(self, effect: type[Effect]) -> None:
        self.effect = effect
        self.id = effect.id  # type: ignore[misc]

    def draw(self, c: Circumstances) -> HiddenEffect:
        names = c.robot.joint_names
        first = self.effect.from_settings(c.robot, names[:1], {})
        if not all(name.endswith(f"[{names[0]}]") for name in first.parameter_names):
            return HiddenEffect(self.id, names, tuple(self._drawn(c, None)))
        joints = c.some_joints()
        parameters = [p for j in joints for p in self._drawn(c, names[j])]
        return HiddenEffect(self.id, tuple(names[j] for j in joints), tuple(parameters))

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        terms = []
        for joint in dict.fromkeys(p.joint for p in effect.parameters):
            own = {p.name: float(p.value) for p in effect.parameters if p.joint == joint}  # type: ignore[arg-type]
            knobs = {knob.name: own[knob.name] for knob in self.effect.knobs}
            term = self.effect.from_settings(true.robot, () if joint is None else (joint,), knobs)
            terms.append((term, np.array([own[_symbol(name, joint)] for name in term.parameter_names])))
        # the robot's own torque passes through what its messages hide, a fault of the messages does not
        at = len(true.channels) if self.effect.acts is Acts.MEASUREMENT else 0
        true.channels.insert(at, partial(_with_terms, true, terms))

    def _drawn(self, c: Circumstances, joint: str | None) -> list[TrueParameter]:
        """Knobs and linear parameters, of one joint or of the whole arm."""
        low_pass = butter(4, BAND, fs=1.0 / float(c.t[1] - c.t[0]), output="sos")
        motion = Motion(c.robot, c.t, c.q, c.v, c.a, c.tau)
        for _ in range(_ATTEMPTS):
            knobs = {knob.name: _within(knob, c) for knob in self.effect.knobs}
            term = self.effect.from_settings(c.robot, () if joint is None else (joint,), knobs)
            columns = term.columns_along(motion) / c.torque[:, None]
            usual = np.sqrt(np.mean(columns**2, axis=(0, 1)))
            theta = c.rng.uniform(0.5, 1.0, term.p)
            if not term.nonnegative:
                theta *= c.rng.choice([-1.0, 1.0], term.p)
            theta = np.where(usual > 0.0, theta / np.where(usual > 0.0, usual, 1.0), 0.0)
            torque = columns @ theta
            seen = sosfiltfilt(low_pass, torque, axis=0)
            size, all_of_it = (float(np.sqrt(np.mean(x**2, axis=0)).max()) for x in (seen, torque))
            if size > 0.0 and size >= _KEPT * all_of_it:
                break
        else:
            where = "the robot" if joint is None else joint
            raise SettingsError(f"{self.id} has no torque on {where} below {BAND:g} Hz in this motion. Hide it elsewhere.")
        theta *= c.share(0.1, 0.4) / size
        linear = zip(term.parameter_names, theta.tolist(), term.units, strict=True)
        return [
            *(TrueParameter(knob.name, joint, knobs[knob.name], knob.unit) for knob in self.effect.knobs),
            *(TrueParameter(_symbol(name, joint), joint, value, unit) for name, value, unit in linear),
        ]


def _with_terms(robot: TrueRobot, terms: Sequence[tuple[Effect, FloatArray]], signals: Signals, true: Signals) -> Signals:
    """Effort plus the effects' torque along the true motion; each term is one joint's, or the whole arm's."""
    motion = robot.motion_of(true)
    return signals.with_tau(signals.tau + sum(term.torque_along(motion, theta) for term, theta in terms))


def _symbol(name: str, joint: str | None) -> str:
    return name if joint is None else name.removesuffix(f"[{joint}]")


def _within(knob: Knob, c: Circumstances) -> float:
    if knob.logarithmic:
        return float(np.exp(c.uniform(np.log(knob.low), np.log(knob.high))))
    return c.uniform(knob.low, knob.high)
