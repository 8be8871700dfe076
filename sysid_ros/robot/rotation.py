"""Rotation matrices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.sample import FloatArray


def rotation_of(rpy: Sequence[float] | FloatArray) -> FloatArray:
    """Rotation matrix (3, 3) of roll, pitch, yaw as in a URDF: turns about the fixed axes x, y, z, one after the other [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(z @ y @ x)
