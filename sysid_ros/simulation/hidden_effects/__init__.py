"""Robots that hide something their URDF lacks: one cause a file, with all that the simulation and the exam know of it, and the
physics that moves the robot that has it."""

from sysid_ros.simulation.hidden_effects.catalogue import cause_of, hideable, realise
from sysid_ros.simulation.hidden_effects.cause import CAUSES, HiddenCause, register_hidden
from sysid_ros.simulation.hidden_effects.circumstances import Circumstances, torque_scale
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect, TrueParameter
from sysid_ros.simulation.hidden_effects.motion import DiagnosisMotion, PlannedMotion
from sysid_ros.simulation.hidden_effects.run import HiddenRecording, move, publish, stiffening_for, truth_of
from sysid_ros.simulation.hidden_effects.sensor_noise import Noise
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot
from sysid_ros.simulation.hidden_effects.visibility import nominal_residual, shown, shown_as_itself

__all__ = [
    "CAUSES",
    "Circumstances",
    "DiagnosisMotion",
    "HiddenCause",
    "HiddenEffect",
    "HiddenRecording",
    "Noise",
    "PlannedMotion",
    "TrueParameter",
    "TrueRobot",
    "cause_of",
    "hideable",
    "move",
    "nominal_residual",
    "publish",
    "realise",
    "register_hidden",
    "shown",
    "shown_as_itself",
    "stiffening_for",
    "torque_scale",
    "truth_of",
]
