"""Trial: the channels of recordings with some faults undone, and how likely the URDF, other robots and no robot make them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sysid_ros.diagnosis.channel_faults import EffortFactors, Fault
from sysid_ros.diagnosis.whose.coarse_rows import CoarseRows
from sysid_ros.diagnosis.whose.robot_kernels import Carried, Prior, RobotKernels
from sysid_ros.diagnosis.whose.robot_likelihood import LEAVES, LEAVES_ALL, JointTorques, rough_likelihoods, row_likelihoods
from sysid_ros.effects import Channels
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_GRAVITY = {0.0: 0.978, -1.0: 0.02, 1.0: 0.002}
"""Probability that the efforts hold gravity as it is, not at all, or twice."""
_SIZES = (0.0, -0.5, 1.0)
"""By how much more of another size's torques is gravity's, which goes with the length; what moves a link goes with its square."""
_OTHER = 0.005
"""Probability that a URDF that somebody gives is that of a robot of the same kind, that of any other, or that the efforts are no
torques of a robot: each."""
_EXACT, _WRONG_LINK = 0.5, 0.1
"""Probability that a URDF's links are exact, and that one of them is far off and the others are exact."""
_NO_FAULT, _LOG_OTHER = float(np.log(1.0 - 3.0 * _OTHER)), float(np.log(_OTHER))
Likelihood = Callable[[Sequence[JointTorques]], FloatArray]
"""Of each row under each form of a hypothesis, shape (g, N)."""
_LEAST = 1e-3
"""Least size of an effort that is compared, of the largest."""


