"""Where the URDF comes from: a file, else the bag."""

from __future__ import annotations

from pathlib import Path

from sysid_ros.exceptions import RobotModelError
from sysid_ros.sources.source import Source


def urdf_text(urdf_path: str | Path | None, source: Source | None = None) -> str:
    """The URDF's text from ``urdf_path``, else from the ``/robot_description`` that was recorded with the data.

    Raises:
        RobotModelError: there is no such file, it is not text, or neither of the two gives a URDF.
    """
    if urdf_path is None or str(urdf_path) == "":
        if source is not None and (text := source.robot_description) is not None:
            return text
        where = "no URDF file is given" if source is None else "no URDF file is given and the data hold no /robot_description"
        raise RobotModelError(f"{where}. Give the robot's URDF with --urdf FILE, or record /robot_description with the bag.")
    path = Path(urdf_path)
    if path.is_dir():
        raise RobotModelError(f"URDF '{path}' is a folder. Give the .urdf file itself.")
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise RobotModelError(f"URDF '{path}' does not exist. Give the path of the robot's .urdf file.") from None
    except (OSError, UnicodeDecodeError) as error:
        raise RobotModelError(
            f"URDF '{path}' can't be read as text: {error}. Give the path of the robot's .urdf file."
        ) from error
    if "<xacro:" in text or path.suffix == ".xacro":
        raise RobotModelError(f"URDF '{path}' is a xacro file. Expand it first: xacro {path.name} > robot.urdf")
    return text
