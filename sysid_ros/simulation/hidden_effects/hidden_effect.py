"""HiddenEffect: what a simulated robot has and its URDF lacks, as plain values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class TrueParameter:
    """One number (or vector) that a diagnosis should find.

    Attributes:
        name: as in ``diagnosis.json``. joint: its joint; None where it belongs to the whole arm.
        value: a number, three numbers or a joint's name. unit: SI.
    """

    name: str
    joint: str | None
    value: float | tuple[float, ...] | str
    unit: str


@dataclass(frozen=True, slots=True)
class HiddenEffect:
    """One cause by its id, where it acts and how large it is.

    Attributes:
        id: as in ``diagnosis.json``.
        joints: where it acts, base to tip; every joint for what belongs to the whole arm.
        parameters: what a diagnosis should find.
        kind: which of the effect's forms it is, where it has several.
        settings: what the simulation needs beside the parameters (a ripple's phase, a motor's inertia), per joint or for all.
    """

    id: str
    joints: tuple[str, ...]
    parameters: tuple[TrueParameter, ...]
    kind: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)

    def vector(self, name: str) -> FloatArray:
        """A parameter that belongs to the whole arm, shape (k,)."""
        value = next(p.value for p in self.parameters if p.name == name)
        return np.atleast_1d(np.asarray(value, dtype=float))

    def number(self, name: str) -> float:
        """A single parameter that belongs to the whole arm."""
        return float(self.vector(name)[0])

    def per_joint(self, name: str) -> dict[str, float]:
        """A parameter by joint, or a setting of which there is one a joint."""
        if name in self.settings:
            return dict(zip(self.joints, np.atleast_1d(self.settings[name]).tolist(), strict=True))
        return {p.joint: float(p.value) for p in self.parameters if p.name == name and p.joint is not None}  # type: ignore[arg-type]

    def as_dict(self) -> dict[str, Any]:
        """In plain types, for the truth file."""
        values = [
            {"name": p.name, "joint": p.joint, "value": list(p.value) if isinstance(p.value, tuple) else p.value, "unit": p.unit}
            for p in self.parameters
        ]
        plain = {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in self.settings.items()}
        return {"name": self.id, "joints": list(self.joints), "kind": self.kind, "parameters": values, "settings": plain}
