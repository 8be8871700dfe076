"""What the launch files open to look at: RViz, Foxglove's bridge, PlotJuggler, with the layouts of ``config/``."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sysid_ros.exceptions import SysidError

ARGUMENTS = {
    "rviz": ("false", "open RViz with config/payload.rviz"),
    "plotjuggler": ("false", "open PlotJuggler with config/payload.plotjuggler.xml"),
    "foxglove": ("false", "start foxglove_bridge and say where the layout config/payload.foxglove.json is"),
    "fixed_frame": ("", "of RViz; empty: the root of the URDF where it is known here, else base_link"),
}
_NODES = ("online_payload_estimator", "adaptive_controller")


@dataclass(frozen=True, slots=True)
class Program:
    """A program of another package, as it is to be started; ``config`` is a YAML file of parameters, ``note`` is told in the
    log."""

    package: str
    executable: str
    namespace: str = ""
    arguments: list[str] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    config: str = ""
    note: str = ""


def viewers(wanted: Mapping[str, bool], values: Mapping[str, str], config: Path, simulated: bool) -> list[Program]:
    """The programs to start.

    Args:
        wanted: which of 'rviz', 'plotjuggler', 'foxglove'. values: of all launch arguments. config: folder of the layouts.
        simulated: whether the simulated arm is started too. It has no robot_state_publisher of its own, so one is started for
            those who draw the robot; a real robot has one.

    Raises:
        SysidError: the URDF can't be read.
    """
    namespace, urdf, found = values["namespace"], _urdf(values["urdf_path"], simulated), []
    if simulated and (wanted["rviz"] or wanted["foxglove"]):
        found.append(
            Program("robot_state_publisher", "robot_state_publisher", namespace, [], {"robot_description": _urdf("", True)})
        )
    if wanted["rviz"]:
        frame = values["fixed_frame"] or root_link(urdf) or "base_link"
        found.append(Program("rviz2", "rviz2", namespace, ["-d", str(config / "payload.rviz"), "-f", frame]))
    if wanted["plotjuggler"]:
        layout = moved(config / "payload.plotjuggler.xml", namespace)
        found.append(Program("plotjuggler", "plotjuggler", "", ["--layout", str(layout)]))
    if wanted["foxglove"]:
        layout = moved(config / "payload.foxglove.json", namespace)
        note = f"Foxglove: open the connection ws://localhost:8765 and import the layout {layout}"
        found.append(Program("foxglove_bridge", "foxglove_bridge", "", note=note))
    return found


def moved(layout: Path, namespace: str) -> Path:
    """The layout with its topics in a namespace: the file itself where there is none, else a copy in the folder for temporary
    files."""
    name = namespace.strip("/")
    if not name:
        return layout
    text = layout.read_text(encoding="utf-8")
    for topic in (*_NODES, "robot_description"):
        text = text.replace(f'"/{topic}', f'"/{name}/{topic}')
    copy = Path(tempfile.mkdtemp(prefix="sysid_ros_")) / layout.name
    copy.write_text(text, encoding="utf-8")
    return copy


def root_link(urdf: str) -> str:
    """Name of the link that no joint moves; empty where the text is no URDF."""
    try:
        root = ElementTree.fromstring(urdf)
    except ElementTree.ParseError:
        return ""
    children = {child.get("link") for child in root.iterfind("joint/child")}
    return next((name for link in root.iterfind("link") if (name := link.get("name", "")) not in children), "")


def read_urdf(path: str) -> str:
    """The URDF in a file, made from a xacro or MJCF where that is in it and this interpreter has what that needs.

    Raises:
        SysidError: it can't be read.
    """
    try:
        from sysid_ros.sources.source import urdf_text
    except ImportError:
        try:
            return Path(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise SysidError(f"'{path}' can't be read ({error}).") from None
    return urdf_text(path)


def _urdf(path: str, simulated: bool) -> str:
    if path:
        return read_urdf(path)
    if not simulated:
        return ""
    try:
        from sysid_ros.simulation.description import arm_description
    except ImportError:
        raise SysidError("the simulated arm needs pybullet: pip install 'sysid_ros[sim]'.") from None
    return arm_description()
