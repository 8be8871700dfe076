"""VelocityAgreement: whether the velocities of a stream are those of its positions."""

from __future__ import annotations

from collections.abc import Sequence

from sysid_ros.input_gate import kernel

_WINDOWS_TO_DECIDE = 4


class VelocityAgreement:
    """Counts the windows in which the integral of each velocity was, or was not, the way that its position went.

    Attributes:
        trusted: whether velocities are believed. warning: why they are not, else empty. proven: whether they are and some window
            has shown it.
    """

    def __init__(self) -> None:
        self.trusted, self.proven, self.warning = True, False, ""
        self._disagreements = 0

    def compare(self, code: int, joint_names: Sequence[str]) -> None:
        """Take in what :func:`.kernel.check` said of a window, about one of the joints."""
        if code == kernel.WINDOW_AGREES:
            self._disagreements = max(self._disagreements - 1, 0)
            if self._disagreements == 0:
                self.trusted, self.proven, self.warning = True, True, ""
            return
        self._disagreements = min(self._disagreements + 1, _WINDOWS_TO_DECIDE)
        if self._disagreements == _WINDOWS_TO_DECIDE:
            self.trusted = self.proven = False
            self.warning = (
                f"The velocity of {joint_names[code // kernel.CODES]} does not agree with how its position changes. "
                "The velocity from positions is used instead; set velocity_source to 'position', or correct the driver."
            )
