"""BodyTorque: what a body that is fixed to a frame of the robot costs its joints, in compiled code."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.inverse_dynamics import force
from sysid_ros.robot.joint_motion import AXIS, MOTION, PARENT, PLACE, ROTATION, TURNS, cross, forth, joint_table, move
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


class BodyTorque:
    """``tau = J_frame' Y_body theta``: the product of :meth:`.RobotModel.payload_regressor` with one body, without the regressor.

    Args:
        robot: whose gravity may be turned. frame: as of :meth:`.RobotModel.frame_id`.
    """

    def __init__(self, robot: RobotModel, frame: int) -> None:
        self._robot, self._joints = robot, joint_table(robot.model)
        at = robot.model.frames[frame]
        self._link = int(at.parentJoint) - 1  # -1: what hangs on the base is carried by no joint
        placement = np.array(at.placement.rotation), np.array(at.placement.translation)
        self._to_link = np.ascontiguousarray(np.stack([inertial_parameters.move(e, *placement) for e in np.eye(10)], axis=1))
        self._room: FloatArray = np.zeros((robot.n, MOTION))

    def __call__(self, q: FloatArray, v: FloatArray, a: FloatArray, theta: FloatArray) -> FloatArray:
        """Torque of a body of ten parameters in the frame, shape (n,) [N m]."""
        tau = np.zeros(q.size)
        _body_torque(self._joints, self._robot.gravity, self._to_link, self._link, q, v, a, theta, self._room, tau)
        return tau


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _body_torque(
    joints: FloatArray,
    gravity: FloatArray,
    to_link: FloatArray,
    link: int,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    theta: FloatArray,
    room: FloatArray,
    out: FloatArray,
) -> None:
    """As :meth:`BodyTorque.__call__`, into ``out``, which is zero: ``to_link @ theta`` is the body in the frame of its link."""
    for i in range(link + 1):  # those before a joint have lower numbers
        move(joints, gravity, i, q[i], v[i], a[i], room)
    body, f = np.zeros(10), np.zeros(6)
    for r in range(10):
        for k in range(10):
            body[r] += to_link[r, k] * theta[k]
    i = link
    if i >= 0:
        force(body, room[i, TURNS:], f)
    while i >= 0:
        for k in range(6):
            out[i] += joints[i, AXIS + k] * f[k]
        fx, fy, fz = forth(room, i, ROTATION, f[0], f[1], f[2])
        mx, my, mz = forth(room, i, ROTATION, f[3], f[4], f[5])
        bx, by, bz = cross(room[i, PLACE], room[i, PLACE + 1], room[i, PLACE + 2], fx, fy, fz)
        f[0], f[1], f[2], f[3], f[4], f[5] = fx, fy, fz, mx + bx, my + by, mz + bz
        i = int(joints[i, PARENT])
