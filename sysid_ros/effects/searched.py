"""Searched: what an effect says of itself to whoever looks for causes in recordings."""

from __future__ import annotations

from abc import ABC
from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sysid_ros.effects.parameter import Parameter, by_delta_method
from sysid_ros.effects.traits import Candidate, DeflectionSearch, Knob, Scope
from sysid_ros.effects.wording import phrase
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion


class Searched(ABC):
    """The questions of a search, each with an answer that is sound for an effect that says nothing of its own.

    A ``theta`` here is that of the columns that were fitted, shape (m,): the effect's parameters, or combinations of them by the
    basis of a :class:`sysid_ros.effects.traits.Candidate`.

    Attributes:
        words: what it is told as, with braces as :func:`sysid_ros.effects.wording.phrase` fills them.
        setting_names: constructor arguments beside robot and joints, each of which stands in an attribute of its name.
        scope: what one occurrence belongs to.
        between: values of its parameters that are possible.
        companion: id of the effect that comes with it on its joint.
        includes: ids of the effects that are a part of it, and leave when it comes: it is only tried in their place.
        simpler: id of the effect that it must be clearly better than, to stand on a joint in its place.
        sum_of: ids of effects whose torques on one joint add up to its own as long as the joint moves.
        alone: the channels of its own joint are all that its curves need.
        instant: the knob that is the time of an event, empty for what is there all the time. changes: id of the effect whose
            parameters change then. times: settings counted from the first stamp of a recording.
        of_recording: it is there in one of several recordings, all the time, and not in the others.
        partial: it shows in a part of a recording only, and no other part predicts it.
        of_own_torque: its column is the torque that its joint is driven with.
        inertial: its torque is that of moving bodies, linear in the acceleration and of second order in the velocities.
        carried: it is a body that the robot carries, at times or always.
        size: of its parameters on robots that have it; infinite where that is not known. share: part of its joint's torque (rms)
            that each of its columns makes there.
        deflection: how its size is found where the torque is far from linear in that.
        leans: links have another torque because of it, see :meth:`links_along`; its columns have that of its setting ``links``.
        corrects: True where its columns are exact of a corrected torque only, see :meth:`correction_along`.
        low_passes: it makes the torque of all others late, in proportion to its parameter, see :meth:`published`.
    """

    id: ClassVar[str]
    label: ClassVar[str]
    words: ClassVar[str] = "{label} on {where} ({sizes})"
    family: ClassVar[str]
    nonnegative: ClassVar[bool]
    knobs: ClassVar[tuple[Knob, ...]]
    setting_names: ClassVar[tuple[str, ...]] = ()
    scope: ClassVar[Scope] = Scope.ARM
    between: ClassVar[tuple[float, float]] = (-np.inf, np.inf)
    companion: ClassVar[str] = ""
    includes: ClassVar[tuple[str, ...]] = ()
    simpler: ClassVar[str] = ""
    sum_of: ClassVar[tuple[str, ...]] = ()
    alone: ClassVar[bool] = False
    instant: ClassVar[str] = ""
    changes: ClassVar[str] = ""
    times: ClassVar[tuple[str, ...]] = ()
    of_recording: ClassVar[bool] = False
    partial: ClassVar[bool] = False
    of_own_torque: ClassVar[bool] = False
    inertial: ClassVar[bool] = False
    carried: ClassVar[bool] = False
    size: ClassVar[float] = np.inf
    share: ClassVar[float] = np.inf
    leans: ClassVar[bool] = False
    deflection: ClassVar[DeflectionSearch | None] = None
    corrects: ClassVar[bool] = False
    low_passes: ClassVar[bool] = False
    robot: RobotModel
    joints: NDArray[np.intp]
    parameter_names: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def settings(self) -> dict[str, Any]:
        """Constructor arguments beside robot and joints, in plain types."""
        return {name: getattr(self, name) for name in self.setting_names}

    @property
    def form(self) -> str:
        """Which of several forms with its settings it is."""
        return ""

    @property
    def apart(self) -> str:
        """What keeps two occurrences of it from being one finding."""
        return ""

    @property
    def concerned(self) -> tuple[int, ...]:
        """Indices of the joints that it is named with."""
        return tuple(int(j) for j in self.joints)

    @property
    def follows_temperature(self) -> bool:
        """True where it is made to follow the measured temperature of its joint."""
        return False

    @property
    def from_measured(self) -> bool:
        """True where its columns are made of the measured torque, and hold its noise."""
        return False

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        """The forms that a search starts from: its first knob over its range, where it has one.

        Args:
            motions: the recordings. joint: that it is to belong to; None for an effect of the whole arm.
        """
        knob = next((k for k in cls.knobs[:1] if k.reported), None)
        return [Candidate({knob.name: x}) for x in knob.grid()] if knob else [Candidate()]

    def correction_along(self, motion: Motion) -> FloatArray | None:
        """What is to be added to the measured torque for its columns to be exact, shape (N, n) [N m]; None for nothing."""
        return None

    def published(self, values: FloatArray, period: float, axis: int) -> FloatArray:
        """Torques of all others as they are published because of it, where its parameter is that of its setting ``around``.

        Args:
            values: along ``axis`` on an even grid. period: of the grid [s].
        """
        return values

    def links_along(self, motion: Motion, theta: FloatArray) -> FloatArray | None:
        """What each inertial of the links adds to the torque because of it, shape (N, n, 10 n); None for nothing."""
        return None

    def search_range(self, knob: Knob, value: float, torque: float) -> tuple[float, float]:
        """Where the optimum of a knob is searched near a first value; ``torque`` as in :meth:`possible`."""
        return knob.around(value)

    def reference_torque(self, motions: Sequence[Motion]) -> float:
        """Torque on its joint that tells which parameters are possible [N m]."""
        return 0.0

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        """True where physics allows the parameters, within twice their standard deviation.

        Args:
            theta, std: shape (m,). form: of the candidate. torque: of :meth:`reference_torque` [N m].
        """
        low, high = (0.0, np.inf) if self.nonnegative else self.between
        return bool(np.all((low < theta + 2.0 * std) & (theta - 2.0 * std < high)))

    def notable(self, theta: FloatArray) -> bool:
        """False where it is no more than what every recording has."""
        return True

    def prior_std(self, form: str = "") -> FloatArray:
        """Standard deviation of its parameters before any data, for what no motion shows, shape (p,); infinite: unknown."""
        return np.full(len(self.parameter_names), np.inf)

    def usual_size(self, form: str = "") -> FloatArray:
        """How large its parameters are on robots that have it, shape (p,); infinite: as large as one row of data could tell."""
        return np.full(len(self.parameter_names), self.size)

    def free_parameters(self, form: str, columns: int) -> int:
        """How many of a candidate's columns have a size that data alone tell: before any data they may have any."""
        return columns

    def excludes(self, other: Searched) -> bool:
        """True where it can't stand beside another effect of the same joint (or both of the whole arm)."""
        return type(self) is type(other) or (self.family != "" and self.family == other.family) or other.id in self.includes

    def same_torque(self, theta: FloatArray, motions: Sequence[Motion]) -> tuple[str, ...]:
        """Ids of other effects that make the same torque on these motions."""
        return ()

    def own_curve(self, motion: Motion) -> FloatArray:
        """Its column on its only joint, shape (N,): fast, to first order, for one of many that are tried; zero where the motion
        can't tell it from something simpler."""
        raise NotImplementedError(f"effect '{self.id}' has a deflection that is searched, and no curve to find it by.")

    @classmethod
    def own_curves(cls, motion: Motion, effects: Sequence[Self]) -> FloatArray:
        """:meth:`own_curve` of several effects on the same joint, shape (c, N)."""
        return np.stack([effect.own_curve(motion) for effect in effects])

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        """Its parameters as an engineer knows them: names, signs, units, with 95 % intervals.

        Args:
            values: theta of the columns, then the knobs in the order of ``knobs``, shape (m + k,). covariance: of them.
            basis: of the candidate.
        """
        if basis is not None:
            m, k = basis.shape[1], len(values) - basis.shape[1]
            whole = np.block([[basis, np.zeros((len(basis), k))], [np.zeros((k, m)), np.eye(k)]])
            values, covariance = whole @ values, whole @ covariance @ whole.T
        out, joint = [], None
        for i, name in enumerate(self.parameter_names):
            symbol, _, where = name.rstrip("]").partition("[")
            joint = where if where in self.robot.joint_names else None
            out.append(by_delta_method(symbol, joint, self.units[i], lambda x, i=i: float(x[i]), values, covariance))  # type: ignore[misc]
        for i, knob in enumerate(self.knobs, start=len(self.parameter_names)):
            if knob.reported:
                out.append(by_delta_method(knob.name, joint, knob.unit, lambda x, i=i: float(x[i]), values, covariance))  # type: ignore[misc]
        return out

    def in_words(self, parameters: Sequence[Parameter], where: str) -> str:
        """What it is told as, without a full stop: what is wrong, where, how large.

        Args:
            parameters: of all its occurrences, as :meth:`as_parameters` gives them. where: their joints in words.
        """
        return phrase(self.words, self.label, parameters, where)
