"""Identification of the arm's own dynamics from recorded motion, off line."""

from sysid_ros.identification.free_effects import free_model
from sysid_ros.identification.from_recordings import identify_recordings
from sysid_ros.identification.identify import Choices, identify
from sysid_ros.identification.result import Identification
from sysid_ros.identification.rows import BagRows, collect_rows
from sysid_ros.signals.recording import Recording
from sysid_ros.torque.base_parameters import BaseParameters

__all__ = [
    "BagRows",
    "BaseParameters",
    "Choices",
    "Identification",
    "Recording",
    "collect_rows",
    "free_model",
    "identify",
    "identify_recordings",
]
