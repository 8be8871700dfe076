"""Does a hidden effect show in the recording, and as itself?"""

from collections.abc import Collection

import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.zero_phase import low_passed
from sysid_ros.simulation.hidden_effects.channels import Signals
from sysid_ros.simulation.hidden_effects.sensor_noise import BAND
from sysid_ros.torque.torque_model import TorqueModel

_SLOW = 0.015
_GRID = 100.0
_PLAIN = ("constant", "sign", "velocity")


def nominal_residual(robot: RobotModel, exact: Signals) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What the URDF, with its ``<dynamics>``, leaves of the exact efforts below ``BAND``.

    t (K,), v (K, n) and residual (K, n) [N m].

    Velocity and acceleration are differences of the exact positions, as a diagnosis would have to take them.
    """
    period = float(exact.t[1] - exact.t[0])
    v = (exact.q[2:] - exact.q[:-2]) / (2.0 * period)
    a = (exact.q[2:] - 2.0 * exact.q[1:-1] + exact.q[:-2]) / period**2
    every = max(round(1.0 / period / _GRID), 1)
    # inverse dynamics at 100 Hz of a motion below BAND
    q_s, v_s, a_s, tau_s = (low_passed(x, BAND, period)[::every] for x in (exact.q[1:-1], v, a, exact.tau[1:-1]))
    t = exact.t[1:-1][::every]
    nominal = TorqueModel(robot, [], turns=_SLOW).torque_along(Motion(robot, t, q_s, v_s, a_s, tau_s))
    return t, v_s, tau_s - nominal


def shown(residual: FloatArray, floor: FloatArray) -> FloatArray:
    """Residual's rms in floors, shape (n,)."""
    return np.asarray(np.sqrt(np.mean(residual**2, axis=0)) / floor)


def shown_as_itself(v: FloatArray, residual: FloatArray, floor: FloatArray, own: Collection[str]) -> FloatArray:
    """As :func:`shown`, after a constant, Coulomb and viscous friction took what they can, unless they are hidden themselves:
    ``own`` names which of ``constant``, ``sign`` and ``velocity`` are.

    A Stribeck friction whose bump is below the noise is a Coulomb friction in this recording; this tells them apart.
    """
    out = np.empty(residual.shape[1])
    keep = [column for column, name in enumerate(_PLAIN) if name not in own]
    for j in range(residual.shape[1]):
        moving = np.abs(v[:, j]) > _SLOW
        if moving.sum() < 20:
            out[j] = 0.0
            continue
        x = v[moving, j]
        columns = np.column_stack([np.ones_like(x), np.sign(x), x])[:, keep]
        left = residual[moving, j] - columns @ np.linalg.lstsq(columns, residual[moving, j], rcond=None)[0]
        out[j] = np.sqrt(np.mean(left**2)) / floor[j]
    return out
