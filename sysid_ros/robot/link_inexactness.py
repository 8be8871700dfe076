"""What the links' masses and centres of mass may differ by from the URDF's, where no model was identified."""

from __future__ import annotations

import numpy as np

from sysid_ros.robot.inertial_parameters import TENSOR, by_centre, to_com
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray

_POSTURES = 300
_SPEED, _ACCELERATION = 1.0, 3.0
"""Of the random motions on which directions are compared [rad/s], [rad/s^2]."""
_LEFT_OUT = 1e-6
"""Part of the variance of the torque that the directions left out make together: some mN m."""
_LEFT_OUT_FLOATING = 5e-3
"""The same of force and moment on a trunk, to which many small links of the legs add."""
_NEAR = 0.25
"""Of the range of a leg's joint, the part on either side of its middle in which robots stand and walk."""
_STANDARD_GRAVITY = 9.80665


def link_inexactness(robot: RobotModel, mass: float, com: float, floats: bool = False) -> FloatArray:
    """Directions L, shape (10 n, c), of what a URDF of usual inexactness is wrong by: ``error of pi = L z``, ``z ~ N(0, 1)``.

    The mass of each link, and with it all its ten parameters, is wrong by ``mass``; its centre of mass by ``com`` on each axis.
    Of the directions that this makes, which no motion can tell apart in part (base parameters: Mayeda, Yoshida, Osuka 1990),
    those are kept, rotated to principal ones, that make nearly all of the variance of the torque on random motions;
    each joint's torque counts relative to what it usually is. Of a floating base it is force and moment that hold the trunk.

    Args:
        robot: the arm, or the robot on its floating base, whose URDF gives the links.
        mass: standard deviation of a link's mass over its mass. com: of its centre of mass on an axis [m].
        floats: the first six joints are those of a floating base.
    """
    directions = _directions(robot.pi.reshape(-1, 10), mass, com)
    return directions @ principal_directions(robot, directions, floats)


def principal_directions(
    robot: RobotModel, directions: FloatArray, floats: bool = False, left_out: float | None = None
) -> FloatArray:
    """How directions of the error of the links, (10 n, k), are rotated, and some left out: shape (k, c), see
    :func:`link_inexactness`. Args: left_out: part of the variance that those may make which are left out."""
    q, v, a = _motion(robot, floats)
    rows = slice(0, FREE) if floats else slice(None)
    torque = np.einsum("tjk,kc->tjc", robot.regressor_along(q, v, a)[:, rows], directions)
    usual = np.sqrt(np.mean(robot.rnea_along(q, v, a)[:, rows] ** 2, axis=0))
    if floats:
        usual[:3], usual[3:] = np.linalg.norm(usual[:3]), np.linalg.norm(usual[3:])
    torque /= np.maximum(usual, 1e-3 * max(float(usual.max()), 1e-9))[:, None]
    _, size, turned = np.linalg.svd(torque.reshape(-1, directions.shape[1]), full_matrices=False)
    part = np.cumsum(size[::-1] ** 2)[::-1] / max(float(np.sum(size**2)), 1e-300)
    least = (_LEFT_OUT_FLOATING if floats else _LEFT_OUT) if left_out is None else left_out
    return np.asarray(np.ascontiguousarray(turned[part > least].T))


def _motion(robot: RobotModel, floats: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Random positions, velocities and accelerations, shape (N, n) each; of a floating base the trunk stays near level, and what
    stands for the acceleration of its first joints is the specific force."""
    rng = np.random.default_rng(0)
    lower, upper = np.maximum(robot.position_lower, -np.pi), np.minimum(robot.position_upper, np.pi)
    if floats:
        middle, reach = 0.5 * (lower + upper), _NEAR * (upper - lower)
        lower, upper = middle - reach, middle + reach
        lower[:FREE] = upper[:FREE] = 0.0
    shape = (_POSTURES, robot.n)
    q, v, a = rng.uniform(lower, upper, shape), _SPEED * rng.normal(size=shape), _ACCELERATION * rng.normal(size=shape)
    if floats:
        v[:, :3] = 0.0
        a[:, 2] += _STANDARD_GRAVITY
    return q, v, a


def _directions(pi: FloatArray, mass: float, com: float) -> FloatArray:
    """What each of the errors changes of the stacked link inertials ``pi`` (n, 10), shape (10 n, 4 n)."""
    out = np.zeros((pi.size, 4 * len(pi)))
    for j, link in enumerate(pi):
        rows = out[10 * j : 10 * j + 10]
        rows[:, 4 * j] = mass * link
        rows[:, 4 * j + 1 : 4 * j + 4] = com * by_centre(link)
    return out


def by_moments(body: FloatArray) -> FloatArray:
    """Change of a body's ten parameters (10,) by each of its principal moments of inertia about its centre of mass, each by its
    whole, shape (10, 3)."""
    out = np.zeros((10, 3))
    if body[0] <= 0.0:
        return out
    inertia = to_com(body)[2]
    moments, axes = np.linalg.eigh(inertia)
    for k, moment in enumerate(moments):
        change = moment * np.outer(axes[:, k], axes[:, k])
        out[4:, k] = [change[i, j] for i, j in TENSOR]
    return out
