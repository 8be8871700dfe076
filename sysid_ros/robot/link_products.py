"""Products with the links' regressor in compiled code, without that regressor.

``Y(q, v, a) L`` has a row a joint and a column for each column of L, which are link inertials, or errors of them. Y itself has
n (n + 1) / 2 blocks. The wrenches that the columns of L make at each link are carried from link to link instead, all columns at
once, as the recursive Newton-Euler algorithm does with one (Featherstone 2008, section 5.3): n steps instead of n (n + 1) / 2.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sysid_ros.robot.joint_motion import AXIS, PARENT, PLACE, ROTATION, TURNS, move
from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}

LANES: Final = 16
"""Columns that are worked out side by side: a number that is known when it is compiled makes vector instructions of their loops,
and of fewer the compiler makes none where it can't tell that arrays do not overlap."""


def in_lanes(linear: FloatArray) -> FloatArray:
    """Columns L, shape (10 n, k), as :func:`link_products` reads them: shape (n, ceil(k / 16), 160), zeros behind the last."""
    n, k = len(linear) // 10, linear.shape[1]
    blocks = -(-k // LANES)
    padded = np.zeros((n, 10, blocks * LANES))
    padded[:, :, :k] = linear.reshape(n, 10, k)
    return np.ascontiguousarray(padded.reshape(n, 10, blocks, LANES).transpose(0, 2, 1, 3).reshape(n, blocks, -1))


def own_blocks(lanes: FloatArray) -> NDArray[np.int64]:
    """Of each link, blocks of :func:`in_lanes` beyond which its inertials are zero in all columns, shape (n,)."""
    used = np.any(lanes != 0.0, axis=2) * np.arange(1, lanes.shape[1] + 1)
    return np.asarray(used.max(axis=1, initial=0), dtype=np.int64)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _wrench(room: FloatArray, i: int, body: FloatArray, out: FloatArray) -> None:
    """Force and moment about the joint's origin, (96,), that the columns of a block, (160,), cost at link i, by its motion."""
    wx, wy, wz = room[i, TURNS], room[i, TURNS + 1], room[i, TURNS + 2]
    dx, dy, dz = room[i, TURNS + 3], room[i, TURNS + 4], room[i, TURNS + 5]
    lx, ly, lz = room[i, TURNS + 6], room[i, TURNS + 7], room[i, TURNS + 8]
    xx, yy, zz, xy, xz, yz = wx * wx, wy * wy, wz * wz, wx * wy, wx * wz, wy * wz
    for c in range(LANES):
        m, x, y, z = body[c], body[LANES + c], body[2 * LANES + c], body[3 * LANES + c]
        Ixx, Ixy, Iyy = body[4 * LANES + c], body[5 * LANES + c], body[6 * LANES + c]
        Ixz, Iyz, Izz = body[7 * LANES + c], body[8 * LANES + c], body[9 * LANES + c]
        out[c] = m * lx - (yy + zz) * x + (xy - dz) * y + (xz + dy) * z
        out[LANES + c] = m * ly + (xy + dz) * x - (xx + zz) * y + (yz - dx) * z
        out[2 * LANES + c] = m * lz + (xz - dy) * x + (yz + dx) * y - (xx + yy) * z
        out[3 * LANES + c] = (
            y * lz - z * ly + Ixx * dx + Ixy * (dy - xz) - Iyy * yz + Ixz * (dz + xy) + Iyz * (yy - zz) + Izz * yz
        )
        out[4 * LANES + c] = (
            z * lx - x * lz + Ixx * xz + Ixy * (dx + yz) + Iyy * dy + Ixz * (zz - xx) + Iyz * (dz - xy) - Izz * xz
        )
        out[5 * LANES + c] = (
            x * ly - y * lx - Ixx * xy + Ixy * (xx - yy) + Iyy * xy + Ixz * (dx - yz) + Iyz * (dy + xz) + Izz * dz
        )


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _to_parent(room: FloatArray, i: int, wrench: FloatArray, out: FloatArray) -> None:
    """Add the wrenches of a block at link i, (96,), to those at the link before it."""
    r0, r1, r2 = room[i, ROTATION], room[i, ROTATION + 1], room[i, ROTATION + 2]
    r3, r4, r5 = room[i, ROTATION + 3], room[i, ROTATION + 4], room[i, ROTATION + 5]
    r6, r7, r8 = room[i, ROTATION + 6], room[i, ROTATION + 7], room[i, ROTATION + 8]
    x, y, z = room[i, PLACE], room[i, PLACE + 1], room[i, PLACE + 2]
    for c in range(LANES):
        f0, f1, f2 = wrench[c], wrench[LANES + c], wrench[2 * LANES + c]
        m0, m1, m2 = wrench[3 * LANES + c], wrench[4 * LANES + c], wrench[5 * LANES + c]
        fx, fy, fz = r0 * f0 + r1 * f1 + r2 * f2, r3 * f0 + r4 * f1 + r5 * f2, r6 * f0 + r7 * f1 + r8 * f2
        out[c] += fx
        out[LANES + c] += fy
        out[2 * LANES + c] += fz
        out[3 * LANES + c] += r0 * m0 + r1 * m1 + r2 * m2 + y * fz - z * fy
        out[4 * LANES + c] += r3 * m0 + r4 * m1 + r5 * m2 + z * fx - x * fz
        out[5 * LANES + c] += r6 * m0 + r7 * m1 + r8 * m2 + x * fy - y * fx


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _along_axis(joints: FloatArray, i: int, wrench: FloatArray) -> None:
    """Let the first of the wrenches of a block, (96,), become the parts of them that joint i bears."""
    s0, s1, s2 = joints[i, AXIS], joints[i, AXIS + 1], joints[i, AXIS + 2]
    s3, s4, s5 = joints[i, AXIS + 3], joints[i, AXIS + 4], joints[i, AXIS + 5]
    for c in range(LANES):
        force = s0 * wrench[c] + s1 * wrench[LANES + c] + s2 * wrench[2 * LANES + c]
        wrench[c] = force + s3 * wrench[3 * LANES + c] + s4 * wrench[4 * LANES + c] + s5 * wrench[5 * LANES + c]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def link_products(
    joints: FloatArray,
    gravity: FloatArray,
    lanes: FloatArray,
    own: NDArray[np.int64],
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    room: FloatArray,
    wrench: FloatArray,
    places: NDArray[np.int64],
    out: FloatArray,
) -> None:
    """``out[:, places] = Y(q, v, a) L``, without what the motors add.

    Args:
        joints: as of :func:`.joint_motion.joint_table`. gravity: in the base, shape (3,) [m/s^2].
        lanes: L, as of :func:`in_lanes`. own: as of :func:`own_blocks`. q, v, a: shape (n,).
        room, wrench: to work in, shapes (n, 21) and (n, blocks, 96).
        places: where in a row of ``out`` (n, ...) each of the k columns goes, shape (k,).
    """
    n, blocks = q.size, lanes.shape[1]
    for i in range(n):
        move(joints, gravity, i, q[i], v[i], a[i], room)
        for b in range(own[i]):
            _wrench(room, i, lanes[i, b], wrench[i, b])
        wrench[i, own[i] :] = 0.0
    for i in range(n - 1, -1, -1):
        p = int(joints[i, PARENT])
        for b in range(blocks):
            here = wrench[i, b]
            if p >= 0:
                _to_parent(room, i, here, wrench[p, b])
            _along_axis(joints, i, here)
            for c in range(min(LANES, places.size - b * LANES)):
                out[i, places[b * LANES + c]] = here[c]
