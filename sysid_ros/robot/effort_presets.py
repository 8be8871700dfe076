"""What the drivers of some arms publish as effort, in N m a unit, joint by joint. Used only where it is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray

_UR = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")


@dataclass(frozen=True, slots=True)
class EffortPreset:
    """Factors from effort to torque at the joint.

    Attributes:
        joints: ends of their names; a prefix may stand before them. scale: of each [N m a unit].
        what: the efforts are. unit: of the efforts. source: where the factors are from.
    """

    joints: tuple[str, ...]
    scale: tuple[float, ...]
    what: str
    unit: str
    source: str

    def of(self, joint_names: Sequence[str]) -> FloatArray | None:
        """Factors in the order of a robot's joints, shape (n,); None where a joint is not one of these."""
        pairs = list(zip(self.joints, self.scale, strict=True))
        found = [next((x for end, x in pairs if name.endswith(end)), np.nan) for name in joint_names]
        return None if np.isnan(found).any() else np.array(found)


PRESETS: dict[str, EffortPreset] = {
    "ur5": EffortPreset(
        _UR,
        (13.635, 13.746, 13.686, 9.666, 8.737, 9.019),
        "motor currents",
        "A",
        "torque constants of table 1 in Raviola, Guida, De Martin, Pastorelli, Mauro, Sorli 2021, Robotics 10(3), 83, times the "
        "gear ratio of 101",
    ),
    "ur10": EffortPreset(
        _UR,
        (14.87, 13.26, 11.13, 10.62, 11.03, 11.47),
        "motor currents",
        "A",
        "drive gains of a UR10 in Gaz, Magrini, De Luca 2018, Mechatronics 55, 234-247",
    ),
    "ur10e": EffortPreset(
        _UR,
        (11.72, 11.99, 9.82, 10.67, 10.40, 10.69),
        "motor currents",
        "A",
        "identified on one UR10e with a load of 2.805 kg, by the method of Mamedov, Mikhel 2020, Frontiers in Robotics and AI 7, "
        "571574",
    ),
}
"""By the arm's name."""


def preset(name: str) -> EffortPreset:
    """A preset by its name.

    Raises:
        SettingsError: there is none of that name.
    """
    if name not in PRESETS:
        raise SettingsError(f"effort_preset is {name!r}; there are {', '.join(PRESETS)}. For another arm set effort_scale.")
    return PRESETS[name]


def said(name: str) -> tuple[str, ...]:
    """What a preset takes the efforts for, with its source, in a sentence; none without a preset."""
    if not name:
        return ()
    one = preset(name)
    factors = ", ".join(f"{x:g}" for x in one.scale)
    return (f"Efforts are taken as {one.what}: {factors} N m per {one.unit} of {', '.join(one.joints)} ({name}: {one.source}).",)


def offer(joint_names: Sequence[str]) -> str:
    """Which presets there are for an arm with such joints, to be said where its efforts look like another quantity."""
    names = [name for name, one in PRESETS.items() if one.of(joint_names) is not None]
    return f" For arms with such joints there are presets: effort_preset (--effort-preset) {', '.join(names)}." if names else ""
