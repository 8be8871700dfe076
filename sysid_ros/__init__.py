"""Payload and dynamics of a robot from what it measures: estimated live, replayed from a bag, identified offline.

Every torque has a cause, and a cause is an effect: some columns ``Y`` and some parameters ``theta``,

    tau_measured(t) = sum_k Y_k(q, v, a) theta_k + noise.

The jobs of the package differ only in which effects are known and which are free. Import from its modules, for instance
``from sysid_ros.robot.robot_model import RobotModel``: this file imports nothing, so that commands start quickly.
"""

__version__ = "0.1.0"

__all__ = ["__version__"]
