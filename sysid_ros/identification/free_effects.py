"""Which effects of an arm are free: those that are usual on real arms, and others that are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.effects import (
    EFFECTS,
    AccelerometerBias,
    Depends,
    Effect,
    FootRadius,
    ImuDelay,
    ImuLever,
    ImuTilt,
    Knob,
)
from sysid_ros.exceptions import SettingsError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.identification.tolerances import TOL
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.shown_gravity import ShownGravity
from sysid_ros.torque.torque_model import TorqueModel


def usual_effects() -> list[type[Effect]]:
    """Every registered effect that is usual on a real arm, of each family its most usual form, as they were registered."""
    best: dict[str, type[Effect]] = {}
    for effect in EFFECTS.values():
        key = effect.family or effect.id
        if effect.usual >= TOL.usual and (key not in best or effect.usual > best[key].usual):
            best[key] = effect
    return [effect for effect in EFFECTS.values() if effect in best.values()]


def free_model(robot: RobotModel, chosen: Sequence[Effect] = ()) -> TorqueModel:
    """What is usual on an arm, all free: links, friction, rotors, offsets.

    Args:
        chosen: other effects. One of the family of a usual effect stands in its place on its joints.
    """
    free: list[Effect] = []
    for usual in usual_effects():
        forms = [e for e in chosen if usual.family and e.family == usual.family]
        taken = {name for e in forms for name in e.joint_names}
        left = [name for name in robot.joint_names if name not in taken]
        free += [usual(robot, left), *forms] if left else forms
    return TorqueModel(robot, [*free, *(e for e in chosen if e not in free)])


def free_model_on_legs(base: FloatingBase, shown: ShownGravity | None = None, sensors: bool = True) -> TorqueModel:
    """What is usual on a robot on legs, all free: trunk and links of the legs, friction, rotors and offsets of their joints, and
    what is not known of IMU and feet.

    Args:
        shown: what the accelerometer shows beside its motion, which tells its bias from a mass.
        sensors: False leaves out IMU and feet.
    """
    robot, legs = base.robot, base.legs.joint_names
    heavy = [name for name, pi in zip(robot.joint_names, robot.pi.reshape(-1, 10), strict=True) if np.any(pi)]
    free = [usual(robot, heavy if usual.replaces_links else legs) for usual in usual_effects()]
    if not sensors:
        return TorqueModel(robot, free)
    feet, bias = FootRadius(robot, feet=base.contact_frames), AccelerometerBias(robot)
    feet.unsure = np.where(base.radius_told, feet.unsure, base.radius_std)
    if shown is not None:
        bias.see_gravity(shown)
    return TorqueModel(robot, [*free, ImuTilt(robot), ImuLever(robot), ImuDelay(robot), bias, feet])


def add_effects(chosen: Sequence[Effect], added: Sequence[Effect]) -> list[Effect]:
    """The chosen effects with others, which on their joints take the place of those of their family."""
    kept: list[Effect] = []
    for effect in chosen:
        taken = {name for e in added if e.family and e.family == effect.family for name in e.joint_names}
        left = [name for name in effect.joint_names if name not in taken]
        if left and taken:
            kept.append(type(effect).from_settings(effect.robot, left, effect.settings))
        elif left:
            kept.append(effect)
    return [*kept, *added]


def own_knobs(effect: type[Effect]) -> tuple[Knob, ...]:
    """The knobs to search for: those that the usual form of the family has too, such as the width of a sign, keep their value."""
    common = {knob.name for usual in usual_effects() if usual.family and usual.family == effect.family for knob in usual.knobs}
    return tuple(knob for knob in effect.knobs if knob.name not in common)


def places(effect: type[Effect], robot: RobotModel) -> list[tuple[str, ...]]:
    """Where an effect is there or not: each joint, or the whole arm (no joint) where its parameters belong to none."""
    whole = effect(robot).p
    each: list[tuple[str, ...]] = [(name,) for name in robot.joint_names]
    return each if sum(effect(robot, joint).p for joint in each) == whole else [()]


def frictions() -> dict[str, type[Effect]]:
    """The forms of dry friction by the words that the command knows them by, the usual one first."""
    usual = [effect for effect in usual_effects() if effect.jumps and effect.family]
    families = [effect.family for effect in usual]
    others = [e for e in EFFECTS.values() if e.family in families and Depends.TIME not in e.depends_on and e not in usual]
    return {effect.id.removesuffix("_friction"): effect for effect in (*usual, *others)}


@dataclass(frozen=True, slots=True)
class Wish:
    """An effect that is asked for; ``everywhere`` without a question whether it predicts better."""

    effect: type[Effect]
    everywhere: bool = False


def wishes(friction: str, effects: Sequence[str]) -> list[Wish]:
    """The effects that may be free beside the usual ones, or in place of one of their family.

    Args:
        friction: "auto" for the more usual alternatives to the usual dry friction where they predict better, or a word of
            :func:`frictions`: a form with knobs where it predicts better, one without on every joint. effects: ids.

    Raises:
        SettingsError: there is no such effect, it is free anyway, or it says nothing beyond a recording.
    """
    usual, forms = usual_effects(), frictions()
    if friction == "auto":
        likely = [e for e in forms.values() if e not in usual and e.usual >= TOL.alternative]
        out = [Wish(effect) for effect in likely]
    elif friction in forms:
        form = forms[friction]
        out = [] if form in usual else [Wish(form, everywhere=not own_knobs(form))]
    else:
        raise SettingsError(f"friction is '{friction}'; it must be one of auto, {', '.join(forms)}.")
    for name in effects:
        if name not in EFFECTS:
            raise SettingsError(f"there is no effect '{name}'; known are {', '.join(sorted(EFFECTS))}.")
        effect = EFFECTS[name]
        if effect in usual or effect.replaces_links:
            raise SettingsError(f"the effect '{name}' is usual on an arm and free anyway. Leave it out.")
        if Depends.TIME in effect.depends_on:
            raise SettingsError(
                f"the effect '{name}' follows the time since a recording began, and says nothing of another one. Ask 'sysid "
                "diagnose' for it."
            )
        out.append(Wish(effect))
    return out


def is_body(effect: Effect) -> bool:
    """Whether it is made of masses that stay what they are from run to run: links, rotors."""
    return effect.replaces_links or bool(np.any(effect.as_armature(np.ones(effect.p))))


def is_friction(effect: Effect) -> bool:
    """Whether it is friction: something that jumps at a reversal, or a damping."""
    return effect.jumps or bool(np.any(effect.as_damping(np.ones(effect.p))))


def place_of(parameter: str) -> str:
    """What a parameter belongs to by its name, ``Fc[elbow]``: a joint, a link; empty where it is the whole arm's."""
    return parameter[parameter.index("[") + 1 : -1] if parameter.endswith("]") else ""
