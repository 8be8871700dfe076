"""Causes that no effect of the library describes: a diagnosis is to say that something is left."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import (
    Circumstances,
    HiddenCause,
    HiddenEffect,
    Signals,
    TrueRobot,
    register_hidden,
)


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


@register_hidden
class OutsideHum(Outside):
    """A disturbance of fixed frequency in time."""

    id = "outside_hum"
    adds = (("hum", "amplitude"),)
    puts = (("hum_frequency", "frequency"),)

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        return self.hidden(c, j, amplitude=float(c.share(0.1, 0.4) * c.torque[j]), frequency=c.uniform(0.8, 4.0))


@register_hidden
class OutsideNeighbourDamping(ByNeighbour):
    """Viscous friction that follows the neighbour's position: ``d (1 + sin(q_neighbour)) v``."""

    id = "outside_neighbour_damping"
    puts = (("neighbour_damping", "damping"),)

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        return self.beside(c, j, damping=float(c.share(0.1, 0.4) * c.torque[j] / c.speed[j]))


@register_hidden
class OutsideNeighbourFriction(ByNeighbour):
    """Dry friction whose level follows the neighbour's position: ``F (1 + share sin(2 q_neighbour)) sign(v)``."""

    id = "outside_neighbour_friction"
    adds = (("coulomb_forward", "level"), ("coulomb_backward", "level"))
    puts = (("neighbour_friction", "share"),)

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        return self.beside(c, j, level=float(c.share(0.1, 0.4) * c.torque[j]), share=c.uniform(0.6, 1.0))


@register_hidden
class OutsideWobblingGain(Outside):
    """A torque constant that swings with time: ``1 + size sin(2 pi t / period)``."""

    id = "outside_wobbling_gain"
    in_messages = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint(c.torque > 0.1 * c.torque.max())
        return self.hidden(c, j, size=c.share(0.15, 0.4), period=c.uniform(4.0, 9.0))

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        tau, joint = signals.tau.copy(), robot.index(effect.joints[0])
        tau[:, joint] *= 1.0 + effect.settings["size"] * np.sin(2.0 * np.pi * signals.t / effect.settings["period"])
        return signals.with_tau(tau)
