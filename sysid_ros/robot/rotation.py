"""Rotations between their forms, by pinocchio."""

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
