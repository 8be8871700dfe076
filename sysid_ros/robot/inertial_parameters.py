"""The ten inertial parameters of a rigid body: names, order, units and every conversion between their forms.

Order (pinocchio's): m, mc_x, mc_y, mc_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz, the inertia about the *frame's origin*.
``geometry_msgs/Inertia`` and the node's messages hold another order and the inertia about the *centre of mass*; only this file
converts.
"""

from __future__ import annotations

import numpy as np

from sysid_ros.sample import FloatArray

NAMES = ("m", "mc_x", "mc_y", "mc_z", "I_xx", "I_xy", "I_yy", "I_xz", "I_yz", "I_zz")
UNITS = ("kg",) + ("kg m",) * 3 + ("kg m^2",) * 6
MESSAGE_NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
TO_MESSAGE_ORDER = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])
"""Index that takes a vector in pinocchio's order to the order of the messages, and back (it is its own inverse)."""

_TENSOR = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))


def inertia_matrix(theta: FloatArray) -> FloatArray:
    """Inertia about the frame's origin, shape (3, 3) [kg m^2], from theta of shape (10,)."""
    xx, xy, yy, xz, yz, zz = theta[4:10]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def from_com(mass: float, com: FloatArray, inertia_com: FloatArray) -> FloatArray:
    """Theta of shape (10,) from the mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2] (parallel-axis
    theorem)."""
    com = np.asarray(com, dtype=float)
    origin = np.asarray(inertia_com, dtype=float) + mass * (com @ com * np.eye(3) - np.outer(com, com))
    return np.concatenate(([mass], mass * com, [origin[i, j] for i, j in _TENSOR]))


def to_com(theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2]; com and inertia are NaN where the mass is zero."""
    mass = float(theta[0])
    if mass == 0.0:
        return 0.0, np.full(3, np.nan), np.full((3, 3), np.nan)
    com = theta[1:4] / mass
    return mass, com, inertia_matrix(theta) - mass * (com @ com * np.eye(3) - np.outer(com, com))


def com_jacobian(theta: FloatArray) -> FloatArray:
    """Derivative of the centre of mass by theta, shape (3, 10) [m per unit], for the delta method."""
    jacobian = np.zeros((3, 10))
    jacobian[:, 0] = -theta[1:4] / theta[0] ** 2
    jacobian[:, 1:4] = np.eye(3) / theta[0]
    return jacobian


def pseudo_inertia(theta: FloatArray) -> FloatArray:
    """Pseudo-inertia, shape (4, 4): [[Sigma, mc], [mc', m]] with Sigma = tr(I)/2 1 - I (Wensing, Kim, Slotine 2018, section
    III)."""
    inertia = inertia_matrix(theta)
    out = np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = theta[1:4]
    out[3, 3] = theta[0]
    return out


def from_pseudo_inertia(matrix: FloatArray) -> FloatArray:
    """Theta of shape (10,) from a pseudo-inertia of shape (4, 4)."""
    sigma = matrix[:3, :3]
    inertia = np.trace(sigma) * np.eye(3) - sigma
    return np.concatenate(([matrix[3, 3]], matrix[:3, 3], [inertia[i, j] for i, j in _TENSOR]))


def is_physical(theta: FloatArray) -> bool:
    """True where some body of positive density has these parameters: the pseudo-inertia is positive definite."""
    try:
        np.linalg.cholesky(pseudo_inertia(theta))
    except np.linalg.LinAlgError:
        return False
    return True


def move(theta: FloatArray, rotation: FloatArray, translation: FloatArray) -> FloatArray:
    """Theta of the same body seen from another frame.

    Args:
        theta: shape (10,), in frame B.
        rotation: shape (3, 3), takes vectors from B to A.
        translation: shape (3,) [m], origin of B in A.
    """
    homogeneous = np.eye(4)
    homogeneous[:3, :3], homogeneous[:3, 3] = rotation, translation
    return from_pseudo_inertia(homogeneous @ pseudo_inertia(theta) @ homogeneous.T)
