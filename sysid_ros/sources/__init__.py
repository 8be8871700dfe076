"""Where joint states come from and go to: bags, tables, memory."""

from sysid_ros.sources.bag import BagSource
from sysid_ros.sources.bag_recorder import BagRecorder
from sysid_ros.sources.floating_bag import FloatingBagSource
from sysid_ros.sources.opened import open_source
from sysid_ros.sources.robot_of_source import robot_of_source
from sysid_ros.sources.source import MemorySource, Source, urdf_text
from sysid_ros.sources.table import TableSource
from sysid_ros.sources.temperatures import temperatures

__all__ = [
    "BagRecorder",
    "BagSource",
    "FloatingBagSource",
    "MemorySource",
    "Source",
    "TableSource",
    "open_source",
    "robot_of_source",
    "temperatures",
    "urdf_text",
]
