"""Diagnosis: what a robot's model gets wrong, why, and what the fix gains."""

from sysid_ros.diagnosis.diagnose import diagnose
from sysid_ros.diagnosis.legs.on_legs import diagnose_on_legs
from sysid_ros.diagnosis.result import Diagnosis, Finding
from sysid_ros.effects import Parameter

__all__ = ["Diagnosis", "Finding", "Parameter", "diagnose", "diagnose_on_legs"]
