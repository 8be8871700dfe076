"""TorqueModel: the sum of effects that explains the measured torque, split into what is known and what is free."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sysid_ros.effects import Effect, JointEffect, LinkInertia
from sysid_ros.exceptions import SysidError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.known_error import KnownError


class TorqueModel:
    """``tau_measured = sum_known Y_k theta_k + sum_free Y_f theta_f + noise``.

    Args:
        robot: the model whose joint order the rows have.
        free: effects whose parameters are to be found; their columns stand side by side in this order.
        known: effects whose parameters are given. Without a ``link_inertia`` among them or among the free ones, and unless
            ``links`` is False, the URDF's links and its ``<dynamics>`` (damping, friction) are known.
        links: False where the measured torque is already free of the robot's own torque.

        uncertainty: of the known effects, see :class:`sysid_ros.torque.known_error.KnownError`.

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
    ) -> None:
        self.robot = robot
        self.free = tuple(free)
        self.known = tuple(known)
        for k in self.known:
            if k.theta.shape != (k.effect.p,):
                raise SysidError(f"effect '{k.effect.id}' has {k.effect.p} parameters, {k.theta.size} were given.")
        ends = list(accumulate((e.p for e in self.free), initial=0))
        self.slices = tuple(slice(a, b) for a, b in pairwise(ends))
        self.p = ends[-1]
        self.parameter_names = tuple(name for e in self.free for name in e.parameter_names)
        self.units = tuple(unit for e in self.free for unit in e.units)
        self._write_joint_effects_together()
        inertia_known = [k for k in self.known if isinstance(k.effect, LinkInertia)]
        inertia_free = any(isinstance(e, LinkInertia) for e in self.free)
        if inertia_known and inertia_free:
            raise SysidError("effect 'link_inertia' is both known and free; it can be one of them.")
        self._urdf_links = links and not inertia_free
        self._dynamics = self._urdf_links and not inertia_known and bool(np.any(robot.damping) or np.any(robot.friction))
        self._link_correction = self._correction(inertia_known) if self._urdf_links else None
        self.error = KnownError(robot, self.known, uncertainty if self._urdf_links else None)
        self._others = tuple(k for k in self.known if not isinstance(k.effect, LinkInertia))

    def _write_joint_effects_together(self) -> None:
        """Find the effects with one column a joint: at the robot's rate an assignment for each would cost more than its curve."""
        n = self.robot.n
        self._joint_effects: list[JointEffect] = []
        self._blocks: list[tuple[Effect, slice]] = []
        starts = []
        for effect, where in zip(self.free, self.slices, strict=True):
            if isinstance(effect, JointEffect) and len(effect.joints) == n:
                self._joint_effects.append(effect)
                starts.append(where.start)
            else:
                self._blocks.append((effect, where))
        self._starts = np.array(starts, dtype=np.intp)
        self._curves = np.zeros((len(starts), n))

    @staticmethod
    def _correction(inertia_known: list[KnownEffect]) -> FloatArray | None:
        if not inertia_known:
            return None
        correction = np.zeros_like(inertia_known[0].effect.robot.pi).reshape(-1, 10)
        for k in inertia_known:
            assert isinstance(k.effect, LinkInertia)
            correction[k.effect.joints] += (k.theta - k.effect.nominal).reshape(-1, 10)
        return correction.ravel() if np.any(correction) else None

    def known_theta(self, effect: str) -> FloatArray:
        """Known parameters of an effect with one parameter a joint, shape (n,); 0 where it is not known."""
        theta = np.zeros(self.robot.n)
        for k in self.known:
            if k.effect.id == effect:
                theta[k.effect.joints] += k.theta
        return theta

    def known_torque(self, sample: Sample) -> FloatArray:
        """Torque of what is known, shape (n,) [N m]."""
        return self._known_torque(sample, None)

    def _known_torque(self, sample: Sample, considered: FloatArray | None) -> FloatArray:
        robot = self.robot
        tau = robot.rnea(sample.q, sample.v, sample.a)
        if not self._urdf_links:
            tau[:] = 0.0
        elif self._link_correction is not None or self.error.c > 0:
            regressor = robot.regressor(sample.q, sample.v, sample.a)
            if self._link_correction is not None:
                tau += regressor @ self._link_correction
            if considered is not None:
                self.error.fill(sample, regressor, considered)
            robot.rnea(sample.q, sample.v, sample.a)
        if self._dynamics:
            tau += robot.damping * sample.v + robot.friction * np.tanh(sample.v / 0.02)
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
        """As :meth:`split`, into arrays of the caller's that were zero at first: for the loop that runs at the robot's rate.

        Args:
            considered: takes what the uncertainty of the known effects does, shape (n, ``error.c``).
        """
        np.subtract(sample.tau, self._known_torque(sample, considered), out=rest)
        for effect, where in self._blocks:
            effect.fill(sample, columns[:, where])
        if self._joint_effects:
            for k, effect in enumerate(self._joint_effects):
                self._curves[k] = effect.curve(sample)
            _write_diagonals(self._curves, self._starts, columns)


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _write_diagonals(curves: FloatArray, starts: NDArray[np.intp], columns: FloatArray) -> None:
    """Each row of ``curves``, shape (k, n), as the diagonal of an n x n block of ``columns`` that begins at its start."""
    for k in range(starts.size):
        for j in range(curves.shape[1]):
            columns[j, starts[k] + j] = curves[k, j]
