"""model.yaml: the known effects of a robot with their parameters, written by identification and read by everything else."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sysid_ros.effects import EFFECTS
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque_model import KnownEffect

FORMAT = 1


def urdf_digest(urdf: str) -> str:
    """SHA-256 of a URDF's text, hexadecimal."""
    return hashlib.sha256(urdf.encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class EffectBlock:
    """One effect as it stands in the file: plain types, arrays of shape (p,) and (p, p)."""

    effect: str
    joints: tuple[str, ...]
    settings: dict[str, Any]
    theta: FloatArray
    names: tuple[str, ...]
    units: tuple[str, ...]
    covariance: FloatArray | None


@dataclass(frozen=True, slots=True)
class ModelFile:
    """Content of a model.yaml (format 1).

    Attributes:
        robot_name, joints, urdf_sha256: the robot that the parameters belong to.
        effects: its known effects.
        torque_std: what the model leaves unexplained below ``cutoff_hz``, a joint, shape (n,) [N m].
        correlation_time: for how long that error keeps its sign, a joint, shape (n,) [s]; twice the product with the variance
            is its spectral density at zero frequency.
        provenance: bags, command and version it came from.
    """

    robot_name: str
    joints: tuple[str, ...]
    urdf_sha256: str
    effects: tuple[EffectBlock, ...]
    torque_std: FloatArray
    correlation_time: FloatArray
    provenance: dict[str, Any] = field(default_factory=dict)

    def known_effects(self, robot: RobotModel) -> list[KnownEffect]:
        """The effects for a robot.

        Raises:
            ModelFileError: the file belongs to a robot with other joints, or an effect in it is not known here.
        """
        if set(self.joints) != set(robot.joint_names):
            raise ModelFileError(
                f"the model was made for joints {', '.join(self.joints)}; the robot at hand has {', '.join(robot.joint_names)}. "
                "Run 'sysid identify' with this robot's URDF and bags."
            )
        known = []
        for block in self.effects:
            if block.effect not in EFFECTS:
                raise ModelFileError(
                    f"the model names an unknown effect '{block.effect}'; known are {', '.join(sorted(EFFECTS))}."
                )
            try:
                effect = EFFECTS[block.effect].from_settings(robot, block.joints, block.settings)
            except TypeError as error:
                raise ModelFileError(f"the settings of effect '{block.effect}' are {block.settings}: {error}.") from None
            if effect.parameter_names != block.names:
                raise ModelFileError(
                    f"effect '{block.effect}' has parameters {', '.join(block.names)} in the model, but the URDF's are "
                    f"{', '.join(effect.parameter_names)}. Use the URDF that the model was identified with."
                )
            known.append(KnownEffect(effect, block.theta, block.covariance))
        return known

    def notes(self, urdf: str) -> list[str]:
        """What a user should know before using the model with this URDF, one sentence each."""
        if self.urdf_sha256 and urdf_digest(urdf) != self.urdf_sha256:
            return ["The URDF is not the one that the model was identified with; its link inertials are replaced by the model's."]
        return []

    def write(self, path: Path) -> None:
        """Write the file, replacing one that is there."""
        document = {
            "format": FORMAT,
            "robot": {"name": self.robot_name, "joints": list(self.joints), "urdf_sha256": self.urdf_sha256},
            "effects": [
                {
                    "effect": b.effect,
                    "joints": list(b.joints),
                    "settings": b.settings,
                    "theta": b.theta.tolist(),
                    "names": list(b.names),
                    "units": list(b.units),
                    "covariance": None if b.covariance is None else b.covariance.tolist(),
                }
                for b in self.effects
            ],
            "noise": {"torque_std": self.torque_std.tolist(), "correlation_time": self.correlation_time.tolist()},
            "provenance": self.provenance,
        }
        path.write_text(yaml.dump(document, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=130))

    @classmethod
    def read(cls, path: Path) -> ModelFile:
        """Read and check a file.

        Raises:
            ModelFileError: it can't be read, is not a model.yaml, or holds arrays that don't fit.
        """
        try:
            document = yaml.load(path.read_text(), Loader=_Loader)
        except OSError as error:
            raise ModelFileError(
                f"{path} can't be read: {error.strerror}. Give the model.yaml that 'sysid identify' wrote."
            ) from None
        except yaml.YAMLError as error:
            raise ModelFileError(f"{path} is not YAML: {error}.") from None
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            found = document.get("format") if isinstance(document, dict) else None
            raise ModelFileError(
                f"{path} has format {found}; this version reads format {FORMAT}. Give a model.yaml of 'sysid identify'."
            )
        try:
            joints = tuple(document["robot"]["joints"])
            noise = document.get("noise") or {}
            std = np.asarray(noise.get("torque_std", [0.0] * len(joints)), dtype=float)
            time = np.asarray(noise.get("correlation_time", [0.0] * len(joints)), dtype=float)
            file = cls(
                robot_name=document["robot"]["name"],
                joints=joints,
                urdf_sha256=document["robot"].get("urdf_sha256", ""),
                effects=tuple(_block(b) for b in document["effects"]),
                torque_std=std,
                correlation_time=time,
                provenance=document.get("provenance") or {},
            )
        except (KeyError, TypeError, ValueError) as error:
            raise ModelFileError(f"{path} is damaged: {error!r}. Write it again with 'sysid identify'.") from None
        if std.shape != (len(joints),) or time.shape != (len(joints),) or not np.all(np.isfinite(std)) or np.any(std < 0):
            raise ModelFileError(f"{path}: noise.torque_std is {std.tolist()}; it needs {len(joints)} values of 0 or more.")
        return file


def _block(entry: dict[str, Any]) -> EffectBlock:
    theta = np.asarray(entry["theta"], dtype=float)
    covariance = None if entry.get("covariance") is None else np.asarray(entry["covariance"], dtype=float)
    if not np.all(np.isfinite(theta)) or (covariance is not None and covariance.shape != (theta.size, theta.size)):
        raise ValueError(f"effect '{entry['effect']}' has theta or covariance of the wrong shape, or not finite")
    return EffectBlock(
        effect=entry["effect"],
        joints=tuple(entry["joints"]),
        settings=dict(entry.get("settings") or {}),
        theta=theta,
        names=tuple(entry["names"]),
        units=tuple(entry["units"]),
        covariance=covariance,
    )


_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
