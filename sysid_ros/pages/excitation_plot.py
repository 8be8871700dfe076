"""write_excitation_plot: the figure of an exciting motion, as a file."""

from __future__ import annotations

from pathlib import Path

from sysid_ros.excitation.excite import Excitation
from sysid_ros.pages.payload_plot import PAGE_SUFFIXES, check_plot_path


def write_excitation_plot(path: Path, excitation: Excitation, title: str) -> None:
    """Write the motion, what it uses of its limits, and its criteria beside those of random motions.

    Args:
        path: .png, .svg or .pdf for a report; .html for a page that holds all it needs.
        excitation: the motion. title: of the figure.

    Raises:
        SettingsError: the suffix is not known, or the folder is not there.
    """
    check_plot_path(path)
    # each drawing library takes a part of a second to import, and one is enough
    if path.suffix.lower() in PAGE_SUFFIXES:
        from sysid_ros.pages.excitation_page import excitation_page

        path.write_text(excitation_page(excitation, title), encoding="utf-8")
    else:
        from sysid_ros.pages.excitation_figure import excitation_figure

        excitation_figure(excitation, title).savefig(path, dpi=150)
