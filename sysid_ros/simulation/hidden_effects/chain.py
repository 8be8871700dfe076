"""Rigid links as compiled loops: inverse dynamics, mass matrix and the torque of a force at the tip.

A simulated robot that sticks, slips and rattles needs steps well below a millisecond. One step through an interpreter costs some
tens of microseconds, one step here about ten, all that acts on the joints included. It is also a second derivation of the
dynamics: a test compares it with :class:`sysid_ros.robot.robot_model.RobotModel` on every arm.

Reference: Luh, Walker, Paul 1980, "On-line computational scheme for mechanical manipulators", in the frames of the joints.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}


class Chain(NamedTuple):
    """Joints and links of a fixed-base tree of n joints, parents before children.

    Attributes:
        parent: index of the joint before, -1 for the base, shape (n,).
        rotation, offset: pose of the joint's frame in its parent's at q = 0, shape (n, 3, 3) and (n, 3) [m].
        axis: of the joint in its own frame, shape (n, 3).
        slides: 1.0 for a prismatic joint, shape (n,).
        mass, moment, inertia: of the link that the joint moves, in the joint's frame and about its origin, shape (n,) [kg],
            (n, 3) [kg m], (n, 3, 3) [kg m^2].
        gravity: in the base, shape (3,) [m/s^2].
        tip: joint that moves the tip link. tip_offset: the tip link's origin in that joint's frame, shape (3,) [m].
    """

    parent: Any
    rotation: FloatArray
    offset: FloatArray
    axis: FloatArray
    slides: FloatArray
    mass: FloatArray
    moment: FloatArray
    inertia: FloatArray
    gravity: FloatArray
    tip: int
    tip_offset: FloatArray


def chain_of(robot: RobotModel, pi: FloatArray, gravity: FloatArray) -> Chain:
    """The robot's joints with link inertials ``pi`` of shape (n, 10), in the order of ``inertial_parameters``."""
    model, n = robot.model, robot.n
    placements = [model.jointPlacements[j] for j in range(1, n + 1)]
    subspaces = [np.asarray(model.joints[j].createData().S).reshape(-1) for j in range(1, n + 1)]
    slides = robot.is_prismatic.astype(float)
    axes = np.array([s[:3] if slide else s[3:] for s, slide in zip(subspaces, slides, strict=True)])
    frame = model.frames[robot.frame_id(robot.default_frame)]
    pi = np.asarray(pi, dtype=float).reshape(n, 10)
    xx, xy, yy, xz, yz, zz = pi[:, 4:].T
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    return Chain(
        np.array([model.parents[j] - 1 for j in range(1, n + 1)], dtype=np.int64),
        np.array([np.array(p.rotation) for p in placements]),
        np.array([np.array(p.translation) for p in placements]),
        np.ascontiguousarray(axes),
        slides,
        np.ascontiguousarray(pi[:, 0]),
        np.ascontiguousarray(pi[:, 1:4]),
        np.ascontiguousarray(inertia),
        np.asarray(gravity, dtype=float),
        int(frame.parentJoint) - 1,
        np.array(frame.placement.translation),
    )


