"""Library: every candidate effect as terms on the recordings at hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.temperature import over_temperature
from sysid_ros.diagnosis.term import COMPANIONS, Term
from sysid_ros.effects import EFFECTS, Effect, JointCurves, JointEffect, Motion
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

LOCAL = (
    "coulomb_friction",
    "viscous_friction",
    "quadratic_friction",
    "asymmetric_coulomb_friction",
    "stribeck_friction",
    "load_dependent_friction",
    "presliding_hysteresis",
    "friction_drift",
    "rotor_inertia",
    "torque_offset",
    "torque_offset_drift",
    "torque_scale",
    "torque_saturation",
    "joint_coupling",
    "spring",
    "cogging",
)
"""Effects that load one joint at a time."""
WHOLE = ("payload", "payload_change", "base_tilt", "gravity_compensated_effort", "external_force", "time_delay")
"""Effects of the whole arm."""

ON_LOAD = ("load_dependent_friction", "joint_elasticity", "backlash")
"""Effects whose columns depend on the torque of the links."""
ON_DRIVE = ("torque_scale", "torque_saturation", "joint_coupling", "time_delay")
"""Effects whose columns depend on the torque of the drives."""
ON_LINKS = ("base_tilt", "joint_offset")
"""Effects of where the links are, in proportion to what they weigh."""
LINK_SIDE = ("payload", "payload_change", "link_inertia", "base_tilt", "external_force", "joint_offset", "spring")
"""Effects whose torque goes through the gears."""
MEASUREMENT = ("torque_scale", "torque_saturation", "time_delay", "torque_offset", "torque_offset_drift")
"""Effects of the measurement, not of the drives."""

_SHARP = 0.005
"""Width of the sign of a velocity, below the speeds at which a joint counts as standing [rad/s]."""

_LIMITS = (0.5, 0.6, 0.7, 0.8, 0.87, 0.93, 0.97)
"""Quantiles of the torque of the drives that are tried first as limits of a sensor."""
_INSIDE = 1.0
"""A change that is looked for lies inside of a recording by so much [s]."""
_ASKED = 0.97
"""Limit of a motor as a part of what is asked of it at most."""
_OFTEN, _AT_MOST = 0.85, 0.99
"""Quantiles of the efforts asked and of the torques given: what is not at the limit, and what is hardly ever exceeded."""


class Library:
    """Terms of the effects, computed once for each setting of their knobs.

    Args:
        band: the frequency domain, with its motions.
        inside: a change lies inside of a recording by so much [s]; below 0 it may have been before it, or never.
    """

    def __init__(self, robot: RobotModel, band: Band, inside: float = _INSIDE) -> None:
        self.robot, self.band, self.inside = robot, band, inside
        self._curves: dict[tuple[str, str], FloatArray] = {}
        self._options: dict[tuple[str, int], list[Term]] = {}

    def update(self, link_torque: Sequence[FloatArray], drive_torque: Sequence[FloatArray]) -> None:
        """Take in what is now known of the torques on both sides of the gears; terms that depend on them are made anew."""
        self.band.motions = tuple(
            m.with_torques(link, drive) for m, link, drive in zip(self.band.motions, link_torque, drive_torque, strict=True)
        )
        for key in [k for k in self._curves if k[0] in ON_LOAD + ON_DRIVE]:
            del self._curves[key]
        for option in [k for k in self._options if k[0] in ON_LOAD + ON_DRIVE]:
            del self._options[option]

    @property
    def motions(self) -> tuple[Motion, ...]:
        """The recordings."""
        return self.band.motions

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the recordings, of which each has one motion or several."""
        return tuple(dict.fromkeys(m.recording for m in self.motions))

    def times(self, recording: str = "") -> tuple[float, float]:
        """First and last time of a recording, of all without a name [s]."""
        motions = [m for m in self.motions if not recording or m.recording == recording] or self.motions
        return float(min(m.t[0] for m in motions)), float(max(m.t[-1] for m in motions))

    def _curves_of(self, effect: JointEffect | JointCurves) -> FloatArray:
        key = effect.id, repr(effect.settings)
        if key not in self._curves:
            self._curves[key] = self.band.curves([np.asarray(effect.curves_along(m)) for m in self.motions])
        return self._curves[key]

    def local(self, effect_id: str, joint: int, **settings: Any) -> Term:
        """A term that loads one joint."""
        every = self._make(effect_id, (), settings)
        assert isinstance(every, JointEffect | JointCurves)
        columns = np.ascontiguousarray(self._curves_of(every)[:, :, joint].T)
        joints: tuple[int, ...] = (joint,)
        if follows := settings.get("follows"):
            joints = (joint, self.robot.joint_names.index(follows))
        effect = self._make(effect_id, (joint,), settings)
        load = self._given(joint) if settings.get("kind") == "motor" else 0.0
        return Term(effect, joints, joint, columns, form=str(settings.get("shape", settings.get("over", ""))), load=load)

    def _given(self, joint: int) -> float:
        """Torque that a joint's motor has been seen to give: its limit is not below [N m]."""
        asked = np.concatenate([np.abs(m.tau[:, joint]) for m in self.motions])
        given = np.concatenate([np.abs(m.drive_torque[:, joint]) for m in self.motions])
        return max(float(np.quantile(asked, _OFTEN)), float(np.quantile(given, _AT_MOST)))

    def column(self, effect_id: str, joint: int, settings: dict[str, Any]) -> FloatArray:
        """Columns of a term that loads one joint, shape (K, p), computed for that joint alone."""
        effect = self._make(effect_id, (joint,), settings)
        assert isinstance(effect, JointEffect | JointCurves)
        return self.band.joint_curves(joint, [np.asarray(effect.curves_along(m.of_joint(joint)))[:, :, 0] for m in self.motions])

    def whole(
        self, effect_id: str, joints: Sequence[int] = (), basis: FloatArray | None = None, form: str = "", **settings: Any
    ) -> Term:
        """A term that loads several joints.

        Args:
            joints: that it is named with; empty for all. basis: combinations of the effect's columns, shape (effect.p, p).
        """
        if "t0" in settings:  # what has changed before or after all that was recorded has not changed
            start, end = self.times(settings.get("recording", ""))
            settings["t0"] = float(np.clip(settings["t0"], start + self.inside, end - self.inside))
        effect = self._make(effect_id, joints, settings)
        columns = self.band.rows([effect.columns_along(m) for m in self.motions])
        if basis is not None:
            columns = columns @ basis
        load = 0.0
        if len(joints) == 1:
            load = float(np.sqrt(np.mean([np.mean(m.link_torque[:, joints[0]] ** 2) for m in self.motions])))
        return Term(effect, tuple(joints) or tuple(range(self.robot.n)), None, columns, basis, form, load)

    def _make(self, effect_id: str, joints: Sequence[int], settings: dict[str, Any]) -> Effect:
        return EFFECTS[effect_id].from_settings(self.robot, [self.robot.joint_names[j] for j in joints], settings)

    def local_options(self, effect_id: str, joint: int) -> list[Term]:
        """One term for each setting of the knobs that is tried first."""
        key = effect_id, joint
        if key not in self._options:
            self._options[key] = [self.local(effect_id, joint, **settings) for settings in self._settings(effect_id, joint)]
        return self._options[key]

    def _settings(self, effect_id: str, joint: int) -> list[dict[str, Any]]:
        effect = EFFECTS[effect_id]
        if effect_id == "friction_drift":
            return [{}, *over_temperature(self.motions, joint)]
        if effect_id == "spring":
            return [{"shape": "line"}, {"shape": "sine"}]
        if effect_id == "cogging":
            return [{"harmonic": float(h)} for h in range(3, 61)]
        if effect_id == "joint_coupling":
            return [{"follows": name} for k, name in enumerate(self.robot.joint_names) if k != joint]
        if effect_id == "torque_saturation":
            drive = np.concatenate([np.abs(m.drive_torque[:, joint]) for m in self.motions])
            asked = max(float(np.abs(m.tau[:, joint]).max()) for m in self.motions)
            out = [{"limit": float(x), "kind": "sensor"} for x in np.unique(np.quantile(drive, _LIMITS)) if x > 0.0]
            least = self._given(joint)
            if 0.0 < least < _ASKED * asked:
                out += [{"limit": float(x), "kind": "motor"} for x in np.geomspace(least, _ASKED * asked, len(_LIMITS))]
            return out
        if effect_id == "stribeck_friction":
            knob = effect.knobs[0]
            return [{"vs": float(x), "width": _SHARP} for x in np.geomspace(knob.low, knob.high, 8)]
        if effect.knobs and effect.knobs[0].name != "width":
            knob = effect.knobs[0]
            grid = np.geomspace(knob.low, knob.high, 8) if knob.logarithmic else np.linspace(knob.low, knob.high, 8)
            return [{knob.name: float(x)} for x in grid]
        return [{}]

    def together(self, term: Term, present: Sequence[Term]) -> list[Term]:
        """A term with what it brings along on its joint, where that is not there yet."""
        other = COMPANIONS.get(term.id)
        if other is None or any(t.id == other and t.row == term.joints[0] for t in present):
            return [term]
        return [term, self.local(other, term.joints[0])]

    def whole_options(self) -> list[Term]:
        """Terms that load several joints, in every form that is tried first."""
        n = self.robot.n
        terms = [self.whole(name) for name in WHOLE if name != "payload_change"]
        terms += [self.whole("joint_offset", (j,)) for j in range(n)]
        columns = self.band.rows([m.regressor for m in self.motions])
        for j in range(n):
            own = columns[:, :, 10 * j : 10 * j + 10]
            if not np.any(own):
                continue
            effect = self._make("link_inertia", (j,), {})
            pi = self.robot.pi[10 * j : 10 * j + 10]
            if np.any(pi):
                terms.append(Term(effect, (j,), None, own @ pi[:, None], pi[:, None], "scale"))
            terms.append(Term(effect, (j,), None, own[:, :, :4].copy(), np.eye(10)[:, :4], "first moment"))
            terms.append(Term(effect, (j,), None, own.copy(), np.eye(10), "full"))
        # four columns where the motion is too slow to show the inertia
        terms.append(self.whole("payload", basis=np.eye(10)[:, :4], form="first moment"))
        names = self.recordings
        for name in names:
            where: dict[str, Any] = {"recording": name} if len(names) > 1 else {}
            for t0 in np.linspace(*self.times(name), 16)[1:-1]:
                terms.append(self.whole("payload_change", t0=float(t0), **where))
                terms.append(self.whole("payload_change", basis=np.eye(10)[:, :4], form="first moment", t0=float(t0), **where))
        return terms
