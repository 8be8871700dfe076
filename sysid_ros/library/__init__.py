"""What ``import sysid_ros`` offers: recordings, robots, and the verbs of the commands, whose results print themselves."""

from sysid_ros.library.recording import Recording, load
from sysid_ros.library.results import Checked, Diagnosed, Excited, Identified, Replayed
from sysid_ros.library.robot import Robot
from sysid_ros.library.verbs import diagnose, excite, frequency, identify, replay

__all__ = [
    "Checked",
    "Diagnosed",
    "Excited",
    "Identified",
    "Recording",
    "Replayed",
    "Robot",
    "diagnose",
    "excite",
    "frequency",
    "identify",
    "load",
    "replay",
]
