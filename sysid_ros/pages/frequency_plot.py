"""write_frequency_plot: Bode diagrams of a check, as a file."""

from __future__ import annotations

from pathlib import Path

from sysid_ros.exceptions import DataError
from sysid_ros.frequency import FrequencyCheck
from sysid_ros.pages.frequency_curves import shown
from sysid_ros.pages.payload_plot import PAGE_SUFFIXES, check_plot_path


def write_frequency_plot(path: Path, result: FrequencyCheck, title: str) -> None:
    """Write the response of each joint with its 95 % region, the cause that was found, and the coherence.

    Args:
        path: .png, .svg or .pdf for a report; .html for a page that holds all it needs.
        result: of :func:`sysid_ros.frequency.check_frequency`. title: of the figure.

    Raises:
        SettingsError: the suffix is not known, or the folder is not there. DataError: no joint has a response.
    """
    check_plot_path(path)
    if not shown(result):
        raise DataError("There is no response to plot: no joint moves enough in these recordings.")
    # each drawing library takes a part of a second to import, and one is enough
    if path.suffix.lower() in PAGE_SUFFIXES:
        from sysid_ros.pages.frequency_page import frequency_page

        path.write_text(frequency_page(result, title), encoding="utf-8")
    else:
        from sysid_ros.pages.frequency_figure import frequency_figure

        frequency_figure(result, title).savefig(path, dpi=150)
