"""Tables of what each joint has, for simulators whose own file of the robot holds the links: CSV, and Isaac's parameters."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sysid_ros.files import whole, write_text
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.exported import COLUMNS, Holds, JointParameters, is_held, known_of, not_held
from sysid_ros.torque.model_file import ModelFile

_LINKS = (
    "Masses, centres of mass and inertias of the links are not in this table: import the robot from the URDF of 'sysid export'."
)
_VERSIONS = (
    "friction and dynamic_friction [N m, of slides N] are efforts since Isaac Sim 5.0; 4.5 takes friction for a coefficient "
    "without unit, and neither dynamic_friction nor viscous_friction: there set friction to 0 and put damping into the drive."
)
_DRIVE = "damping is viscous friction; the drive of an implicit actuator has a gain of the same name."


def export_table(robot: RobotModel, model: ModelFile, path: Path) -> list[str]:
    """Write a CSV: one row a joint, and in its last column what the table can't hold there; the same in words."""
    known = known_of(robot, model)
    holds = Holds.LINKS | Holds.ARMATURE | Holds.DAMPING | Holds.FRICTION | Holds.GAIN
    notes = [_LINKS, *not_held(known, "The table", holds)]
    lost = [k.effect for k in known.known if np.any(k.theta) and not is_held(k, holds)]
    with whole(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["joint", *COLUMNS, "not_held"])
        for joint, row in zip(robot.joint_names, JointParameters.of(known).rows(), strict=True):
            writer.writerow([joint, *map(repr, row), " ".join(["links", *(e.id for e in lost if joint in e.joint_names)])])
    return notes


def export_isaac(robot: RobotModel, model: ModelFile, path: Path) -> list[str]:
    """Write the parameters of Isaac's joints, as .yaml or .json; what they can't hold, in words."""
    document, notes = isaac(robot, model)
    if path.suffix == ".json":
        write_text(path, json.dumps(document, indent=2, allow_nan=False) + "\n")
    else:
        write_text(path, yaml.safe_dump(document, sort_keys=False, width=130))
    return notes


def isaac(robot: RobotModel, model: ModelFile) -> tuple[dict[str, Any], list[str]]:
    """``armature``, ``friction`` and ``damping`` of each joint, and notes about them.

    ``actuator_cfg`` holds the same under the names that the actuators of Isaac Lab take as keyword arguments, each a mapping of
    joints to values: ``ImplicitActuatorCfg(joint_names_expr=[".*"], stiffness=..., damping=..., **actuator_cfg)``.
    """
    known = known_of(robot, model)
    has = JointParameters.of(known)
    lost = not_held(known, "The table", Holds.LINKS | Holds.ARMATURE | Holds.DAMPING | Holds.FRICTION)
    columns = {name: dict(zip(robot.joint_names, getattr(has, name).tolist(), strict=True)) for name in COLUMNS}
    units = {"armature": "kg m^2", "friction": "N m", "damping": "N m s/rad"}
    document = {
        "robot": robot.name,
        "units": units,
        "not_held": [_LINKS, *lost],
        "notes": [_DRIVE, _VERSIONS],
        "joints": {joint: {name: columns[name][joint] for name in units} for joint in robot.joint_names},
        "actuator_cfg": {
            "armature": columns["armature"],
            "friction": columns["friction"],
            "dynamic_friction": dict(columns["friction"]),
            "viscous_friction": columns["damping"],
        },
    }
    return document, [_LINKS, _DRIVE, *lost]
