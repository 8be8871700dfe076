"""What several commands read: bags with their robot, and the configuration file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import yaml

from sysid_ros import __version__
from sysid_ros.cli.output import command_line, note
from sysid_ros.exceptions import RobotModelError, SettingsError, in_a_line
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import BagSource, TableSource, open_source, robot_of_source, urdf_text
from sysid_ros.sources.columns import read_columns


def provenance(bags: Sequence[Path], **others: Path | Sequence[Path] | str | None) -> dict[str, object]:
    """What a result comes from, to be written beside it; others where they are given."""
    given = {name: value for name, value in {"bags": bags, **others}.items() if value is not None}
    words = {name: str(value) if isinstance(value, str | Path) else [str(x) for x in value] for name, value in given.items()}
    return {**words, "command": command_line(), "version": __version__}


def open_bag(
    path: Path, topic: str, urdf: Path | None, settings: OnlineSettings, columns: Path | None = None
) -> tuple[BagSource | TableSource, RobotModel]:
    """A bag or a table, and the model of the joints that it names; what the user should know of either goes to stderr."""
    source = open_source(path, topic, read_columns(columns) if columns else None)
    source, robot = robot_of_source(source, urdf_text(urdf, source), settings)
    for sentence in (*source.notes, *robot.notes):
        note(sentence)
    return source, robot


def require_same_robot(path: Path, own: RobotModel, first: RobotModel) -> None:
    """Check that a bag has the joints of the first one.

    Raises:
        RobotModelError: it has others.
    """
    if own.joint_names != first.joint_names:
        raise RobotModelError(
            f"bag '{path}' has joints {', '.join(own.joint_names)}, the first bag has {', '.join(first.joint_names)}. "
            "Use bags of the same robot."
        )


def read_config(path: Path | None) -> dict[str, Any]:
    """The parameters in a ROS 2 parameter file, or in a plain mapping of names to values.

    Raises:
        SettingsError: the file can't be read, or is no mapping.
    """
    if path is None:
        return {}
    try:
        document = yaml.safe_load(path.read_text())
    except OSError as error:
        raise SettingsError(f"configuration '{path}' can't be read: {error.strerror}.") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise SettingsError(f"configuration '{path}' is not YAML: {in_a_line(error)}.") from None
    found: dict[str, Any] = {}
    for node in _parameter_blocks(document):
        found.update(node)
    if not isinstance(document, dict) or (not found and "ros__parameters" in str(document)):
        raise SettingsError(
            f"configuration '{path}' holds no parameters. See config/online_payload_estimator.yaml for an example."
        )
    return found or document


def settings_from(parameters: dict[str, Any], **overrides: Any) -> OnlineSettings:
    """Settings from a node's parameters; those that only a running node has are passed over, and named on stderr.

    Raises:
        SettingsError: a value is not allowed.
    """
    known = {f.name for f in fields(OnlineSettings)}
    others = sorted(set(parameters) - known - {"urdf_path", "model_path"})
    if others:
        note(f"Not used here: {', '.join(others)}.")
    values = {name: value for name, value in parameters.items() if name in known}
    values.update({name: value for name, value in overrides.items() if value})
    return OnlineSettings.from_mapping(values, "configuration")


def _parameter_blocks(document: Any) -> list[dict[str, Any]]:
    if not isinstance(document, dict):
        return []
    blocks = []
    for name, value in document.items():
        if name == "ros__parameters" and isinstance(value, dict):
            blocks.append(value)
        else:
            blocks += _parameter_blocks(value)
    return blocks
