"""Rotations between their forms, by pinocchio, and the box by which an inertia is drawn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from sysid_ros.sample import FloatArray


def rotation_of(rpy: Sequence[float] | FloatArray) -> FloatArray:
    """Rotation matrix (3, 3) of roll, pitch, yaw as in a URDF: turns about the fixed axes x, y, z, one after the other [rad]."""
    return np.array(pin.rpy.rpyToMatrix(np.asarray(rpy, dtype=float)))


def quaternion(rotation: FloatArray) -> list[float]:
    """x, y, z, w of a rotation matrix of shape (3, 3)."""
    return [float(x) for x in pin.Quaternion(rotation).coeffs()]


def equivalent_box(mass: float, inertia_com: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Edges (3,) [m] and rotation (3, 3) of the homogeneous box with this mass and inertia about its centre.

    The box's principal moments are m/12 (b^2 + c^2) and so on; an edge whose square comes out
    negative is drawn one millimetre long.
    """
    moments, axes = np.linalg.eigh(inertia_com)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    squares = 6.0 / mass * (moments.sum() - 2.0 * moments)
    return np.sqrt(np.maximum(squares, 1e-6)), axes


def rpy_of(rotation: FloatArray) -> FloatArray:
    """Roll, pitch and yaw of a rotation matrix (3, 3), as URDF and SDF write them, shape (3,) [rad]."""
    return np.asarray(pin.rpy.matrixToRpy(np.asarray(rotation)))


def turned_by(quaternions: FloatArray, rotation: FloatArray) -> FloatArray:
    """Orientations x, y, z, w, shape (N, 4), each followed by a rotation (3, 3) in its own axes, shape (N, 4)."""
    after = pin.Quaternion(np.asarray(rotation, dtype=float))
    return np.array([(pin.Quaternion(np.asarray(x, dtype=float)).normalized() * after).coeffs() for x in quaternions])


def rotation_by(vector: FloatArray) -> FloatArray:
    """Rotation matrix (3, 3) of a turn about an axis by its length, shape (3,) [rad]."""
    return np.array(pin.exp3(np.asarray(vector, dtype=float)))
