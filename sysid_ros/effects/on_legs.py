"""OnLegs: what an effect says of itself to whoever looks for causes in recordings of a robot on legs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from sysid_ros.effects.traits import Candidate
from sysid_ros.sample import FloatArray


class OnLegs:
    """The questions of a search on a floating base, each with the answer of an effect that is not looked for there.

    Attributes:
        on_legs: True where the rows of a robot on legs tell its parameters, and a search has it among its candidates.
    """

    on_legs: ClassVar[bool] = False

    @classmethod
    def settings_on_legs(cls, trunk: str, feet: Sequence[str]) -> dict[str, Any]:
        """Constructor arguments of the one that is looked for; ``trunk`` and ``feet`` are names of links."""
        return {}

    def candidates_on_legs(self) -> list[Candidate]:
        """The forms that a search has of it."""
        return [Candidate()]

    def usual_on_legs(self, torque: float) -> FloatArray | float:
        """Standard deviation of each of its parameters that no robot on legs is free of, and that is no cause; 0: it is free.
        Shape () or (p,).

        Args:
            torque: what a joint of a leg holds while the robot stands [N m].
        """
        return 0.0
