"""``sysid export``: an identified model for simulators."""

from __future__ import annotations

import csv
from pathlib import Path

import click
import numpy as np
from rich.table import Table

from sysid_ros.cli import options as opt
from sysid_ros.cli.output import ManyValues, check_outputs, note, report, table
from sysid_ros.exceptions import SettingsError
from sysid_ros.files import whole
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import urdf_text
from sysid_ros.torque.mjcf_export import export_mjcf
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.torque_model import TorqueModel
from sysid_ros.torque.urdf_export import export_urdf

_COLUMNS = ("armature", "damping", "friction", "torque_gain")
_UNITS = ("kg m²", "N m s/rad", "N m", "")


@click.command(cls=ManyValues)
@click.argument("model_path", type=opt.PATH, metavar="MODEL")
@opt.path("--urdf", required=True, help="The robot that MODEL belongs to: URDF or MJCF.")
@opt.path("--out", "outs", multiple=True, metavar="FILE...", help="To write: .xml (MuJoCo), .urdf, .csv (joints).")
@opt.FORCE
def command(model_path: Path, urdf: Path, outs: tuple[Path, ...], force: bool) -> None:
    """Write MODEL, a model.yaml of 'sysid identify' or 'sysid diagnose', for a simulator, and show what each joint has.

    An .xml makes MuJoCo's torques equal to those of MODEL: links, armature, damping, frictionloss, gear, delay. A .urdf holds
    links, damping and friction, as Gazebo, PyBullet and Drake read them. A .csv has one row a joint: armature (Drake: rotor
    inertia with a gear ratio of 1; Isaac: armature), viscous damping, Coulomb friction, and the gain of the measured effort.
    What a file can't hold is said.

    \b
    Example:
      sysid export model.yaml --urdf arm.urdf --out arm.xml arm_identified.urdf joints.csv

    Exit codes: 0 done; 2 bad input or usage.
    """
    writers = {".xml": export_mjcf, ".urdf": export_urdf, ".csv": _export_table}
    for path in outs:
        if path.suffix not in writers:
            raise SettingsError(f"'{path}' ends in '{path.suffix}'; the suffix must be one of {', '.join(writers)}.")
    check_outputs(force, out=outs)
    model = ModelFile.read(model_path)
    robot = RobotModel.from_urdf(urdf_text(urdf), model.joints)
    for sentence in (*robot.notes, *model.notes(robot.urdf)):
        note(sentence)
    report().print(_shown(robot, model))
    for path in outs:
        for sentence in writers[path.suffix](robot, model, path):
            note(sentence)
        note(f"Written to {path}.")


def _rows(robot: RobotModel, model: ModelFile) -> list[list[float]]:
    known = TorqueModel(robot, [], model.known_effects(robot))
    gain = np.prod([k.effect.as_gain(k.theta) for k in known.known], axis=0, initial=1.0) * np.ones(robot.n)
    columns = [np.broadcast_to(x, (robot.n,)) for x in (known.armature(), known.damping(), known.dry_friction(), gain)]
    rows: list[list[float]] = np.column_stack(columns).tolist()
    return rows


def _shown(robot: RobotModel, model: ModelFile) -> Table:
    out = table(f"Joints of {robot.name}", "joint", *(f"{name}\n{unit}" for name, unit in zip(_COLUMNS, _UNITS, strict=True)))
    for joint, row in zip(robot.joint_names, _rows(robot, model), strict=True):
        out.add_row(joint, *(f"{x:.4g}" for x in row))
    return out


def _export_table(robot: RobotModel, model: ModelFile, path: Path) -> list[str]:
    with whole(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["joint", *_COLUMNS])
        writer.writerows([joint, *map(repr, row)] for joint, row in zip(robot.joint_names, _rows(robot, model), strict=True))
    return []