@dataclass(frozen=True, eq=False)
class Trial:
    """Channels with some faults undone.

    Attributes:
        rows: as they are then. usual: usual effort of each joint in their unit, shape (n,). scale: log of what the faults publish
            of 1 N m, over all joints. silent: joints without a signal, shape (n,).
        faults_prior: log-probability of the faults before any data. fault: the last of them. of_another_size: whether a robot of
            the URDF's kind has another size, which its torques were divided by.
    """

    rows: CoarseRows
    kernels: RobotKernels
    usual: FloatArray
    silent: NDArray[np.bool_]
    scale: float = 0.0
    faults_prior: float = 0.0
    fault: Fault | None = None
    factors: EffortFactors | None = None
    of_another_size: bool = False

    @classmethod
    def of(cls, robot: RobotModel, rows: CoarseRows) -> Trial:
        """The channels as they are."""
        size = np.sqrt(np.mean(rows.tau**2, axis=0))
        usual = np.maximum(size, _LEAST * float(size.max()) + 1e-12)  # less, and what is shared would be lost in rounding
        return cls(rows, RobotKernels(robot, rows), usual, np.zeros(robot.n, dtype=bool))

    def every(self, step: int) -> Trial:
        """On each of so many rows."""
        rows = self.rows.every(step)
        return replace(self, rows=rows, kernels=RobotKernels(self.kernels.robot, rows))

    def without(self, fault: Fault, log_prior: float, factors: EffortFactors | None = None) -> Trial:
        """With one fault more undone; ``factors``: what was found of the efforts where it is one of their own factors."""
        robot, rows = self.kernels.robot, self.rows.without(fault.effect)
        kernels = self.kernels if np.array_equal(rows.q, self.rows.q) else RobotKernels(robot, rows)
        factor = np.abs(fault.effect.publish(np.ones((1, robot.n))))
        usual = np.abs(fault.effect.undo(Channels(*[self.usual[None]] * 3)).tau[0])  # the same torque in another unit
        scale, prior = self.scale + float(np.log(factor).sum()), self.faults_prior + log_prior
        silent = self.silent if factors is None else ~factors.seen
        return Trial(rows, kernels, usual, silent, scale, prior, fault, factors or self.factors)

    def carrying(self, carried: Carried) -> Trial:
        """The same with something else beside the links."""
        return replace(self, kernels=self.kernels.carrying(carried, self.rows))

    def exact(self, wrong: int | None = None) -> Trial:
        """The same with the URDF's links exact, but for one that is far off if it is given."""
        part = _EXACT if wrong is None else _WRONG_LINK / self.kernels.robot.n
        return replace(self, kernels=self.kernels.exact(wrong), faults_prior=self.faults_prior + float(np.log(part)))

    def roughly(self) -> float:
        """Its log-likelihood with noise and discrepancy as one of a few sizes, for a first comparison."""
        return float(self.likelihood(rough_likelihoods).sum(axis=1).max())

    def likelihood(self, by: Likelihood = row_likelihoods) -> FloatArray:
        """Of the published rows with the URDF and gravity as it is, not at all and twice, their priors in it, shape (3, N)."""
        tau, k = self.rows.tau, self.kernels
        forms = [np.stack([tau[:, j] - k.mean[:, j] - c * k.gravity[:, j] for c in _GRAVITY], axis=1) for j in range(k.robot.n)]
        rows = self._likelihood([k.urdf(j, self._largest) for j in range(k.robot.n)], forms, LEAVES, by)
        return self._with_prior(rows, _NO_FAULT + np.log(list(_GRAVITY.values())) + k.heaviness(self._largest))

    def of_other_robots(self) -> FloatArray:
        """The same with a robot of the URDF's kind, and with any bodies on the same joints, shape (2, N), of another
        size (4, N)."""
        k, n, tau = self.kernels, range(self.kernels.robot.n), self.rows.tau
        sizes = _SIZES if self.of_another_size else _SIZES[:1]
        forms = [np.stack([tau[:, j] - k.mean[:, j] - c * k.gravity[:, j] for c in sizes], axis=1) for j in n]
        alike = [k.alike(j, self._largest) for j in n], forms
        free = [k.free(j, self._largest) for j in n], [self.rows.tau[:, [j]] for j in n]
        rows = np.concatenate([self._likelihood(*of, LEAVES) for of in (alike, free)])
        prior = np.append(np.full(len(sizes), -np.log(len(sizes))), 0.0)
        return self._with_prior(rows, _LOG_OTHER + k.heaviness(self._largest) + prior)

    def of_no_robot(self) -> FloatArray:
        """The same with no robot, which carries nothing either, shape (1, N)."""
        k, n = self.kernels, range(self.kernels.robot.n)
        nothing = 0.0 * k.free(0, 0.0)[0], 0.0 * k.pattern
        rows = self._likelihood([nothing for _ in n], [self.rows.tau[:, [j]] for j in n], LEAVES_ALL)
        return self._with_prior(rows, _LOG_OTHER)

    def _with_prior(self, rows: FloatArray, log_prior: FloatArray | float) -> FloatArray:
        """With log-prior odds of each form and of the faults, in equal parts on all rows."""
        return np.asarray(rows + np.reshape(log_prior + self.faults_prior, (-1, 1)) / rows.shape[1])

    @property
    def _largest(self) -> float:
        """Largest usual torque of any joint that has a signal [N m]."""
        return float(self.usual[~self.silent].max(initial=0.0))

    def _likelihood(
        self, priors: list[Prior], residuals: list[FloatArray], leaves: float, by: Likelihood = row_likelihoods
    ) -> FloatArray:
        k, joints = self.kernels, []
        for j, (prior, residual) in enumerate(zip(priors, residuals, strict=True)):
            if self.silent[j]:
                residual = np.repeat(self.rows.tau[:, [j]], residual.shape[1], axis=1)
                prior = 0.0 * prior[0], 0.0 * prior[1]
            usual = float(self.usual[j])
            takes = k.dissipated(j, usual, by_load=bool(np.any(prior[1])))
            joints.append(JointTorques(residual, prior, k.own(j), k.pattern, usual, takes, leaves))
        return by(joints) - self.scale
