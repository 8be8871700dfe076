"""StatedErrors: how well one bag tells a joint's parameters and the load, from the motion and the noise alone.

The covariance of one least squares over all of a bag's rows, ``(Y' W Y + P)^-1``: Y the derivatives of the efforts by the
parameters of the joints' table and by the ten of what is carried, W the noise of the efforts, P a prior for what a
motion does not tell (the zero of a vertical first joint). What is drawn with it has a fleet's errors without the arithmetic of
its bags.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.effects.payload import COMPACT_STD
from sysid_ros.robot.inertial_parameters import move
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.trajectory import ExcitingTrajectory

LINEAR = (
    "coulomb_friction", "viscous_friction", "torque_offset", "torque_gain", "joint_offset", "rotor_inertia", "torque_delay",
)  # fmt: skip
"""Parameters of a joint that move its efforts, in the order of the columns; the noise stands apart."""
_PRIOR = {"torque_gain": 0.2, "joint_offset": 0.1, "torque_delay": 0.05}
"""Standard deviations of a prior [1], [rad], [s]; of the others, as parts of the effort limit in their units:"""
_PRIOR_EFFORT = 0.2
_EVERY = 0.04
"""Time between rows that are summed; the others are alike [s]."""


@dataclass(frozen=True, eq=False, slots=True)
class StatedErrors:
    """Of one motion of one robot.

    Attributes:
        covariance: of what is estimated, shape (m, m), m = 7 n + 10: the parameters of :data:`LINEAR` of the first joint, of the
            next, and so on; the ten of the load at last. factor: its Cholesky factor of the part that noise makes.
        shown: how much of a deviation from what was expected an estimate shows, shape (m, m): 1 without a prior.
        noise: standard deviation of the estimated noise, relative.
        torque, reach, by_zero, by_mass: root mean squares over the motion of each joint's torque [N m], of the way of the tip per
            way of the joint [m/rad], of the torque per error of its zero, on the joint where that is most [N m/rad], and of its
            torque per mass at the tip [N m/kg], shape (n,) each.
    """

    covariance: FloatArray
    factor: FloatArray
    shown: FloatArray
    noise: float
    torque: FloatArray
    reach: FloatArray
    by_zero: FloatArray
    by_mass: FloatArray

    def joint(self, j: int) -> FloatArray:
        """The block of a joint, shape (7, 7)."""
        k = len(LINEAR)
        return self.covariance[j * k : (j + 1) * k, j * k : (j + 1) * k]

    @property
    def load(self) -> FloatArray:
        """The block of mass and first moment, shape (4, 4)."""
        return self.covariance[-10:-6, -10:-6]

    def drawn(self, deviation: FloatArray, rng: np.random.Generator) -> FloatArray:
        """An estimate of a deviation (m,) from what was expected."""
        return np.asarray(self.shown @ deviation + self.factor @ rng.standard_normal(deviation.size))


def stated_errors(
    model: RobotModel, motion: ExcitingTrajectory, rate: float, noise: FloatArray, load: FloatArray
) -> StatedErrors:
    """What a bag of this motion tells.

    Args:
        model: with nothing in its hand. rate: of the rows [Hz]. noise: standard deviation of the efforts, white, (n,) [N m].
        load: inertial parameters (10,) of what is carried, in the frame of the tip.
    """
    n, k = model.n, len(LINEAR)
    t = np.arange(0.0, motion.duration, _EVERY)
    q, v, a = motion.sample(t)
    loaded = with_carried(model, load)
    tau = loaded.rnea_along(q, v, a)
    by_q = loaded.rnea_derivatives_along(q, v, a)[0]
    Y = np.zeros((len(t), n, n * k + 10))
    rows = np.arange(n)
    own = (smoothed_sign(v), v, np.ones_like(v), tau, None, a, -np.gradient(tau, _EVERY, axis=0))
    for i, column in enumerate(own):
        if column is None:
            Y[:, :, i : n * k : k] = -by_q
        else:
            Y[:, rows, rows * k + i] = column
    frame = model.frame_id(model.default_frame)
    Y[:, :, n * k :] = np.array([model.payload_regressor(*state, frame) for state in zip(q, v, a, strict=True)])
    limit = model.effort_limit
    prior = np.array([[_PRIOR.get(p, _PRIOR_EFFORT * limit[j]) for p in LINEAR] for j in range(n)]).reshape(-1)
    prior = np.concatenate((prior, COMPACT_STD))
    weighted = Y / noise[:, None]
    rows_of = weighted.reshape(-1, Y.shape[2]) * prior
    told = rows_of.T @ rows_of * (rate * _EVERY)
    posterior = np.linalg.inv(told + np.eye(len(prior)))
    covariance = prior[:, None] * posterior * prior
    shown = prior[:, None] * (posterior @ told) / prior
    spread = posterior @ told @ posterior
    values, vectors = np.linalg.eigh(0.5 * (spread + spread.T))
    factor = prior[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    jacobian = model.frame_jacobian_along(q, frame)
    return StatedErrors(
        covariance,
        factor,
        shown,
        1.0 / np.sqrt(2.0 * rate * motion.duration),
        torque=np.sqrt(np.mean(tau**2, axis=0)),
        reach=np.sqrt(np.mean(np.sum(jacobian**2, axis=1), axis=0)),
        by_zero=np.sqrt(np.mean(by_q**2, axis=0)).max(axis=0),
        by_mass=np.sqrt(np.mean(Y[:, :, n * k] ** 2, axis=0)),
    )


def with_carried(model: RobotModel, theta: FloatArray) -> RobotModel:
    """The robot with a body of inertial parameters ``theta`` (10,), given in the frame of its tip, fixed to it."""
    frame = model.model.frames[model.frame_id(model.default_frame)]
    change = np.zeros((model.n, 10))
    change[int(frame.parentJoint) - 1] = move(theta, np.array(frame.placement.rotation), np.array(frame.placement.translation))
    return model.with_links(change.reshape(-1))
