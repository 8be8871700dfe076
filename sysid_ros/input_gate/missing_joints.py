"""Joints of the URDF that the messages do not name: where they stand may matter for all the others."""

from __future__ import annotations

import numpy as np

from sysid_ros.robot.robot_model import RobotModel

_POSTURES = 40
_MATTERS = 0.1
"""Part of a joint's gravity torque that may depend on where a joint stands that nobody measured."""


def missing_joints(robot: RobotModel) -> str | None:
    """Why the model can't be judged without the joints that it locks at 0, with the cure; None where they hardly matter.

    In random postures each locked joint is moved within its limits, and what the others' gravity torque changes by is compared
    with the largest that it is. A gripper's fingers or the lift of a platform hardly change it; a forgotten elbow does.
    """
    whole = RobotModel.from_urdf(robot.urdf, gravity=tuple(robot.gravity))
    locked = [j for j, name in enumerate(whole.joint_names) if name not in robot.joint_names]
    if not locked:
        return None
    used = [whole.joint_names.index(name) for name in robot.joint_names]
    rng = np.random.default_rng(0)
    low, high = np.maximum(whole.position_lower, -np.pi), np.minimum(whole.position_upper, np.pi)
    change, largest = np.zeros((len(locked), robot.n)), np.zeros(robot.n)
    for _ in range(_POSTURES):
        q, elsewhere = rng.uniform(low, high, (2, whole.n))
        q[locked] = 0.0
        torque = whole.gravity_torque(q)[used]
        largest = np.maximum(largest, np.abs(torque))
        for k, j in enumerate(locked):
            moved = q.copy()
            moved[j] = elsewhere[j]
            change[k] = np.maximum(change[k], np.abs(whole.gravity_torque(moved)[used] - torque))
    matters = np.any(change > _MATTERS * np.maximum(largest, 0.02 * largest.max()), axis=1)
    if not matters.any():
        return None
    names = ", ".join(whole.joint_names[j] for j, yes in zip(locked, matters, strict=True) if yes)
    return (
        f"the messages do not hold {names} of the URDF, and the torque of the other joints depends on where they stand. Record "
        "all of the arm's joints, or, where these stand at 0 indeed, name the others in joint_names (--config)."
    )
