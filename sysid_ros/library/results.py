"""Results of the verbs: each prints itself in a few lines, writes a report, saves itself, draws itself."""

from __future__ import annotations

import io
from abc import ABC, abstractmethod
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.console import Console

from sysid_ros.cli.output import write_json
from sysid_ros.exceptions import SettingsError
from sysid_ros.files import whole, write_text
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.library.paths import with_suffix
from sysid_ros.pages.page import FIGURE_SUFFIXES
from sysid_ros.robot.robot_model import RobotModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

    from sysid_ros.diagnosis import Diagnosis
    from sysid_ros.excitation.excite import Excitation
    from sysid_ros.frequency_domain import FrequencyCheck
    from sysid_ros.identification import Identification
    from sysid_ros.online.replay import Replay
    from sysid_ros.pages.figure import Figure

_LINES = 10
_WIDTH = 100


class Result(ABC):
    """What a verb found.

    Args:
        details: everything that was found; its attributes are this object's too.
        robot: the model that it was found with. origin: what it comes from, written beside it.
    """

    details: Any
    saves: ClassVar[tuple[str, ...]] = (".json",)
    """Suffixes of what :meth:`save` writes."""

    def __init__(self, details: Any, robot: RobotModel, origin: dict[str, Any]) -> None:
        self.details, self.robot, self.origin = details, robot, origin

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "details":
            raise AttributeError(name)
        return getattr(self.details, name)

    @abstractmethod
    def show(self, console: Console) -> None:
        """Print all of it, as the command does."""

    @abstractmethod
    def as_dict(self) -> dict[str, Any]:
        """All of it in plain types; what is not known is None."""

    @abstractmethod
    def figure(self) -> Figure:
        """The figure of it."""

    def report(self, path: str | Path) -> Path:
        """Write the page for people, one .html file; where it is done."""
        self._write_report(path := with_suffix(path, (".html",)))
        return path

    def save(self, path: str | Path) -> Path:
        """Write it for machines; the suffix says what."""
        self._write(path := with_suffix(path, self.saves))
        return path

    def plot(self, path: str | Path | None = None) -> Drawing:
        """The figure, for matplotlib; written to .png, .svg or .pdf where a path is given."""
        from sysid_ros.pages.matplotlib_renderer import drawn

        drawing = drawn(self.figure())
        if path is not None:
            target = with_suffix(path, FIGURE_SUFFIXES)
            with whole(target) as beside:
                drawing.savefig(beside, dpi=150, format=target.suffix[1:])
        return drawing

    @abstractmethod
    def _write_report(self, path: Path) -> None:
        """The page, for a path that was checked."""

    def _write(self, path: Path) -> None:
        write_json(path, self.as_dict())

    @property
    def _urdf(self) -> Path | None:
        """The robot's file, where there is one."""
        return Path(given) if isinstance(given := self.origin.get("urdf"), str) else None

    @property
    def _units(self) -> tuple[str, ...]:
        return tuple("N" if slides else "N m" for slides in self.robot.is_prismatic)

    def _text(self) -> str:
        console = Console(width=_WIDTH, record=True, file=io.StringIO(), highlight=False)
        self.show(console)
        return "\n".join(line.rstrip() for line in console.export_text().splitlines() if line.strip())

    def __repr__(self) -> str:
        lines = self._text().splitlines()
        more = [f"... {len(lines) - _LINES + 1} more lines: print(result)"] if len(lines) > _LINES else []
        return "\n".join(lines[: _LINES - len(more)] + more)

    def __str__(self) -> str:
        return self._text()

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self._text())}</pre>"


class Replayed(Result):
    """What was carried, see :class:`.Replay`: ``payloads``, ``events``, ``series``, ``final``, ``status``."""

    details: Replay
    saves = (".json", ".csv")

    def show(self, console: Console) -> None:
        from sysid_ros.cli.replay_tables import show_replay

        show_replay(self.details, self.origin["bags"][0], console)

    def as_dict(self) -> dict[str, Any]:
        from sysid_ros.online.replay import as_json

        return as_json(self.details)

    def _write(self, path: Path) -> None:
        from sysid_ros.online.carried import write_carried

        if path.suffix == ".csv":
            write_carried(path, self.details.payloads)
        else:
            super()._write(path)

    def figure(self) -> Figure:
        from sysid_ros.pages.payload_figure import payload_figure

        r = self.details
        return payload_figure(r.series, r.events, self.robot.joint_names, self._units, "Payload", (), r.payloads)

    def _write_report(self, path: Path) -> None:
        from sysid_ros.pages import write_replay

        write_replay(path, self.details, self.robot, f"Payload in {self.origin['bags'][0]}", self._urdf)


