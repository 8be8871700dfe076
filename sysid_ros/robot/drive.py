"""Drive: what stands between the torque that is recorded and the torque that moves the links."""

from __future__ import annotations

import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


class Drive:
    """Friction and rotor inertia of the joints, as the torque that is left for the links.

    The equation over one step of length h, with v+ = v + h a::

        M(q) a + C(q, v) v + g(q) = tau - J a - b v+ - f,      f_j = Fc_j sign(v+_j) where v+_j is not 0, else any |f_j| <= Fc_j

    It is implicit in v+, so stiff friction and a rotor heavier than the link stay stable, and a joint can stick. The signs of f
    are found by switching joints between sliding and sticking until all agree (an active set on n boxes).

    Args:
        viscous_friction: b, shape (n,) [N m s/rad].
        coulomb_friction: Fc, shape (n,) [N m].
        rotor_inertia: J seen at the joint, shape (n,) [kg m^2].
        step: h [s].
    """

    def __init__(
        self, viscous_friction: FloatArray, coulomb_friction: FloatArray, rotor_inertia: FloatArray, step: float
    ) -> None:
        self._viscous = viscous_friction
        self._coulomb = coulomb_friction
        self._rotor = rotor_inertia
        self._step = step
        self.is_ideal = not (np.any(viscous_friction) or np.any(coulomb_friction) or np.any(rotor_inertia))

    def link_torque(self, robot: RobotModel, q: FloatArray, v: FloatArray, tau: FloatArray) -> FloatArray:
        """Torque on the links, shape (n,) [N m], for the drive's torque tau; ``robot`` is the arm with all that it carries."""
        if self.is_ideal:
            return tau
        a, friction = self._motion(robot, q, v, tau)
        return np.asarray(tau - self._rotor * a - self._viscous * (v + self._step * a) - friction)

    def acceleration(self, robot: RobotModel, q: FloatArray, v: FloatArray, tau: FloatArray) -> FloatArray:
        """Acceleration a over the step, shape (n,) [rad/s^2]: of light links on heavy rotors too."""
        return robot.forward_dynamics(q, v, tau) if self.is_ideal else self._motion(robot, q, v, tau)[0]

    def _motion(self, robot: RobotModel, q: FloatArray, v: FloatArray, tau: FloatArray) -> tuple[FloatArray, FloatArray]:
        """a and f, shape (n,) each."""
        zero = np.zeros(robot.n)
        gravity = robot.gravity_torque(q)
        mass = np.column_stack([robot.rnea(q, zero, unit) - gravity for unit in np.eye(robot.n)])
        response = np.linalg.inv(mass + np.diag(self._rotor + self._step * self._viscous))
        free = response @ (tau - robot.rnea(q, v, zero) - self._viscous * v)
        friction = self._dry_friction(v + self._step * free, np.asarray(self._step * response, dtype=float), v)
        return free - response @ friction, friction

    def _dry_friction(self, v_free: FloatArray, response: FloatArray, v: FloatArray) -> FloatArray:
        """f, shape (n,): ``v+ = v_free - response f`` agrees with f in every joint."""
        limit = self._coulomb
        sliding = v != 0.0
        f = limit * np.sign(v)
        for _ in range(4 * len(v)):
            stuck = np.flatnonzero(~sliding)
            if stuck.size:
                others = response[np.ix_(stuck, np.flatnonzero(sliding))] @ f[sliding]
                f[stuck] = np.linalg.solve(response[np.ix_(stuck, stuck)], v_free[stuck] - others)
            torn = ~sliding & (np.abs(f) > limit)
            caught = sliding & ((v_free - response @ f) * f < 0.0)
            if not np.any(torn | caught):
                return f
            f[torn] = np.clip(f[torn], -limit[torn], limit[torn])
            sliding = (sliding | torn) & ~caught
        return np.clip(f, -limit, limit)
