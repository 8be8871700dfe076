"""A body on the tip link, hidden; and what bodies on the tip and changed links have in common."""

from typing import ClassVar

import numpy as np

from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenCause, HiddenEffect, Pairs, TrueRobot, register_hidden
from sysid_ros.simulation.payload import Payload as Body
from sysid_ros.simulation.payload import box


class Inertial(HiddenCause):
    """What adds to the inertials of one link."""

    def changed_link(self, effect: HiddenEffect, true: TrueRobot) -> int:
        """The link that is not what the URDF says, by its joint."""
        return true.robot.n - 1

    def rivals(
        self, effect: HiddenEffect, true: TrueRobot, q: FloatArray, v: FloatArray, a: FloatArray
    ) -> tuple[FloatArray, list[FloatArray]]:
        """Each other link's ten inertials, a constant pull at the tip, a balancer on each joint."""
        robot, n = true.robot, true.robot.n
        regressor = robot.regressor_along(q, v, a)
        torque = regressor @ (true.pi_after - robot.pi.reshape(n, 10)).reshape(-1)
        changed = self.changed_link(effect, true)
        others = [regressor[:, :, 10 * k : 10 * k + 10] for k in range(n) if k != changed]
        balancers = np.zeros((n, len(q), n, 2))
        for j in range(n):
            balancers[j, :, j] = np.column_stack([np.sin(q[:, j]), np.cos(q[:, j])])
        return torque, [*others, true.tip_columns(q), *balancers]


class TipBody(Inertial):
    """A box on the tip link."""

    parameters: ClassVar[Pairs] = (("mass", "kg"), ("com", "m"))
    family = "body"
    leads = True
    whole_arm = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        direction = c.rng.normal(size=3)
        com = direction / np.linalg.norm(direction) * c.uniform(0.03, 0.12)
        mass = c.share(0.025, 0.08) * c.mass
        body = box(mass, com.tolist(), rpy=c.rng.uniform(-np.pi, np.pi, 3).tolist())
        return self.of_arm(c, [mass, tuple(com.tolist()), *self.more(c)], inertia_com=body.inertia_com.tolist())

    def more(self, c: Circumstances) -> list[float]:
        """What it has beside its mass and its centre of mass."""
        return []

    def body_of(self, effect: HiddenEffect) -> Body:
        """The body itself."""
        return Body(effect.number("mass"), effect.vector("com"), np.array(effect.settings["inertia_com"]))


@register_hidden
class Payload(TipBody):
    """A box on the tip link."""

    id = "payload"
    equivalent = ("link_inertia",)  # a body on the last link is a part of the last link

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.carry(self.body_of(effect))
