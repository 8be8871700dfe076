"""What every robot has that nothing is wrong with: a little of much, on all joints, as the causes say of themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid_ros.simulation.hidden_effects import CAUSES, Circumstances, HiddenCause, HiddenEffect, cause_of


def as_built(usual: Circumstances) -> tuple[HiddenEffect, ...]:
    """All that is a little wrong, each cause on the joints it says; of causes of which a joint has one, one a joint."""
    out, words = [], {cause.either for cause in CAUSES.values() if cause.either}
    choice = {word: usual.rng.uniform(size=usual.robot.n) for word in sorted(words)}
    for cause in CAUSES.values():
        for effect in cause.as_built(usual):
            if cause.either:
                same = [id_ for id_, other in CAUSES.items() if other.either == cause.either]
                mine = np.floor(choice[cause.either] * len(same)) == same.index(cause.id)
                effect = on_joints(effect, [j for j, own in zip(usual.robot.joint_names, mine, strict=True) if own])
            out.append(effect)
    return tuple(e for e in out if e.joints)


def without(built: Sequence[HiddenEffect], larger: Sequence[HiddenEffect]) -> tuple[HiddenEffect, ...]:
    """What a robot as built has, less what a larger cause stands in place of."""
    out = []
    for effect in built:
        one = cause_of(effect.id)
        taken = {j for e in larger if _in_place(cause_of(e.id), one) for j in e.joints}
        if kept := [j for j in effect.joints if j not in taken]:
            out.append(on_joints(effect, kept))
    return tuple(out)


def _in_place(larger: HiddenCause, built: HiddenCause) -> bool:
    if larger.dry or built.dry:
        return larger.dry and built.dry
    return larger.id == built.id or (larger.family != "" and larger.family == built.family)


def on_joints(effect: HiddenEffect, joints: Sequence[str]) -> HiddenEffect:
    """The same effect on some of its joints."""
    if set(joints) == set(effect.joints):
        return effect
    kept = [j in joints for j in effect.joints]
    settings = {
        name: [x for x, own in zip(value, kept, strict=True) if own] if np.size(value) == len(kept) else value
        for name, value in effect.settings.items()
    }
    parameters = tuple(p for p in effect.parameters if p.joint in joints)
    return replace(effect, joints=tuple(j for j in effect.joints if j in joints), parameters=parameters, settings=settings)
