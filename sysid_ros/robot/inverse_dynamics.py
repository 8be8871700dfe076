"""Inverse dynamics of whole motions as one compiled loop: a call through an interpreter for each sample costs ten times as much.

Reference: Featherstone 2008, "Rigid Body Dynamics Algorithms", section 5.3, in the frames of the joints.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}


def inverse_dynamics_along(model: Any, q: FloatArray, v: FloatArray, a: FloatArray, gravity: FloatArray) -> FloatArray:
    """Torque of a motion, shape (N, n) [N m].

    Args:
        model: pinocchio's, of revolute and prismatic joints. q, v, a: shape (N, n). gravity: in the base, shape (3,) [m/s^2].
    """
    joints = range(1, model.njoints)
    axes = np.array([np.asarray(model.joints[j].createData().S).reshape(6) for j in joints]).reshape(-1, 6)
    placements = [model.jointPlacements[j] for j in joints]
    bodies = [model.inertias[j].toDynamicParameters() for j in joints]
    out = np.empty(np.shape(q))
    _run(
        np.array([model.parents[j] - 1 for j in joints], dtype=np.int64),
        np.array([np.array(p.rotation) for p in placements]).reshape(-1, 3, 3),
        np.array([np.array(p.translation) for p in placements]).reshape(-1, 3),
        axes,
        np.array(bodies).reshape(-1, 10),
        np.asarray(model.armature, dtype=float),
        np.asarray(gravity, dtype=float),
        np.ascontiguousarray(q, dtype=float),
        np.ascontiguousarray(v, dtype=float),
        np.ascontiguousarray(a, dtype=float),
        out,
    )
    return out


@njit(inline="always", **_JIT)  # type: ignore[untyped-decorator]
def _turn(fixed: FloatArray, axis: FloatArray, angle: float, out: FloatArray) -> None:
    """``out = fixed Rot(axis, angle)`` (Rodrigues)."""
    s, c = np.sin(angle), np.cos(angle)
    x, y, z, k = axis[3], axis[4], axis[5], 1.0 - c
    for r in range(3):
        f0, f1, f2 = fixed[r, 0], fixed[r, 1], fixed[r, 2]
        along = k * (f0 * x + f1 * y + f2 * z)
        out[r, 0] = c * f0 + along * x + s * (f1 * z - f2 * y)
        out[r, 1] = c * f1 + along * y + s * (f2 * x - f0 * z)
        out[r, 2] = c * f2 + along * z + s * (f0 * y - f1 * x)


@njit(inline="always", **_JIT)  # type: ignore[untyped-decorator]
def _back(R: FloatArray, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


@njit(inline="always", **_JIT)  # type: ignore[untyped-decorator]
def _forth(R: FloatArray, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@njit(inline="always", **_JIT)  # type: ignore[untyped-decorator]
def _cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(inline="always", **_JIT)  # type: ignore[untyped-decorator]
def _force(body: FloatArray, w: FloatArray, out: FloatArray) -> None:
    """Force and moment about the joint's origin that a body needs for the motion ``w``: angular velocity, angular and linear
    acceleration."""
    m, x, y, z = body[0], body[1], body[2], body[3]
    cx, cy, cz = _cross(w[0], w[1], w[2], x, y, z)
    ex, ey, ez = _cross(w[0], w[1], w[2], cx, cy, cz)
    tx, ty, tz = _cross(w[3], w[4], w[5], x, y, z)
    out[0], out[1], out[2] = m * w[6] + tx + ex, m * w[7] + ty + ey, m * w[8] + tz + ez
    xx, xy, yy, xz, yz, zz = body[4], body[5], body[6], body[7], body[8], body[9]
    hx = xx * w[0] + xy * w[1] + xz * w[2]
    hy = xy * w[0] + yy * w[1] + yz * w[2]
    hz = xz * w[0] + yz * w[1] + zz * w[2]
    gx, gy, gz = _cross(w[0], w[1], w[2], hx, hy, hz)
    lx, ly, lz = _cross(x, y, z, w[6], w[7], w[8])
    out[3] = xx * w[3] + xy * w[4] + xz * w[5] + gx + lx
    out[4] = xy * w[3] + yy * w[4] + yz * w[5] + gy + ly
    out[5] = xz * w[3] + yz * w[4] + zz * w[5] + gz + lz


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _run(
    parent: Any,
    fixed: FloatArray,
    offset: FloatArray,
    axes: FloatArray,
    bodies: FloatArray,
    armature: FloatArray,
    gravity: FloatArray,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    out: FloatArray,
) -> None:
    n = parent.size
    R, at, w, f = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 9)), np.empty((n, 6))
    still = np.zeros(9)
    still[6:] = -gravity
    for k in range(q.shape[0]):
        for i in range(n):
            s, before = axes[i], w[parent[i]] if parent[i] >= 0 else still
            # a slide turns by nothing, a hinge moves by nothing
            slides = abs(s[0]) + abs(s[1]) + abs(s[2]) > 0.0
            _turn(fixed[i], s, 0.0 if slides else q[k, i], R[i])
            px, py, pz = _forth(fixed[i], s[0] * q[k, i], s[1] * q[k, i], s[2] * q[k, i])
            px, py, pz = px + offset[i, 0], py + offset[i, 1], pz + offset[i, 2]
            at[i, 0], at[i, 1], at[i, 2] = px, py, pz
            cx, cy, cz = _cross(before[0], before[1], before[2], px, py, pz)
            ex, ey, ez = _cross(before[0], before[1], before[2], cx, cy, cz)
            tx, ty, tz = _cross(before[3], before[4], before[5], px, py, pz)
            lx, ly, lz = _back(R[i], before[6] + tx + ex, before[7] + ty + ey, before[8] + tz + ez)
            ox, oy, oz = _back(R[i], before[0], before[1], before[2])
            dx, dy, dz = _back(R[i], before[3], before[4], before[5])
            # what the joint adds: its velocity, its acceleration, and what the turning frame makes of the former
            rate, faster = v[k, i], a[k, i]
            ux, uy, uz = _cross(ox, oy, oz, s[3] * rate, s[4] * rate, s[5] * rate)
            sx, sy, sz = _cross(ox, oy, oz, s[0] * rate, s[1] * rate, s[2] * rate)
            own = w[i]
            own[0], own[1], own[2] = ox + s[3] * rate, oy + s[4] * rate, oz + s[5] * rate
            own[3], own[4], own[5] = dx + s[3] * faster + ux, dy + s[4] * faster + uy, dz + s[5] * faster + uz
            own[6], own[7], own[8] = lx + s[0] * faster + 2.0 * sx, ly + s[1] * faster + 2.0 * sy, lz + s[2] * faster + 2.0 * sz
            _force(bodies[i], own, f[i])
        for i in range(n - 1, -1, -1):
            s, g, p = axes[i], f[i], parent[i]
            out[k, i] = armature[i] * a[k, i] + s[0] * g[0] + s[1] * g[1] + s[2] * g[2] + s[3] * g[3] + s[4] * g[4] + s[5] * g[5]
            if p >= 0:
                fx, fy, fz = _forth(R[i], g[0], g[1], g[2])
                mx, my, mz = _forth(R[i], g[3], g[4], g[5])
                bx, by, bz = _cross(at[i, 0], at[i, 1], at[i, 2], fx, fy, fz)
                f[p, 0] += fx
                f[p, 1] += fy
                f[p, 2] += fz
                f[p, 3] += mx + bx
                f[p, 4] += my + by
                f[p, 5] += mz + bz
