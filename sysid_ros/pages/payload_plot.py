"""write_payload_plot: the figure of an estimation, as a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.pages.truth import TruthSegment

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
PAGE_SUFFIXES = (".html", ".htm")


def check_plot_path(path: Path) -> None:
    """Fails early where a figure can't be written to ``path``.

    Raises:
        SettingsError: its suffix is not known, or its folder is not there.
    """
    if path.suffix.lower() not in FIGURE_SUFFIXES + PAGE_SUFFIXES:
        raise SettingsError(
            f"The plot '{path}' ends in '{path.suffix}'; it must end in {', '.join(FIGURE_SUFFIXES + PAGE_SUFFIXES[:1])}. "
            "Choose .png for a report, .html to zoom in a browser."
        )
    if not path.parent.is_dir():
        raise SettingsError(f"The folder of the plot '{path}' does not exist. Create it: mkdir -p '{path.parent}'.")


def write_payload_plot(
    path: Path,
    series: Sequence[PayloadEstimate],
    events: Sequence[PayloadEvent],
    joint_names: Sequence[str],
    title: str,
    truth: Sequence[TruthSegment] | None = None,
    effort_units: Sequence[str] | None = None,
) -> None:
    """Write mass, centre of mass, inertia with their 95 % bands, status, events and residual torques over time.

    Args:
        path: .png, .svg or .pdf for a report; .html for a page that holds all it needs.
        series: estimates in the order of time.
        events: picks, drops and other changes.
        joint_names: n names, the order of the residuals.
        title: of the figure.
        truth: what was really carried, where that is known.
        effort_units: unit of each joint's residual, "N m" where it is left out.

    Raises:
        SettingsError: the suffix is not known, or the folder is not there.
        DataError: the series is empty, or its residuals belong to another number of joints.
    """
    check_plot_path(path)
    if not series:
        raise DataError("There is no estimate to plot. Give data that yield one: some seconds in which the joints move.")
    n = series[0].residual.size
    units = tuple(effort_units) if effort_units is not None else ("N m",) * n
    if len(joint_names) != n or len(units) != n:
        raise DataError(
            f"The estimates have residuals of {n} joints; {len(joint_names)} names and {len(units)} units were given. Give {n}."
        )
    # each drawing library takes a part of a second to import, and one is enough
    if path.suffix.lower() in PAGE_SUFFIXES:
        from sysid_ros.pages.payload_page import payload_page

        path.write_text(payload_page(series, events, joint_names, units, title, truth or ()), encoding="utf-8")
    else:
        from sysid_ros.pages.payload_figure import payload_figure

        figure = payload_figure(series, events, joint_names, units, title, truth or ())
        figure.savefig(path, dpi=150)
