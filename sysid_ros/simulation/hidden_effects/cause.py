"""HiddenCause: all that the simulation and the exam of the diagnosis know of one cause; and its usual kinds."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial
from typing import ClassVar, TypeVar

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects.channels import Signals
from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect, TrueParameter
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot

__all__ = [
    "CAUSES",
    "ArmCause",
    "Circumstances",
    "HiddenCause",
    "HiddenEffect",
    "JointCause",
    "Pairs",
    "Signals",
    "TorqueShare",
    "TrueRobot",
    "register_hidden",
]

Pairs = tuple[tuple[str, str], ...]


class HiddenCause(ABC):
    """One cause that a simulated robot can hide: how it is drawn, how it is built in, what a diagnosis can find of it.

    A cause has no state; what is drawn is a :class:`.hidden_effect.HiddenEffect`.

    Attributes:
        id: as in ``diagnosis.json``.
        parameters: name and unit of each number that a diagnosis should find.
        adds, puts: array of :class:`.joint_physics.Joints` and the parameter or setting that is added to it, or replaces it.
        outside: True where no effect of the library describes it: a diagnosis should say that something is left.
        in_messages: it lies between the robot and its messages, and changes nothing that moves.
        in_torque: it shows as something added to the torque.
        local: it acts on its joints alone, and so must show on each of them.
        family: of the causes of one family a joint has one: two describe one thing twice.
        dry: it is dry friction, which stands in place of a joint's usual one.
        everywhere: every joint of a usual robot has it, see :meth:`draw_everywhere`.
        leads: it can be wrong by so much more than all that is a little wrong with any robot (:meth:`as_built`) that it is what
            an engineer wants to hear of first.
        either: of the causes with one word here each joint of a robot as built has one; empty: there is no such choice.
        within: ids of what it is made of: who names it has named them too, and they are there where it is.
        changes_input: it changes what every other cause looks like; a pair with it has one answer only after it is undone.
        plain: which of ``constant``, ``sign`` and ``velocity`` (of each joint's motion) may not be taken from it, see
            :func:`.visibility.shown_as_itself`.
        whole_arm: it belongs to no joint. ordered: the order of its joints is a part of the answer.
        sized: False where its name says all. counted: parameters that are whole numbers, which have no interval.
        companions: ids of what it brings along: no false alarm beside it.
        equivalent: ids of other names for the same thing in some motions: right where the diagnosis says that it can't tell.
        rattles: what it does hangs on instants that nobody measures: two simulators agree on it only roughly, and how often it
            is found has no target.
    """

    id: ClassVar[str]
    parameters: ClassVar[Pairs] = ()
    adds: ClassVar[Pairs] = ()
    puts: ClassVar[Pairs] = ()
    outside: ClassVar[bool] = False
    in_messages: ClassVar[bool] = False
    in_torque: ClassVar[bool] = True
    local: ClassVar[bool] = False
    family: ClassVar[str] = ""
    dry: ClassVar[bool] = False
    everywhere: ClassVar[bool] = False
    leads: ClassVar[bool] = False
    either: ClassVar[str] = ""
    within: ClassVar[tuple[str, ...]] = ()
    changes_input: ClassVar[bool] = False
    plain: ClassVar[tuple[str, ...]] = ()
    whole_arm: ClassVar[bool] = False
    ordered: ClassVar[bool] = False
    sized: ClassVar[bool] = True
    counted: ClassVar[tuple[str, ...]] = ()
    companions: ClassVar[tuple[str, ...]] = ()
    equivalent: ClassVar[tuple[str, ...]] = ()
    rattles: ClassVar[bool] = False

    @abstractmethod
    def draw(self, c: Circumstances) -> HiddenEffect:
        """Where it is and how large, so that it shows and is not absurd."""

    def on(
        self,
        c: Circumstances,
        joints: list[int],
        sizes: list[list[float]],
        kind: str = "",
        units: Sequence[str] = (),
        **settings: object,
    ) -> HiddenEffect:
        """It, on some joints, with a value of each parameter for each of them; ``units`` where they depend on its kind."""
        names = tuple(c.robot.joint_names[j] for j in joints)
        parameters = tuple(
            TrueParameter(name, joint, float(value), unit)
            for (name, _), unit, values in zip(self.parameters, units or [u for _, u in self.parameters], sizes, strict=True)
            for joint, value in zip(names, values, strict=True)
        )
        return HiddenEffect(self.id, names, parameters, kind, settings)

    def of_arm(self, c: Circumstances, sizes: list[float | tuple[float, ...]], **settings: object) -> HiddenEffect:
        """It, where it belongs to no joint, with a value of each parameter."""
        named = zip(self.parameters, sizes, strict=True)
        parameters = tuple(TrueParameter(name, None, value, unit) for (name, unit), value in named)
        return HiddenEffect(self.id, c.robot.joint_names, parameters, "", settings)

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        """Build what was drawn into the robot, from its own equation."""
        for array, name in self.adds:
            true.add(array, effect.per_joint(name))
        for array, name in self.puts:
            true.put(array, effect.per_joint(name))
        if self.in_messages:
            true.channels.append(partial(self.publish, effect, true))

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        """The changed messages of what is ``in_messages``; ``true`` is the robot's motion and torque without noise."""
        return signals

    def draw_everywhere(self, c: Circumstances) -> HiddenEffect:
        """On every joint, as large as a usual robot has it; asked of what is ``everywhere``."""
        return self.draw(c)

    def as_built(self, c: Circumstances) -> tuple[HiddenEffect, ...]:
        """As every robot has it that nothing is wrong with, a little on each joint; empty where it is not the rule."""
        return ()

    def at_another_time(self, effect: HiddenEffect, duration: float, rng: np.random.Generator) -> HiddenEffect:
        """The same effect in another recording of ``duration`` [s]: what happened at a time happens at another."""
        return effect

    def shows_on(self, effect: HiddenEffect) -> tuple[str, ...]:
        """Joints in whose torque it must show; empty: in that of any."""
        return effect.joints if self.local else ()

    def rivals(
        self, effect: HiddenEffect, true: TrueRobot, q: FloatArray, v: FloatArray, a: FloatArray
    ) -> tuple[FloatArray, list[FloatArray]]:
        """Its torque along a motion, shape (K, n) [N m], and the columns, shape (K, n, p) each, of every other single cause
        that is as linear and might explain all of it."""
        return np.zeros_like(q), []


class JointCause(HiddenCause):
    """A cause whose ``parameters`` each joint has for itself.

    Attributes:
        single: True where it is on one joint, and not on some.
    """

    single: ClassVar[bool] = False

    def where(self, c: Circumstances) -> list[int]:
        """Joints that it is drawn for."""
        return [c.one_joint()] if self.single else c.some_joints()

    @abstractmethod
    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        """Values of each parameter, one a joint."""

    def usual_sizes(self, c: Circumstances) -> list[list[float]]:
        """As :meth:`sizes`, of every joint of a robot as built; empty where it is not the rule."""
        return []

    def as_built(self, c: Circumstances) -> tuple[HiddenEffect, ...]:
        sizes = self.usual_sizes(c)
        return (self.on(c, list(range(c.robot.n)), sizes),) if sizes else ()

    def draw(self, c: Circumstances) -> HiddenEffect:
        joints = self.where(c)
        return self.on(c, joints, self.sizes(c, joints))


class TorqueShare(JointCause):
    """One number a joint, the factor of a torque ``number x(t)`` that is a share of the joint's usual one.

    Attributes:
        share: least and largest. signed: the number may be negative. usual_share: as ``share``, in a usual robot.
    """

    local = True
    share: ClassVar[tuple[float, float]]
    signed: ClassVar[bool] = False
    usual_share: ClassVar[tuple[float, float]]

    def usual(self, c: Circumstances, joint: int) -> float:
        """Usual size of x."""
        return 1.0

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        signed = ((c.sign() if self.signed else 1.0) * c.share(*self.share) for _ in joints)
        return [[size * c.torque[j] / self.usual(c, j) for j, size in zip(joints, signed, strict=True)]]

    def draw_everywhere(self, c: Circumstances) -> HiddenEffect:
        joints = list(range(c.robot.n))
        return self.on(c, joints, [[c.uniform(*self.usual_share) * c.torque[j] / self.usual(c, j) for j in joints]])


class ArmCause(HiddenCause):
    """A cause whose ``parameters`` belong to no joint."""

    whole_arm = True

    @abstractmethod
    def size(self, c: Circumstances) -> list[float | tuple[float, ...]]:
        """A value of each parameter."""

    def draw(self, c: Circumstances) -> HiddenEffect:
        return self.of_arm(c, self.size(c))


CAUSES: dict[str, HiddenCause] = {}
"""Every cause by its id."""

Cause = TypeVar("Cause", bound=HiddenCause)


def register_hidden(cause: type[Cause]) -> type[Cause]:
    """Make a cause known to the simulation by its id; also at run time.

    Raises:
        SettingsError: another cause has the id.
    """
    if cause.id in CAUSES:
        raise SettingsError(f"a hidden cause '{cause.id}' is registered already. Give the new one another id.")
    CAUSES[cause.id] = cause()
    return cause