class Identified(Result):
    """The arm's own dynamics, see :class:`.Identification`: ``parameters``, ``model``, ``errors``, ``validation``."""

    details: Identification
    saves = (".yaml", ".json", ".urdf", ".xml")

    def show(self, console: Console) -> None:
        from sysid_ros.cli.identify_tables import show

        show(self.details, console)

    def as_dict(self) -> dict[str, Any]:
        from sysid_ros.cli.identify_tables import as_json

        return as_json(self.details)

    def _write(self, path: Path) -> None:
        if path.suffix == ".yaml":
            self.details.model.write(path)
        elif path.suffix == ".urdf":
            from sysid_ros.torque.urdf_export import export_urdf

            export_urdf(self.robot, self.details.model, path)
        elif path.suffix == ".xml":
            from sysid_ros.torque.mjcf_export import export_mjcf

            export_mjcf(self.robot, self.details.model, path)
        else:
            super()._write(path)

    def figure(self) -> Figure:
        from sysid_ros.pages.identification_figures import torque_figure

        return torque_figure(self.details.series[-1], self.details.joint_names, self._units)

    def _write_report(self, path: Path) -> None:
        from sysid_ros.pages.identification_page import write_report

        write_report(path, self.details, self.origin, self.robot, self._urdf)


class Diagnosed(Result):
    """What the model gets wrong, see :class:`.Diagnosis`: ``verdict``, ``causes``, ``data_faults``, ``model``."""

    details: Diagnosis
    saves = (".json", ".yaml", "")

    def show(self, console: Console) -> None:
        from sysid_ros.cli.diagnose_output import show

        show(self.details, console)

    def as_dict(self) -> dict[str, Any]:
        return self.details.as_dict()

    def _write(self, path: Path) -> None:
        if path.suffix == ".yaml":
            if self.details.model is None:
                raise SettingsError(f"There is no model to write to '{path}': the verdict is {self.details.verdict}.")
            self.details.model.write(path)
        elif path.suffix == "":
            from sysid_ros.cli.diagnose_output import write_files

            base = FloatingBase(self.robot) if self.details.units else None
            write_files(self.details, base.robot if base else self.robot, path, self.origin, urdf=self._urdf, base=base)
        else:
            super()._write(path)

    def figure(self) -> Figure:
        from sysid_ros.pages.diagnosis_figures import torque_figure

        if self.details.predictions is None:
            raise SettingsError(f"There is nothing to draw: the verdict is {self.details.verdict}.")
        return torque_figure(self.details.predictions, self.details.units or self._units)

    def _write_report(self, path: Path) -> None:
        from sysid_ros.pages.diagnosis_page import diagnosis_page

        write_text(path, diagnosis_page(self.details, self.robot.name, self.origin, self.robot, self._urdf))


class Excited(Result):
    """A motion, see :class:`.Excitation`: ``trajectory``, ``criteria``, ``use``."""

    details: Excitation
    saves = (".yaml", ".json")

    def show(self, console: Console) -> None:
        from sysid_ros.cli.excite_report import show

        show(self.details, console)

    def as_dict(self) -> dict[str, Any]:
        from sysid_ros.cli.excite_report import as_json

        return as_json(self.details, self.origin["settings"])

    def _write(self, path: Path) -> None:
        from sysid_ros.sources.joint_trajectory import JointTrajectory

        if path.suffix != ".yaml":
            super()._write(path)
            return
        t = self.details.trajectory.grid(0.01)
        message = JointTrajectory(self.robot.joint_names, t, *self.details.trajectory.sample(t))
        write_text(path, message.yaml(f"Exciting motion of {self.robot.name}."))

    def figure(self) -> Figure:
        from sysid_ros.pages.excitation_figure import excitation_figure

        return excitation_figure(self.details, f"Exciting motion of {self.robot.name}")

    def _write_report(self, path: Path) -> None:
        from sysid_ros.pages.excitation_figure import write_excitation

        write_excitation(path, self.details, f"Exciting motion of {self.robot.name}", self._urdf)


class Checked(Result):
    """Up to what frequency a model holds, see :class:`.FrequencyCheck`: ``joints``, ``modes``, ``sentences``."""

    details: FrequencyCheck

    def show(self, console: Console) -> None:
        from sysid_ros.cli.frequency import show

        show(self.details, console)

    def as_dict(self) -> dict[str, Any]:
        return self.details.as_dict()

    def figure(self) -> Figure:
        from sysid_ros.pages.frequency_figure import frequency_figure

        return frequency_figure(self.details, self._title)

    @property
    def _title(self) -> str:
        return f"Measured torque over that of {self.robot.name}"

    def _write_report(self, path: Path) -> None:
        from sysid_ros.pages.frequency_figure import write_frequency_plot

        write_frequency_plot(path, self.details, self._title, self.robot, self._urdf)
