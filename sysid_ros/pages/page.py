"""Pages: every HTML file comes from one family of templates, is escaped by it, and holds all that it needs."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sysid_ros.exceptions import SettingsError
from sysid_ros.files import whole, write_text
from sysid_ros.pages.figure import Figure, legends
from sysid_ros.pages.plotly_renderer import specification
from sysid_ros.pages.robot_view import View, scene

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
PAGE_SUFFIXES = (".html", ".htm")
RECORDING_SUFFIX = ".rrd"
"""Of a recording of Rerun."""
VIEW_SUFFIXES = (*PAGE_SUFFIXES, RECORDING_SUFFIX)
"""Of what also shows the robot."""
TEMPLATES = Path(__file__).parent / "templates"


def check_plot_path(path: Path) -> None:
    """Fails early where a figure can't be written to ``path``.

    Raises:
        SettingsError: its suffix is not known, or its folder is not there.
    """
    if path.suffix.lower() not in FIGURE_SUFFIXES + VIEW_SUFFIXES:
        raise SettingsError(
            f"The plot '{path}' ends in '{path.suffix}'; it must end in {', '.join((*FIGURE_SUFFIXES, '.html', '.rrd'))}. "
            "Choose .png for a report, .html to zoom in a browser, .rrd for Rerun."
        )
    if path.suffix.lower() == RECORDING_SUFFIX:
        from sysid_ros.pages.rerun_renderer import rerun

        rerun()
    if not path.parent.is_dir():
        raise SettingsError(f"The folder of the plot '{path}' does not exist. Create it: mkdir -p '{path.parent}'.")


def check_plot_paths(plot: Path | None, rerun: Path | None) -> None:
    """As :func:`check_plot_path`, of a figure and of a recording of Rerun, where they are asked for."""
    for path in (plot, rerun):
        if path is not None:
            check_plot_path(path)
    if rerun is not None and rerun.suffix != RECORDING_SUFFIX:
        raise SettingsError(f"The recording '{rerun}' ends in '{rerun.suffix}'; one of Rerun ends in {RECORDING_SUFFIX}.")


def write_plot(path: Path, figure: Figure, template: str = "figure.html", view: View | None = None, **words: object) -> None:
    """Write a figure as a picture, or as a page by a template with what else it tells, or as a recording of Rerun.

    Args:
        path: .png, .svg or .pdf for a report; .html for a page that holds all it needs; .rrd for Rerun.
        template: of the page; it gets ``figure``, ``view`` and ``words``. view: of the robot.

    Raises:
        SettingsError: the suffix is not known, or the folder is not there; Rerun is not installed.
    """
    check_plot_path(path)
    if path.suffix.lower() in PAGE_SUFFIXES:
        write_text(path, page(template, figure=figure, view=view, **words))
    elif path.suffix.lower() == RECORDING_SUFFIX:
        from sysid_ros.pages.rerun_renderer import write_recording

        write_recording(path, [figure], view)
    else:
        # takes a part of a second to import
        from sysid_ros.pages.matplotlib_renderer import drawn

        with whole(path) as beside:
            drawn(figure).savefig(beside, dpi=150, format=path.suffix[1:].lower())


def page(template: str, **words: object) -> str:
    """HTML of a page; what it is given is text, and is escaped."""
    return _environment().get_template(template).render(library=library, **words)


def number(value: float | None, digits: int = 3) -> str:
    """A number for people; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "∞" if value == math.inf else "–"
    return f"{value:.{digits}g}".replace("e-0", "e-").replace("e+0", "e")


@cache
def library(name: str) -> str:
    """A drawing library that pages hold, "plotly" or "three", as it is kept beside the templates with its licence."""
    return (TEMPLATES / f"{name}.min.js").read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    environment.filters |= {
        "number": number,
        "specification": specification,
        "legends": legends,
        "scene": scene,
        "unit": lambda unit: unit.replace("^2", "²"),
        "file_name": lambda path: Path(path).name,
    }
    return environment
