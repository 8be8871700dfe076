"""How the joints of a tree move the frames that hang on them, one joint after the other, in compiled code.

Reference: Featherstone 2008, "Rigid Body Dynamics Algorithms", section 5.3, in the frames of the joints.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}

PARENT, FIXED, OFFSET, AXIS, ARMATURE, SIZE = 0, 1, 10, 13, 19, 20
"""Where in a row of :func:`joint_table` stand the number of the joint before it (-1: none), rotation and place of its frame at 0
in the frame of that one, its axis (motion along it, turn about it), and what its motor adds to its inertia; length of a row."""
ROTATION, PLACE, TURNS, MOTION = 0, 9, 12, 21
"""Where in a row of the room of :func:`move` stand rotation and place of a frame in the one before it, its angular velocity,
angular and linear acceleration, and where a row ends."""


def joint_table(model: Any) -> FloatArray:
    """What is constant of the joints of pinocchio's model, revolute and prismatic ones, a row each, shape (n, 20)."""
    table = np.zeros((model.njoints - 1, SIZE))
    for row, j in zip(table, range(1, model.njoints), strict=True):
        placement = model.jointPlacements[j]
        row[PARENT] = model.parents[j] - 1
        row[FIXED:OFFSET] = np.array(placement.rotation).ravel()
        row[OFFSET:AXIS] = np.array(placement.translation)
        row[AXIS:ARMATURE] = np.asarray(model.joints[j].createData().S).reshape(6)
    table[:, ARMATURE] = np.asarray(model.armature, dtype=float)
    return table


@njit(**_JIT)  # type: ignore[untyped-decorator]
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    """``a x b``."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(**_JIT)  # type: ignore[untyped-decorator]
def forth(R: FloatArray, i: int, at: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """``R x``, of the rotation in row i from column ``at`` on."""
    return (
        R[i, at] * x + R[i, at + 1] * y + R[i, at + 2] * z,
        R[i, at + 3] * x + R[i, at + 4] * y + R[i, at + 5] * z,
        R[i, at + 6] * x + R[i, at + 7] * y + R[i, at + 8] * z,
    )


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _back(R: FloatArray, i: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """``R' x``."""
    return (
        R[i, 0] * x + R[i, 3] * y + R[i, 6] * z,
        R[i, 1] * x + R[i, 4] * y + R[i, 7] * z,
        R[i, 2] * x + R[i, 5] * y + R[i, 8] * z,
    )


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _turn(joints: FloatArray, i: int, angle: float, out: FloatArray) -> None:
    """``out = fixed Rot(axis, angle)`` (Rodrigues)."""
    s, c = np.sin(angle), np.cos(angle)
    x, y, z, k = joints[i, AXIS + 3], joints[i, AXIS + 4], joints[i, AXIS + 5], 1.0 - c
    for r in range(3):
        f0, f1, f2 = joints[i, FIXED + 3 * r], joints[i, FIXED + 3 * r + 1], joints[i, FIXED + 3 * r + 2]
        along = k * (f0 * x + f1 * y + f2 * z)
        out[i, 3 * r] = c * f0 + along * x + s * (f1 * z - f2 * y)
        out[i, 3 * r + 1] = c * f1 + along * y + s * (f2 * x - f0 * z)
        out[i, 3 * r + 2] = c * f2 + along * z + s * (f0 * y - f1 * x)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def move(joints: FloatArray, gravity: FloatArray, i: int, q: float, v: float, a: float, room: FloatArray) -> None:
    """Motion of the frame of joint i, after those before it, in row i of ``room``, shape (n, 21), see :data:`ROTATION`.

    Args:
        joints: as of :func:`joint_table`. gravity: in the base, shape (3,) [m/s^2]. q, v, a: of the joint.
    """
    s0, s1, s2 = joints[i, AXIS], joints[i, AXIS + 1], joints[i, AXIS + 2]
    s3, s4, s5 = joints[i, AXIS + 3], joints[i, AXIS + 4], joints[i, AXIS + 5]
    # a slide turns by nothing, a hinge moves by nothing
    slides = abs(s0) + abs(s1) + abs(s2) > 0.0
    _turn(joints, i, 0.0 if slides else q, room)
    px, py, pz = forth(joints, i, FIXED, s0 * q, s1 * q, s2 * q)
    px, py, pz = px + joints[i, OFFSET], py + joints[i, OFFSET + 1], pz + joints[i, OFFSET + 2]
    room[i, PLACE], room[i, PLACE + 1], room[i, PLACE + 2] = px, py, pz
    wx = wy = wz = dx = dy = dz = 0.0
    lx, ly, lz = -gravity[0], -gravity[1], -gravity[2]
    p = int(joints[i, PARENT])
    if p >= 0:
        wx, wy, wz, dx, dy, dz = room[p, 12], room[p, 13], room[p, 14], room[p, 15], room[p, 16], room[p, 17]
        cx, cy, cz = cross(wx, wy, wz, px, py, pz)
        ex, ey, ez = cross(wx, wy, wz, cx, cy, cz)
        tx, ty, tz = cross(dx, dy, dz, px, py, pz)
        lx, ly, lz = room[p, 18] + tx + ex, room[p, 19] + ty + ey, room[p, 20] + tz + ez
    lx, ly, lz = _back(room, i, lx, ly, lz)
    wx, wy, wz = _back(room, i, wx, wy, wz)
    dx, dy, dz = _back(room, i, dx, dy, dz)
    # what the joint adds: its velocity, its acceleration, and what the turning frame makes of the former
    ux, uy, uz = cross(wx, wy, wz, s3 * v, s4 * v, s5 * v)
    sx, sy, sz = cross(wx, wy, wz, s0 * v, s1 * v, s2 * v)
    room[i, 12], room[i, 13], room[i, 14] = wx + s3 * v, wy + s4 * v, wz + s5 * v
    room[i, 15], room[i, 16], room[i, 17] = dx + s3 * a + ux, dy + s4 * a + uy, dz + s5 * a + uz
    room[i, 18], room[i, 19], room[i, 20] = lx + s0 * a + 2.0 * sx, ly + s1 * a + 2.0 * sy, lz + s2 * a + 2.0 * sz
