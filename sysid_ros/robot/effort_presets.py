"""What the drivers of some arms publish as effort, in N m a unit, joint by joint. Used only where it is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray


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


def _read() -> dict[str, EffortPreset]:
    document = yaml.safe_load((Path(__file__).parent / "effort_presets.yaml").read_text(encoding="utf-8"))
    return {
        name: EffortPreset(tuple(x["joints"]), tuple(map(float, x["scale"])), x["what"], x["unit"], x["source"])
        for name, x in document.items()
    }


PRESETS = _read()
"""By the arm's name, from effort_presets.yaml."""


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
