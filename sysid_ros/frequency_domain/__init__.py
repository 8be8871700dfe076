"""Checks of a model in the frequency domain: the band in which it holds, what it misses beyond, and whether that is linear."""

from sysid_ros.frequency_domain.check import check_frequency
from sysid_ros.frequency_domain.result import FrequencyCheck, JointCheck, Response

__all__ = ["FrequencyCheck", "JointCheck", "Response", "check_frequency"]
