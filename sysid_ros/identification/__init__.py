"""Identification of the arm's own dynamics from recorded motion, off line."""

from sysid_ros.identification.base_parameters import BaseParameters
from sysid_ros.identification.identify import Identification, free_model, identify
from sysid_ros.identification.rows import BagRows, collect_rows

__all__ = ["BagRows", "BaseParameters", "Identification", "collect_rows", "free_model", "identify"]
