"""A homogeneous box with given mass and inertia: the shape by which an inertia is drawn."""

from __future__ import annotations

import numpy as np

from sysid_ros.sample import FloatArray


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
