"""What exports to simulators share: which parts of a model a format has a place for, and sentences about the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import Flag, auto

import numpy as np

from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.torque_model import TorqueModel

_NEGLIGIBLE = 1e-9
"""Mass [kg] and inertia [kg m^2] of a moving body without any."""
_ROUNDING = 1e-6


class Holds(Flag):
    """Parts of a model that a format can have a place for."""

    LINKS = auto()
    ARMATURE = auto()
    DAMPING = auto()
    FRICTION = auto()
    GAIN = auto()
    DELAY = auto()
    GRAVITY = auto()


@dataclass(frozen=True, slots=True, eq=False)
class JointParameters:
    """What each joint has, in the robot's order, shape (n,) each, none of the first three below zero.

    Attributes:
        armature: inertia of the motor at the joint [kg m^2]. damping: viscous friction [N m s/rad]. friction: level of the dry
            friction [N m]; of a slide [kg], [N s/m] and [N]. torque_gain: measured effort / torque.
    """

    armature: FloatArray
    damping: FloatArray
    friction: FloatArray
    torque_gain: FloatArray

    @classmethod
    def of(cls, known: TorqueModel) -> JointParameters:
        """Of all that is known of a robot's torques."""
        gain = np.prod([k.effect.as_gain(k.theta) for k in known.known], axis=0, initial=1.0) * np.ones(known.robot.n)
        armature, damping, friction = known.armature(), known.damping(), known.dry_friction()
        return cls(np.maximum(armature, 0.0), np.maximum(damping, 0.0), np.maximum(friction, 0.0), gain)

    def rows(self) -> list[list[float]]:
        """One row a joint, columns as :data:`COLUMNS`."""
        rows: list[list[float]] = np.column_stack([getattr(self, name) for name in COLUMNS]).tolist()
        return rows


COLUMNS = tuple(f.name for f in fields(JointParameters))
UNITS = ("kg m²", "N m s/rad", "N m", "")


def known_of(robot: RobotModel, model: ModelFile) -> TorqueModel:
    """All that a model.yaml knows of a robot's torques."""
    return TorqueModel(robot, [], model.known_effects(robot))


def require_bodies(known: TorqueModel, source: str) -> None:
    """Check that each moving link is a body that can exist, or nothing.

    Raises:
        ModelFileError: one is not.
    """
    for name, theta in zip(known.robot.body_names, known.links().reshape(-1, 10), strict=True):
        moments = np.linalg.eigvalsh(body(theta)[2])
        if theta[0] < 0.0 or moments[0] < 0.0 or moments[2] > (1.0 + _ROUNDING) * (moments[0] + moments[1]):
            raise ModelFileError(
                f"the inertials of link '{name}' in {source} belong to no body (mass {theta[0]:.3g} kg), and simulators "
                "take bodies only. Identify with physical consistency."
            )


def body(theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Mass, centre of mass (3,) and inertia about it (3, 3); next to nothing in place of nothing, which simulators don't take."""
    mass, com, inertia = inertial_parameters.to_com(theta)
    if not mass > _NEGLIGIBLE:
        return mass if mass < 0.0 else _NEGLIGIBLE, np.zeros(3), _NEGLIGIBLE * np.eye(3)
    return mass, com, inertia + _NEGLIGIBLE * np.eye(3) if abs(np.linalg.eigvalsh(inertia)[0]) < _NEGLIGIBLE else inertia


def not_held(known: TorqueModel, what: str, holds: Holds) -> list[str]:
    """What a file of some format does not hold of a model, or holds otherwise, one sentence each.

    Args:
        what: the file in words, as a sentence begins with it. holds: the parts that it has a place for.
    """
    sentences = []
    lost = [k for k in known.known if np.any(k.theta) and not is_held(k, holds)]
    if lost:
        sentences.append(f"{what} can't hold {', '.join(dict.fromkeys(k.effect.id for k in lost))}; model.yaml does.")
    levels = dict.fromkeys(k.effect.id for k in lost if np.any(k.effect.as_dry_friction(k.theta)))
    if levels and Holds.FRICTION in holds:
        sentences.append(f"{what} holds of {', '.join(levels)} the level Fc alone.")
    if Holds.ARMATURE not in holds and np.any(known.robot.model.armature):
        sentences.append(f"{what} can't hold the armature that the robot's description states.")
    below = (
        (Holds.ARMATURE, "Armature", known.armature()),
        (Holds.DAMPING, "Damping", known.damping()),
        (Holds.FRICTION, "Friction", known.dry_friction()),
    )
    for part, word, values in below:
        names = [f"{name} ({x:.3g})" for name, x in zip(known.robot.joint_names, values, strict=True) if x < 0.0]
        if names and part in holds:
            sentences.append(f"{word} below zero is no {word.lower()}; the file has 0 for {', '.join(names)}.")
    return sentences


def comment(sentences: Sequence[str]) -> str:
    """Sentences as the text of a comment in XML, which must not hold two hyphens in a row."""
    return f" {' '.join(sentences).replace('--', '- -')} "


def words(values: FloatArray | list[float]) -> str:
    """Numbers with all their digits, as XML has them."""
    return " ".join(repr(float(x)) for x in values)


def is_held(known: KnownEffect, holds: Holds) -> bool:
    """Whether a file with places for these parts holds all of an effect."""
    effect, theta = known.effect, known.theta
    parts = {
        Holds.LINKS: effect.as_links(theta),
        Holds.ARMATURE: effect.as_armature(theta),
        Holds.DAMPING: effect.as_damping(theta),
        Holds.FRICTION: effect.as_dry_friction(theta),
        Holds.GAIN: effect.as_gain(theta) - 1.0,
        Holds.DELAY: np.array(effect.as_delay(theta)),
        Holds.GRAVITY: effect.as_gravity(theta),
    }
    needed = [part for part, values in parts.items() if np.any(values)]
    beside = any(part in (Holds.ARMATURE, Holds.GAIN, Holds.DELAY, Holds.GRAVITY) for part in needed)
    return (effect.in_urdf or beside) and all(part in holds for part in needed)
