"""Robots that hide something their URDF lacks: every effect of a diagnosis, from its own equation, with the truth beside it."""

from sysid_ros.simulation.hidden_effects.catalogue import DRAWS, OUTSIDE
from sysid_ros.simulation.hidden_effects.circumstances import Circumstances, torque_scale
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect, TrueParameter
from sysid_ros.simulation.hidden_effects.motion import DiagnosisMotion
from sysid_ros.simulation.hidden_effects.run import HiddenRecording, move, publish, stiffening_for, truth_of
from sysid_ros.simulation.hidden_effects.sensor_noise import Noise
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot
from sysid_ros.simulation.hidden_effects.visibility import nominal_residual, shown, shown_as_itself

__all__ = [
    "DRAWS",
    "OUTSIDE",
    "Circumstances",
    "DiagnosisMotion",
    "HiddenEffect",
    "HiddenRecording",
    "Noise",
    "TrueParameter",
    "TrueRobot",
    "move",
    "nominal_residual",
    "publish",
    "shown",
    "shown_as_itself",
    "stiffening_for",
    "torque_scale",
    "truth_of",
]
