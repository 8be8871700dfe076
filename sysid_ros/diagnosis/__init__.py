"""Diagnosis: what a robot's model gets wrong, why, and what the fix gains."""

from sysid_ros.diagnosis.diagnose import diagnose
from sysid_ros.diagnosis.messages import read_messages
from sysid_ros.diagnosis.missing_joints import missing_joints
from sysid_ros.diagnosis.result import Diagnosis, Finding, Parameter
from sysid_ros.diagnosis.temperature import with_temperatures
from sysid_ros.signals.recording import Recording

__all__ = [
    "Diagnosis",
    "Finding",
    "Parameter",
    "Recording",
    "diagnose",
    "missing_joints",
    "read_messages",
    "with_temperatures",
]
