"""How a robot on legs stands, and which joints put its feet where."""

from __future__ import annotations

import numpy as np

from sysid_ros.exceptions import RobotModelError
from sysid_ros.floating.contact_kinematics import ContactKinematics
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.sample import FREE, FloatArray

LegJoints = np.ndarray[tuple[int, int], np.dtype[np.intp]]

_BENT = 0.72
"""Height of the hips over the feet as a part of a leg's full length."""
_POSTURES = 4000


def leg_joints(base: FloatingBase) -> LegJoints:
    """Columns of each leg among the measured joints, shape (k, 3).

    Raises:
        RobotModelError: a foot hangs on more or fewer than three joints.
    """
    legs = [np.flatnonzero(carried[FREE:]) for carried in base.contacts.carriers]
    for name, leg in zip(base.contact_frames, legs, strict=True):
        if leg.size != 3:
            raise RobotModelError(
                f"contact frame {name} hangs on {leg.size} joints; a leg must have three. Correct contact_frames."
            )
    return np.array(legs)


def standing_posture(base: FloatingBase, joints: LegJoints) -> FloatArray:
    """Positions (n,) of legs that are bent alike, each foot below its second joint."""
    robot, legs = base.robot, base.legs
    rng = np.random.default_rng(0)
    low, high = np.maximum(legs.position_lower, -2.6), np.minimum(legs.position_upper, 2.6)
    q = rng.uniform(low, high, (_POSTURES, legs.n))
    second = ContactKinematics(robot, [legs.body_names[leg[1]] for leg in joints])
    feet, hips = np.empty((_POSTURES, len(joints), 3)), np.empty((_POSTURES, len(joints), 3))
    for k, positions in enumerate(q):
        whole = np.concatenate([np.zeros(FREE), positions])
        feet[k], hips[k] = base.contacts.origins(whole)[0], second.origins(whole)[0]
    length = np.linalg.norm(feet - hips, axis=2).max(axis=0)
    neutral = second.origins(np.zeros(robot.n))[0]
    side = base.contacts.origins(np.zeros(robot.n))[0][:, 1]
    goal = np.column_stack([neutral[:, 0], side, neutral[:, 2] - _BENT * length])
    out = np.zeros(legs.n)
    for i, leg in enumerate(joints):
        cost = np.linalg.norm(feet[:, i] - goal[i], axis=1) / length[i] + 0.2 * np.abs(q[:, leg[0]])
        # of two ways to bend a knee the same for all
        out[leg] = q[np.argmin(cost + 0.05 * np.sign(q[:, leg[2]])), leg]
    return inverse(base, joints, out, goal)


def inverse(base: FloatingBase, joints: LegJoints, q: FloatArray, goal: FloatArray, steps: int = 100) -> FloatArray:
    """Joint positions (n,) near q that put the centres of the feet at ``goal`` (k, 3) [m] in the trunk, as near as they can."""
    q = q.copy()
    for _ in range(steps):
        centres, jacobians = base.contacts.jacobians(np.concatenate([np.zeros(FREE), q]))
        error = goal - centres
        for i, leg in enumerate(joints):
            J = jacobians[i, :3, FREE + leg].T
            q[leg] += np.clip(J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(3), error[i]), -0.2, 0.2)
        if np.abs(error).max() < 1e-7:
            break
    return q