@njit(inline="always", **_JIT)  # type: ignore[untyped-decorator]
def _cross(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    out[0], out[1], out[2] = x, y, z


@njit(inline="always", **_JIT)  # type: ignore[untyped-decorator]
def _turned(matrix: FloatArray, vector: FloatArray, out: FloatArray) -> None:
    for i in range(3):
        out[i] = matrix[i, 0] * vector[0] + matrix[i, 1] * vector[1] + matrix[i, 2] * vector[2]


@njit(inline="always", **_JIT)  # type: ignore[untyped-decorator]
def _turned_back(matrix: FloatArray, vector: FloatArray, out: FloatArray) -> None:
    for i in range(3):
        out[i] = matrix[0, i] * vector[0] + matrix[1, i] * vector[1] + matrix[2, i] * vector[2]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def place(chain: Chain, q: FloatArray, rotation: FloatArray, offset: FloatArray) -> None:
    """Pose of each joint's frame in its parent's at q: fills ``rotation`` (n, 3, 3) and ``offset`` (n, 3)."""
    turn = np.empty((3, 3))
    for i in range(q.size):
        axis, fixed = chain.axis[i], chain.rotation[i]
        if chain.slides[i] > 0.0:
            for r in range(3):
                for k in range(3):
                    rotation[i, r, k] = fixed[r, k]
                offset[i, r] = chain.offset[i, r] + q[i] * (fixed[r, 0] * axis[0] + fixed[r, 1] * axis[1] + fixed[r, 2] * axis[2])
            continue
        s, c = np.sin(q[i]), np.cos(q[i])
        for r in range(3):
            for k in range(3):
                turn[r, k] = (1.0 - c) * axis[r] * axis[k]
            turn[r, r] += c
        turn[0, 1] -= s * axis[2]
        turn[0, 2] += s * axis[1]
        turn[1, 0] += s * axis[2]
        turn[1, 2] -= s * axis[0]
        turn[2, 0] -= s * axis[1]
        turn[2, 1] += s * axis[0]
        for r in range(3):
            offset[i, r] = chain.offset[i, r]
            for k in range(3):
                rotation[i, r, k] = fixed[r, 0] * turn[0, k] + fixed[r, 1] * turn[1, k] + fixed[r, 2] * turn[2, k]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _outward(
    chain: Chain, rotation: FloatArray, offset: FloatArray, v: FloatArray, a: FloatArray, weight: float, work: FloatArray
) -> None:
    """Motion of each link from the base to the tips, and the force and moment that it needs."""
    n = v.size
    omega, alpha, linear, force, moment, scratch = work[0], work[1], work[2], work[3], work[4], work[5]
    one, two = scratch[0], scratch[1]
    for i in range(n):
        p = chain.parent[i]
        axis, mc = chain.axis[i], chain.moment[i]
        if p < 0:
            for r in range(3):
                omega[i, r], alpha[i, r], one[r] = 0.0, 0.0, -weight * chain.gravity[r]
        else:
            _cross(omega[p], offset[i], two)
            _cross(omega[p], two, two)
            _cross(alpha[p], offset[i], one)
            for r in range(3):
                one[r] += two[r] + linear[p, r]
            _turned_back(rotation[i], omega[p], omega[i])
            _turned_back(rotation[i], alpha[p], alpha[i])
        _turned_back(rotation[i], one, linear[i])
        _cross(omega[i], axis, one)
        for r in range(3):
            if chain.slides[i] > 0.0:
                linear[i, r] += axis[r] * a[i] + 2.0 * v[i] * one[r]
            else:
                alpha[i, r] += axis[r] * a[i] + v[i] * one[r]
                omega[i, r] += axis[r] * v[i]
        _cross(alpha[i], mc, one)
        _cross(omega[i], mc, two)
        _cross(omega[i], two, two)
        for r in range(3):
            force[i, r] = chain.mass[i] * linear[i, r] + one[r] + two[r]
        _turned(chain.inertia[i], omega[i], one)
        _cross(omega[i], one, one)
        _turned(chain.inertia[i], alpha[i], moment[i])
        _cross(mc, linear[i], two)
        for r in range(3):
            moment[i, r] += one[r] + two[r]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def inverse_dynamics(
    chain: Chain,
    rotation: FloatArray,
    offset: FloatArray,
    v: FloatArray,
    a: FloatArray,
    weight: float,
    out: FloatArray,
    work: FloatArray,
) -> None:
    """Joint torques (n,) [N m] for v and a at the placed posture, where :func:`place` put it.

    ``weight``: 1.0 with gravity, 0.0 without. ``work``: scratch, shape (6, n + 1, 3).
    """
    n = v.size
    _outward(chain, rotation, offset, v, a, weight, work)
    force, moment, one, two = work[3], work[4], work[5][0], work[5][1]
    for i in range(n - 1, -1, -1):
        carried = force[i] if chain.slides[i] > 0.0 else moment[i]
        out[i] = chain.axis[i, 0] * carried[0] + chain.axis[i, 1] * carried[1] + chain.axis[i, 2] * carried[2]
        p = chain.parent[i]
        if p >= 0:
            _turned(rotation[i], force[i], one)
            _cross(offset[i], one, two)
            for r in range(3):
                force[p, r] += one[r]
                moment[p, r] += two[r]
            _turned(rotation[i], moment[i], one)
            for r in range(3):
                moment[p, r] += one[r]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def mass_matrix(chain: Chain, rotation: FloatArray, offset: FloatArray, out: FloatArray, work: FloatArray) -> None:
    """M (n, n) [kg m^2] at the placed posture: one inverse dynamics a column."""
    n = out.shape[0]
    still, unit, column = np.zeros(n), np.zeros(n), np.zeros(n)
    for j in range(n):
        unit[j] = 1.0
        inverse_dynamics(chain, rotation, offset, still, unit, 0.0, column, work)
        for i in range(n):
            out[i, j] = column[i]
        unit[j] = 0.0


@njit(**_JIT)  # type: ignore[untyped-decorator]
def force_torque(chain: Chain, rotation: FloatArray, offset: FloatArray, force: FloatArray, out: FloatArray) -> None:
    """``J' f`` (n,) [N m] of a force (3,) [N], in the axes of the base, that acts on the tip link's origin."""
    # from the tip inwards: force and moment about each joint's origin, in the axes of its frame
    n = out.size
    turn, above, pull, moment, lever = np.zeros((n, 3, 3)), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(n):
        p = chain.parent[i]
        for k in range(3):
            # column k of the rotation from the joint's frame to the base
            above[0], above[1], above[2] = rotation[i, 0, k], rotation[i, 1, k], rotation[i, 2, k]
            if p >= 0:
                _turned(turn[p], above, lever)
                above[0], above[1], above[2] = lever[0], lever[1], lever[2]
            turn[i, 0, k], turn[i, 1, k], turn[i, 2, k] = above[0], above[1], above[2]
        out[i] = 0.0
    i = chain.tip
    _turned_back(turn[i], force, pull)
    _cross(chain.tip_offset, pull, moment)
    while i >= 0:
        carried = pull if chain.slides[i] > 0.0 else moment
        out[i] = chain.axis[i, 0] * carried[0] + chain.axis[i, 1] * carried[1] + chain.axis[i, 2] * carried[2]
        _turned(rotation[i], pull, above)
        _turned(rotation[i], moment, lever)
        _cross(offset[i], above, moment)
        for r in range(3):
            pull[r] = above[r]
            moment[r] += lever[r]
        i = chain.parent[i]
