"""Figures of what was estimated, for a report (PNG, SVG, PDF) or to look around in (HTML)."""

from sysid_ros.pages.page import check_plot_path, check_plot_paths, write_plot
from sysid_ros.pages.payload_curves import TruthSegment
from sysid_ros.pages.payload_figure import write_payload_plot, write_replay

__all__ = ["TruthSegment", "check_plot_path", "check_plot_paths", "write_payload_plot", "write_plot", "write_replay"]
