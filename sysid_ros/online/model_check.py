"""ModelCheck: whether the model of a robot on legs explains its torques."""

from __future__ import annotations

import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

IDENTIFY = "Identify the arm without a payload ('sysid identify') and give the model with --model."
_LOOK = "Check the URDF's legs and feet, and that the IMU is low-passed before it is published and stamped like the joints."


class ModelCheck:
    """Compares what known model and payload leave unexplained with the torque itself and with the noise it could be.

    A payload is only as good as the arm's model beneath it. Where the residual is both a large part of the torque and far above
    the noise that the torque signal itself shows at high frequency (or that the model states), it is not noise: the model is
    wrong.

    Args:
        robot: for the names of the joints.
        memory: time constant of the averages [updates]. rows: how many of its joints have rows, from the first on; None: all.

    Attributes:
        memory: as given. ready: True once there are enough updates for a verdict.
        part: as of the last verdict, rms of what is unexplained over rms of the torque, a joint, shape (n,); 0 where the joint
            carries next to nothing. share: of what the arm weighs, where the efforts hold it; not_shown: its verdict.
    """

    PART = 0.25
    TIMES_NOISE = 10.0
    JOINTS = 0.6
    REMAINS = 0.03
    FEWEST = 300

    def __init__(self, robot: RobotModel, memory: float = 3000.0, rows: int | None = None) -> None:
        n = robot.n if rows is None else rows
        self._cure = IDENTIFY if rows in (None, robot.n) else _LOOK
        self._names = robot.joint_names[:n]
        self._weak = 0.005 * np.where(np.isfinite(robot.effort_limit), robot.effort_limit, 50.0)[:n]
        self.memory = memory
        self._torque = np.zeros(n)
        self._unexplained = np.zeros(n)
        self._count = 0
        self.ready = False
        self.part: FloatArray = np.zeros(n)

    def add(self, torque: FloatArray, Y: FloatArray, y: FloatArray, theta: FloatArray) -> None:
        """Take in measured torque, shape (n,), and the first columns of the equation ``y = Y theta`` with their parameters, those
        of the payload, after the low-pass [N m]."""
        self._count += 1
        self.ready = self._count >= self.FEWEST
        rate = max(1.0 / self._count, 1.0 / self.memory)
        n = self._torque.size
        self._torque += rate * (torque[:n] ** 2 - self._torque)
        self._unexplained += rate * ((y[:n] - Y[:n, : theta.size] @ theta) ** 2 - self._unexplained)

    def verdict(self, noise: FloatArray, residual: FloatArray, floor: FloatArray) -> str:
        """A sentence that names the worst joints where the model is wrong, else an empty string.

        Args:
            noise: long-run variance of the residual, a joint, shape (n,). residual: its variance, shape (n,) [(N m)^2].
            floor: what is known to be noise, as a long-run variance, shape (n,).
        """
        if not self.ready:
            return ""
        self.part = part = np.sqrt(self._unexplained / np.maximum(self._torque, self._weak**2))
        if float(part.sum()) < self.PART * part.size:
            return ""
        usual = float(np.quantile(np.sqrt(noise / floor), self.JOINTS))
        # noise that is slow is far above its white part too, but it is small beside the torque
        remains = float(np.sqrt(residual).sum() / np.sqrt(np.maximum(self._torque, self._weak**2)).sum())
        if usual < self.TIMES_NOISE or remains < self.REMAINS:
            return ""
        worst = np.argsort(-np.sqrt(self._unexplained))[:3]
        listed = ", ".join(
            f"{self._names[i]} {np.sqrt(self._unexplained[i]):.2g} N m ({100 * part[i]:.0f} % of its torque)" for i in worst
        )
        times = f"{usual:.0f}" if usual < 1000.0 else "over a thousand"
        return (
            f"The residual is far above any noise that it could be ({times} times): rms {listed}. "
            "The robot's model does not explain these torques; the payload can't be trusted. " + self._cure
        )
