"""TorqueModel: the sum of effects that explains the measured torque, split into what is known and what is free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np

from sysid_ros.effects import Acts, Curve, Depends, Effect, Motion
from sysid_ros.exceptions import SysidError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import TURNS, smoothed_sign
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.torque.compiled_rows import CompiledRows
from sysid_ros.torque.known_effect import KnownEffect, KnownError


@dataclass(frozen=True, slots=True, eq=False)
class TorquesAlong:
    """Torques along a motion, shape (N, n) each [N m].

    Attributes:
        link: on the link side of the gears, also where the measured torque is free of it. drive: on the motor side, referred to
            the joints. total: as it is measured. jumps: the part of it that jumps where a velocity changes its sign.
    """

    link: FloatArray
    drive: FloatArray
    total: FloatArray
    jumps: FloatArray


class TorqueModel:
    """``tau_measured = sum_known Y_k theta_k + sum_free Y_f theta_f + noise``.

    Args:
        robot: the model whose joint order the rows have.
        free: effects whose parameters are to be found; their columns stand side by side in this order.
        known: effects whose parameters are given. Without the links' inertials among them or among the free ones, and unless
            ``links`` is False, the URDF's links and its ``<dynamics>`` (damping, friction, armature) are known.
        links: False where the measured torque is already free of the robot's own torque.
        uncertainty: of the known effects, see :class:`sysid_ros.torque.known_effect.KnownError`.
        inexact: of the URDF's links where they are known, directions of the error of their inertials, shape (10 n, c).
        gain: standard deviation of each joint's effort over the torque, as a part of it.
        turns: speed at which the dry friction of the URDF's ``<dynamics>`` has turned, which no URDF says, shape () or (n,)
            [rad/s].

    Attributes:
        p, parameter_names, units: of the free effects. slices: where each of them stands.
        error: what the uncertainty of the known effects does to the torque.

    Raises:
        SysidError: an effect is both known and free, or parameters have the wrong length.
    """

    def __init__(
        self,
        robot: RobotModel,
        free: Sequence[Effect],
        known: Sequence[KnownEffect] = (),
        links: bool = True,
        uncertainty: FloatArray | None = None,
        turns: float | FloatArray = TURNS,
        inexact: FloatArray | None = None,
        gain: float = 0.0,
    ) -> None:
        self.robot = robot
        self.free = tuple(free)
        self.known = tuple(known)
        for k in self.known:
            if k.theta.shape != (k.effect.p,):
                raise SysidError(f"effect '{k.effect.id}' has {k.effect.p} parameters, {k.theta.size} were given.")
        ends = list(accumulate((e.p for e in self.free), initial=0))
        self.slices = tuple(slice(a, b) for a, b in pairwise(ends))
        self._filled, self._left_out = list(zip(self.free, self.slices, strict=True)), set[int]()
        self.p = ends[-1]
        self.parameter_names = tuple(name for e in self.free for name in e.parameter_names)
        self.units = tuple(unit for e in self.free for unit in e.units)
        replaced = [k for k in self.known if k.effect.replaces_links]
        links_free = [e.id for e in self.free if e.replaces_links]
        if replaced and links_free:
            raise SysidError(f"effect '{links_free[0]}' is both known and free; it can be one of them.")
        self._urdf_links = links and not links_free
        self._dynamics = self._urdf_links and not replaced
        stated = np.array(robot.model.armature)
        # pinocchio counts it always; with links of the model's own the rotors are the model's too
        self._other_rotors = stated if self._urdf_links and replaced and np.any(stated) else None
        self._rubs, self._turns = bool(np.any(robot.damping) or np.any(robot.friction)), turns
        correction = sum((k.effect.as_links(k.theta).ravel() for k in replaced), np.zeros(10 * robot.n))
        self._correction = correction if self._urdf_links and np.any(correction) else None
        own = uncertainty if self._urdf_links else None, inexact if self._dynamics else None
        self.error = KnownError(robot, self.known, *own, gain)
        self._others = tuple(k for k in self.known if not k.effect.replaces_links)

    # What a robot's description could hold of all that is known: the URDF's own, where it is known, and the effects' sums.

    def links(self) -> FloatArray:
        """Link inertials, shape (10 n,)."""
        return self.robot.pi if self._correction is None else self.robot.pi + self._correction

    def armature(self) -> FloatArray:
        """Inertia that turns with each joint alone, shape (n,) [kg m^2]."""
        own = np.array(self.robot.model.armature) if self._dynamics else np.zeros(self.robot.n)
        return np.asarray(sum((k.effect.as_armature(k.theta) for k in self.known), own))

    def damping(self) -> FloatArray:
        """Viscous friction of each joint, shape (n,) [N m s/rad]."""
        own = self.robot.damping if self._dynamics else np.zeros(self.robot.n)
        return np.asarray(sum((k.effect.as_damping(k.theta) for k in self.known), own))

    def dry_friction(self) -> FloatArray:
        """Level of the dry friction of each joint, shape (n,) [N m]."""
        own = self.robot.friction if self._dynamics else np.zeros(self.robot.n)
        return np.asarray(sum((k.effect.as_dry_friction(k.theta) for k in self.known), own))

    def mass_along(self, q: FloatArray) -> FloatArray:
        """Mass matrix of the known links without rotors at postures q (N, n), shape (N, n, n) [kg m^2]."""
        robot, nothing = self.robot, np.zeros_like(q)
        mass = robot.rnea_derivatives_along(q, nothing, nothing)[2] - np.diag(np.array(robot.model.armature))
        if self._correction is not None:
            still = robot.link_torque_along(q, nothing, nothing, self._correction)
            for j, unit in enumerate(np.eye(robot.n)):
                mass[:, :, j] += robot.link_torque_along(q, nothing, nothing + unit, self._correction) - still
        return mass

    def torque_along(self, motion: Motion) -> FloatArray:
        """Torque of what is known along a whole motion, shape (N, n) [N m]."""
        return self.torques_along(motion).total

    def torques_along(self, motion: Motion) -> TorquesAlong:
        """The same with its parts.

        Effects are worked out in the order in which torque goes from the links to the message: those of the links, of the
        drives, of the measurement, and what makes it late at last. Each sees what has been added up before it.
        """
        robot, nothing = self.robot, np.zeros_like(motion.q)
        link = motion.rigid_torque if self._urdf_links else motion.link_torque
        if self._correction is not None:
            link = link + robot.link_torque_along(motion.q, motion.v, motion.a, self._correction)
        if self._other_rotors is not None:
            link = link - self._other_rotors * motion.a
        damping = robot.damping * motion.v if self._dynamics else nothing
        jumps = robot.friction * smoothed_sign(motion.v, self._turns) if self._dynamics else nothing
        drive, own = link + damping + jumps, link + nothing if self._urdf_links else nothing
        total, added = own + damping + jumps, nothing
        for k in sorted(self._others, key=_from_link_to_message):
            late, acts = _comes_late(k), k.effect.acts
            known = motion.with_torques(link, total if late else drive, sensor_torque=nothing if late else added)
            torque = k.effect.torque_along(known, k.theta)
            total = total + torque
            jumps = jumps + torque if k.effect.jumps else jumps
            link = link + torque if acts is Acts.LINK else link
            drive, added = (drive, added + torque) if acts is Acts.MEASUREMENT else (drive + torque, added)
        return TorquesAlong(link, drive, total, jumps)

    def known_torque(self, sample: Sample) -> FloatArray:
        """Torque of what is known, shape (n,) [N m]."""
        return self._known_torque(sample, None)

    def _known_torque(self, sample: Sample, considered: FloatArray | None) -> FloatArray:
        robot = self.robot
        if self._urdf_links and (self._correction is not None or (considered is not None and self.error.c > 0)):
            regressor = robot.regressor(sample.q, sample.v, sample.a)
            tau = robot.rnea(sample.q, sample.v, sample.a)  # last: the effects' columns read what it leaves
            if self._correction is not None:
                tau += regressor @ self._correction
            if considered is not None:
                np.matmul(regressor, self.error.links, out=considered)
                for effect, rows in self.error.others:
                    effect.add_spread(sample, rows, considered)
        else:
            tau = robot.rnea(sample.q, sample.v, sample.a)
            if not self._urdf_links:
                tau[:] = 0.0
        if self._other_rotors is not None:
            tau -= self._other_rotors * sample.a
        if self._dynamics and self._rubs:
            tau += robot.damping * sample.v + robot.friction * smoothed_sign(sample.v, self._turns)
        for k in self._others:
            tau += k.effect.torque(sample, k.theta)
        return tau

    def split(self, sample: Sample) -> tuple[FloatArray, FloatArray]:
        """Y of the free effects, shape (n, p), and the torque left for them, shape (n,) [N m]."""
        columns = np.zeros((self.robot.n, self.p))
        rest = np.empty(self.robot.n)
        self.split_into(sample, columns, rest)
        return columns, rest

    def split_into(self, sample: Sample, columns: FloatArray, rest: FloatArray, considered: FloatArray | None = None) -> None:
        """As :meth:`split`, into arrays of the caller's that were zero at first.

        Args:
            considered: takes what the uncertainty of the known effects does, shape (n, ``error.c``).
        """
        np.subtract(sample.tau, self._known_torque(sample, considered), out=rest)
        for effect, where in self._filled:
            effect.fill(sample, columns[:, where])

    def compiled(self) -> CompiledRows:
        """The same as :meth:`split_into`, in compiled code, for the loop that runs at the robot's rate."""
        robot, n = self.robot, self.robot.n
        links = self.links() if self._urdf_links else np.zeros(10 * n)
        joints, nothing = np.arange(n), np.zeros(n)
        own: list[tuple[Curve, float | FloatArray, FloatArray]] = []
        if self._dynamics:
            own.append((Curve.ACCELERATION, 1.0, np.array(robot.model.armature)))
            own += [(Curve.SPEED, 1.0, robot.damping), (Curve.SIGN, self._turns, robot.friction)]
        curves = [
            np.column_stack([nothing + kind, nothing + width, joints, theta]) for kind, width, theta in own if np.any(theta)
        ]
        spread, others = [np.zeros((n, self.error.c)) for _ in curves], []
        rows = {id(effect): L for effect, L in self.error.others}
        for k in self._others:
            simple, linear = k.effect.simple_curves(), k.effect.link_columns()
            if simple is not None:
                curves.append(np.column_stack([simple, k.theta]))
                spread.append(rows.pop(id(k.effect), np.zeros((k.effect.p, self.error.c))))
            elif linear is not None:
                links = links + linear @ k.theta
            else:
                others.append(k)
        return CompiledRows(
            robot,
            self.free,
            self.slices,
            links,
            np.vstack([np.zeros((0, 4)), *curves]),
            np.vstack([np.zeros((0, self.error.c)), *spread]),
            others,
            self.error.links,
            [(effect, L) for effect, L in self.error.others if id(effect) in rows],
            self._left_out,
        )

    def settle_links(self, error: FloatArray, directions: FloatArray, gains: FloatArray) -> None:
        """The inertials of the URDF's links have turned out to be wrong by ``error + directions z``, z ~ N(0, 1), shapes (10 n,)
        and (10 n, c), while the efforts are off by ``gains z``, shape (n, c)."""
        self._correction = error if self._correction is None else self._correction + error
        self.error.links, self.error.c, self.error.gains = directions, directions.shape[1], gains

    def leave_out(self, *effects: Effect) -> None:
        """The columns of these free effects, and of no others, are not needed: :meth:`split_into` leaves them alone."""
        self._filled = [(e, where) for e, where in zip(self.free, self.slices, strict=True) if e not in effects]
        self._left_out.clear()
        self._left_out.update(id(e) for e in effects)


def _from_link_to_message(k: KnownEffect) -> tuple[bool, int, bool, bool]:
    """Where in the order of :meth:`TorqueModel.torques_along` an effect comes."""
    sees = k.effect.depends_on
    return _comes_late(k), list(Acts).index(k.effect.acts), Depends.DRIVE in sees, Depends.SENSOR in sees


def _comes_late(k: KnownEffect) -> bool:
    return k.effect.as_delay(k.theta) != 0.0 or k.effect.low_passes
