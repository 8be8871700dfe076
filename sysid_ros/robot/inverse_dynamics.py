"""Inverse dynamics of whole motions as one compiled loop: a call through an interpreter for each sample costs ten times as much.

Reference: Featherstone 2008, "Rigid Body Dynamics Algorithms", section 5.3; the motion is that of :mod:`.joint_motion`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from sysid_ros.robot.joint_motion import ARMATURE, AXIS, MOTION, PARENT, PLACE, ROTATION, TURNS, cross, forth, joint_table, move
from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}


def inverse_dynamics_along(model: Any, q: FloatArray, v: FloatArray, a: FloatArray, gravity: FloatArray) -> FloatArray:
    """Torque of a motion, shape (N, n) [N m].

    Args:
        model: pinocchio's, of revolute and prismatic joints. q, v, a: shape (N, n). gravity: in the base, shape (3,) [m/s^2].
    """
    bodies = np.array([model.inertias[j].toDynamicParameters() for j in range(1, model.njoints)]).reshape(-1, 10)
    out = np.empty(np.shape(q))
    states = (np.ascontiguousarray(x, dtype=float) for x in (q, v, a))
    _run(joint_table(model), bodies, np.array(gravity, dtype=float), *states, out)
    return out


@njit(inline="always", **_JIT)  # type: ignore[untyped-decorator]
def force(body: FloatArray, w: FloatArray, out: FloatArray) -> None:
    """Force and moment about the joint's origin that a body needs for the motion ``w``: angular velocity, angular and linear
    acceleration."""
    m, x, y, z = body[0], body[1], body[2], body[3]
    cx, cy, cz = cross(w[0], w[1], w[2], x, y, z)
    ex, ey, ez = cross(w[0], w[1], w[2], cx, cy, cz)
    tx, ty, tz = cross(w[3], w[4], w[5], x, y, z)
    out[0], out[1], out[2] = m * w[6] + tx + ex, m * w[7] + ty + ey, m * w[8] + tz + ez
    xx, xy, yy, xz, yz, zz = body[4], body[5], body[6], body[7], body[8], body[9]
    hx = xx * w[0] + xy * w[1] + xz * w[2]
    hy = xy * w[0] + yy * w[1] + yz * w[2]
    hz = xz * w[0] + yz * w[1] + zz * w[2]
    gx, gy, gz = cross(w[0], w[1], w[2], hx, hy, hz)
    lx, ly, lz = cross(x, y, z, w[6], w[7], w[8])
    out[3] = xx * w[3] + xy * w[4] + xz * w[5] + gx + lx
    out[4] = xy * w[3] + yy * w[4] + yz * w[5] + gy + ly
    out[5] = xz * w[3] + yz * w[4] + zz * w[5] + gz + lz


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _run(
    joints: FloatArray,
    bodies: FloatArray,
    gravity: FloatArray,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    out: FloatArray,
) -> None:
    n = len(joints)
    room, f = np.empty((n, MOTION)), np.empty((n, 6))
    for k in range(q.shape[0]):
        for i in range(n):
            move(joints, gravity, i, q[k, i], v[k, i], a[k, i], room)
            force(bodies[i], room[i, TURNS:], f[i])
        for i in range(n - 1, -1, -1):
            s, g, p = joints[i, AXIS:ARMATURE], f[i], int(joints[i, PARENT])
            moved = s[0] * g[0] + s[1] * g[1] + s[2] * g[2] + s[3] * g[3] + s[4] * g[4] + s[5] * g[5]
            out[k, i] = joints[i, ARMATURE] * a[k, i] + moved
            if p >= 0:
                fx, fy, fz = forth(room, i, ROTATION, g[0], g[1], g[2])
                mx, my, mz = forth(room, i, ROTATION, g[3], g[4], g[5])
                bx, by, bz = cross(room[i, PLACE], room[i, PLACE + 1], room[i, PLACE + 2], fx, fy, fz)
                f[p, 0] += fx
                f[p, 1] += fy
                f[p, 2] += fz
                f[p, 3] += mx + bx
                f[p, 4] += my + by
                f[p, 5] += mz + bz
