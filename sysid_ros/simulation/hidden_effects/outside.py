"""What the causes outside the library have in common."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect


class Outside(HiddenCause):
    """A cause that no effect of the library describes, with no parameter to find."""

    outside = True

    def hidden(self, c: Circumstances, joint: int, **settings: object) -> HiddenEffect:
        """It, on one joint."""
        return HiddenEffect(self.id, (c.robot.joint_names[joint],), (), "outside", settings)

    def neighbour(self, c: Circumstances, joint: int) -> str:
        """The joint before, or the second one's name for the first."""
        return c.robot.joint_names[joint - 1 if joint > 0 else 1]
