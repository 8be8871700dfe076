"""HiddenCause: all that the simulation and the exam of the diagnosis know of one cause."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, TypeVar

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot

__all__ = ["CAUSES", "Circumstances", "HiddenCause", "HiddenEffect", "TrueRobot", "register_hidden"]


class HiddenCause(ABC):
    """One cause that a simulated robot can hide: how it is drawn, how it is built in, what a diagnosis can find of it.

    A cause has no state; what is drawn is a :class:`.hidden_effect.HiddenEffect`.

    Attributes:
        id: as in ``diagnosis.json``.
        outside: True where no effect of the library describes it: a diagnosis should say that something is left.
        in_torque: it shows as something added to the torque.
        local: it acts on its joints alone, and so must show on each of them.
        family: of the causes of one family a joint has one: two describe one thing twice.
        dry: it is dry friction, which stands in place of a joint's usual one.
        everywhere: every joint of a usual robot has it, see :meth:`draw_everywhere`.
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
    outside: ClassVar[bool] = False
    in_torque: ClassVar[bool] = True
    local: ClassVar[bool] = False
    family: ClassVar[str] = ""
    dry: ClassVar[bool] = False
    everywhere: ClassVar[bool] = False
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

    @abstractmethod
    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        """Build what was drawn into the robot, from its own equation."""

    def draw_everywhere(self, c: Circumstances) -> HiddenEffect:
        """On every joint, as large as a usual robot has it; asked of what is ``everywhere``."""
        return self.draw(c)

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
