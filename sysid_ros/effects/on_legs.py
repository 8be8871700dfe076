"""OnLegs: what an effect says of itself to whoever looks for causes in recordings of a robot on legs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.traits import Candidate
from sysid_ros.sample import FloatArray
from sysid_ros.signals.shown_gravity import ShownGravity


class OnLegs:
    """The questions of a search on a floating base, and of a simulation that hides a cause in one, each with the answer of an
    effect that is not looked for there.

    Attributes:
        everywhere: True where a simulation hides it on all joints of the legs, not on one. signed_on_legs: a size that it draws
            may be negative.
        on_legs: True where the rows of a robot on legs tell its parameters, and a search has it among its candidates.
    """

    parameter_names: tuple[str, ...]
    on_legs: ClassVar[bool] = False
    everywhere: ClassVar[bool] = False
    signed_on_legs: ClassVar[bool] = False

    @classmethod
    def settings_on_legs(cls, trunk: str, feet: Sequence[str]) -> dict[str, Any]:
        """Constructor arguments of the one that is looked for; ``trunk`` and ``feet`` are names of links."""
        return {}

    def candidates_on_legs(self) -> list[Candidate]:
        """The forms that a search has of it."""
        return [Candidate()]

    def see_gravity(self, shown: ShownGravity) -> None:
        """Take note of what the accelerometer shows beside its motion, which no row of the robot's holds."""

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        """The least and the greatest size that a simulation hides, of each of its parameters; nothing: it hides none.

        Args:
            torque: what a joint of a leg holds while the robot stands [N m].
        """
        return 0.0, 0.0

    def drawn_on_legs(self, size: float, rng: np.random.Generator) -> FloatArray:
        """Parameters of a size that is hidden, shape (p,): of several the signs are drawn."""
        signs = rng.choice([-1.0, 1.0], len(self.parameter_names)) if len(self.parameter_names) > 1 else np.ones(1)
        return np.asarray(size * signs)

    def usual_on_legs(self, torque: float) -> FloatArray | float:
        """Standard deviation of each of its parameters that no robot on legs is free of, and that is no cause; 0: it is free.
        Shape () or (p,).

        Args:
            torque: what a joint of a leg holds while the robot stands [N m].
        """
        return 0.0
