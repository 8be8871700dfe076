"""A link that is not what the URDF says, hidden."""

import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.hidden_effect import TrueParameter
from sysid_ros.simulation.hidden_effects.payload import Inertial


@register_hidden
class LinkInertia(Inertial):
    """A link that is heavier or lighter than its URDF, or whose centre of mass is elsewhere; not the last one, which would be a
    payload, nor the first, of which only the inertia about a vertical axis shows, as a rotor's would."""

    id = "link_inertia"
    equivalent = ("payload", "spring", "rotor_inertia")
    leads = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        joint = c.one_joint((np.arange(c.robot.n) > 0) & (np.arange(c.robot.n) < c.robot.n - 1))
        kind = str(c.rng.choice(["mass", "com", "both"]))
        factor = 1.0 if kind == "com" else max(1.0 + c.sign() * c.share(0.15, 0.4), 0.2)
        direction = c.rng.normal(size=3)
        shift = np.zeros(3) if kind == "mass" else direction / np.linalg.norm(direction) * c.share(0.015, 0.05)
        return self._of_link(c.robot, joint, factor, shift, kind)

    def as_built(self, c: Circumstances) -> tuple[HiddenEffect, ...]:
        out = []
        for joint in range(c.robot.n):
            direction = c.rng.normal(size=3)
            shift = direction / np.linalg.norm(direction) * 0.005 * c.rng.standard_normal()
            out.append(
                self._of_link(c.robot, joint, 1.0 + 0.06 * float(np.clip(c.rng.standard_normal(), -3.0, 3.0)), shift, "both")
            )
        return tuple(out)

    def _of_link(self, robot: RobotModel, joint: int, factor: float, shift: FloatArray, kind: str) -> HiddenEffect:
        added = TrueRobot(robot).move_link(joint, factor, shift)
        parameters = (
            TrueParameter("dm", robot.joint_names[joint], float(added[0]), "kg"),
            TrueParameter("dmc", robot.joint_names[joint], tuple(added[1:4].tolist()), "kg m"),
        )
        settings = {"mass_factor": factor, "com_shift": shift.tolist()}
        return HiddenEffect(self.id, (robot.joint_names[joint],), parameters, kind, settings)

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        shift = np.array(effect.settings["com_shift"])
        true.move_link(self.changed_link(effect, true), effect.settings["mass_factor"], shift)

    def changed_link(self, effect: HiddenEffect, true: TrueRobot) -> int:
        return true.index(effect.joints[0])
