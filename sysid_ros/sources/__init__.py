"""Where joint states come from and go to: bags, memory."""

from sysid_ros.sources.bag import BagSource
from sysid_ros.sources.bag_recorder import BagRecorder
from sysid_ros.sources.floating_bag import FloatingBagSource
from sysid_ros.sources.source import MemorySource, Source, urdf_text
from sysid_ros.sources.temperatures import temperatures

__all__ = ["BagRecorder", "BagSource", "FloatingBagSource", "MemorySource", "Source", "temperatures", "urdf_text"]
