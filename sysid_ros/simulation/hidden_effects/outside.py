"""What the causes outside the library have in common."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot


class Outside(HiddenCause):
    """A cause that no effect of the library describes, with no parameter to find."""

    outside = True

    def hidden(self, c: Circumstances, joint: int, **settings: object) -> HiddenEffect:
        """It, on one joint."""
        return HiddenEffect(self.id, (c.robot.joint_names[joint],), (), "outside", settings)


class ByNeighbour(Outside):
    """One that follows the position of the joint before, or for the first joint of the second."""

    def beside(self, c: Circumstances, joint: int, **settings: object) -> HiddenEffect:
        """It, on one joint, with the name of its neighbour."""
        return self.hidden(c, joint, neighbour=c.robot.joint_names[joint - 1 if joint > 0 else 1], **settings)

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        super().realise(effect, true)
        true.put("neighbour", {effect.joints[0]: float(true.index(effect.settings["neighbour"]))})
