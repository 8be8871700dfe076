"""Is there another single cause that this recording could not tell from the hidden one?

Only what is exactly as linear as the hidden cause is asked, by least squares with nothing but the robot's own regressor: another
link's ten inertials, a balancer on one joint, a constant pull at the tip, a body there. A case that another cause explains to
within the noise has two right answers and is drawn again.
"""

from __future__ import annotations

import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.hidden_effects import DiagnosisMotion, TrueRobot

_GRID = 0.1
_TOLD = 3.0


def _left(columns: np.ndarray, torque: np.ndarray, floor: np.ndarray) -> float:
    """Largest rms over the joints, in floors, that columns (N, n, p) leave of a torque (N, n)."""
    weighted = (columns / floor[:, None]).reshape(-1, columns.shape[2])
    wanted = (torque / floor).reshape(-1)
    left = (wanted - weighted @ np.linalg.lstsq(weighted, wanted, rcond=None)[0]).reshape(torque.shape)
    return float(np.sqrt(np.mean(left**2, axis=0)).max())


def told_apart(true: TrueRobot, motion: DiagnosisMotion, floor: np.ndarray) -> bool:
    """False where another cause than the first effect of ``true`` explains what it does to within three noise floors."""
    effect, robot = true.effects[0], true.robot
    if effect.id not in ("payload", "payload_change", "link_inertia", "external_force"):
        return True
    q, v, a = motion.sample(np.arange(0.0, motion.duration, _GRID))
    regressor = robot.regressor_along(q, v, a)
    pull = np.swapaxes(robot.frame_jacobian_along(q, robot.frame_id(robot.default_frame)), 1, 2)
    n = robot.n
    if effect.id == "external_force":
        return _left(regressor[:, :, -10:], -pull @ true.force, floor) >= _TOLD
    added = (true.pi_after - robot.pi.reshape(n, 10)).reshape(-1)
    torque = regressor @ added
    wrong = n - 1 if effect.id != "link_inertia" else true.index(effect.joints[0])
    others = [regressor[:, :, 10 * k : 10 * k + 10] for k in range(n) if k != wrong]
    others += [pull, *(_balancer(robot, q, j) for j in range(n))]
    return all(_left(columns, torque, floor) >= _TOLD for columns in others)


def _balancer(robot: RobotModel, q: np.ndarray, joint: int) -> np.ndarray:
    columns = np.zeros((len(q), robot.n, 2))
    columns[:, joint] = np.column_stack([np.sin(q[:, joint]), np.cos(q[:, joint])])
    return columns
