"""model.yaml: the known effects of a robot with their parameters, written by identification and read by everything else."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sysid_ros.effects import EFFECTS, TRUNK_EFFECTS, named
from sysid_ros.exceptions import ModelFileError, SysidError, in_a_line
from sysid_ros.files import write_text
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.torque.known_effect import KnownEffect

FORMAT = 1
_LONG = 80
"""Letters of a value that are told."""
_ROUNDING = 1e-6
"""Of a symmetric matrix, as part of its largest entry."""


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
        effects: its known effects. source: the file that it was read from, for messages.
        torque_std: what the model leaves unexplained below ``cutoff_hz``, a joint, shape (n,) [N m].
        correlation_time: for how long that error keeps its sign, a joint, shape (n,) [s]; twice the product with the variance
            is its spectral density at zero frequency.
        uncertainty: directions of the error of all parameters together, shape (number of parameters, c), or None; their product
            with itself transposed is the covariance as far as it makes torque.
        provenance: bags, command, version it came from.
    """

    robot_name: str
    joints: tuple[str, ...]
    urdf_sha256: str
    effects: tuple[EffectBlock, ...]
    torque_std: FloatArray
    correlation_time: FloatArray
    uncertainty: FloatArray | None = None
    provenance: dict[str, Any] = field(default_factory=dict)
    source: str = "the model"

    def known_effects(self, robot: RobotModel) -> list[KnownEffect]:
        """The effects for a robot.

        Raises:
            ModelFileError: the file belongs to a robot with other joints, or an effect in it is not known here.
        """
        if set(self.joints) != set(robot.joint_names):
            raise ModelFileError(
                f"{self.source} was made for joints {', '.join(self.joints)}; the robot at hand has "
                f"{', '.join(robot.joint_names)}. Run 'sysid identify' with this robot's URDF and bags."
            )
        return [self._known(block, robot) for block in self.effects]

    def on_legs(self, robot: RobotModel) -> tuple[list[KnownEffect], FloatArray | None, TrunkSetup, TrunkSetup]:
        """The effects for a robot on its floating base that are torques, directions of their error, and what is known of IMU and
        feet with its standard deviations.

        Raises:
            ModelFileError: as of :meth:`known_effects`.
        """
        torques: list[KnownEffect] = []
        rows: list[int] = []
        setup, std, start = TrunkSetup(), TrunkSetup(), 0
        for k in self.known_effects(robot):
            said = k.effect.as_setup(k.theta)
            if said is None:
                torques.append(k)
                rows += range(start, start + k.effect.p)
            else:
                variance = np.zeros(k.effect.p) if k.covariance is None else np.diag(k.covariance)
                setup, std = setup + said, std + (k.effect.as_setup(np.sqrt(np.maximum(variance, 0.0))) or TrunkSetup())
            start += k.effect.p
        return torques, None if self.uncertainty is None else self.uncertainty[rows], setup, std

    def _known(self, block: EffectBlock, robot: RobotModel) -> KnownEffect:
        kind = named(block.effect)
        if kind is None:
            raise ModelFileError(
                f"{self.source} names an unknown effect '{block.effect}'. {_nearest(block.effect)}Correct it, or write the "
                "file again with 'sysid identify'."
            )
        try:
            effect = kind.from_settings(robot, block.joints, block.settings)
        except (TypeError, ValueError) as error:
            reason = in_a_line(error).rpartition("__init__() ")[2]
            raise ModelFileError(
                f"{self.source}: the settings of effect '{block.effect}' are {_shown(block.settings)}: {reason}. Correct "
                "them, or write the file again with 'sysid identify'."
            ) from None
        except SysidError as error:
            raise ModelFileError(f"{self.source}: {error}") from None
        if effect.parameter_names != block.names:
            raise ModelFileError(
                f"{self.source}: effect '{block.effect}' has parameters {', '.join(block.names)}, but the URDF's are "
                f"{', '.join(effect.parameter_names)}. Use the URDF that the model was identified with."
            )
        return KnownEffect(effect, block.theta, block.covariance)

    def error_density(self, robot: RobotModel) -> FloatArray:
        """Spectral density of what the model leaves unexplained, in the robot's joint order, shape (n,) [(N m)^2 s]."""
        density = dict(zip(self.joints, 2.0 * self.torque_std**2 * self.correlation_time, strict=True))
        return np.array([density[name] for name in robot.joint_names])

    def notes(self, urdf: str) -> list[str]:
        """What a user should know before using the model with this URDF, one sentence each."""
        notes = []
        if self.urdf_sha256 and urdf_digest(urdf) != self.urdf_sha256:
            notes.append(
                "The URDF is not the one that the model was identified with; its link inertials are replaced by the model's."
            )
        for block in self.effects:
            if block.settings.get("over") == "temperature":
                notes.append(
                    f"The model's friction of {', '.join(block.joints)} follows the temperature; where none is recorded it is "
                    f"that at {block.settings.get('reference', 25.0):g} degrees Celsius."
                )
        return notes

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
            "uncertainty": None if self.uncertainty is None else {"directions": self.uncertainty.tolist()},
            "provenance": self.provenance,
        }
        write_text(path, yaml.dump(document, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=130))

    @classmethod
    def read(cls, path: Path) -> ModelFile:
        """Read and check a file.

        Raises:
            ModelFileError: it can't be read, is not a model.yaml, or holds arrays that don't fit.
        """
        try:
            text = path.read_text()
        except (OSError, UnicodeDecodeError) as error:
            why = f"can't be read: {error.strerror}" if isinstance(error, OSError) else f"is not YAML: {in_a_line(error)}"
            raise ModelFileError(f"{path} {why}. Give the model.yaml that 'sysid identify' wrote.") from None
        return cls.of_text(text, str(path))

    @classmethod
    def of_text(cls, text: str, path: str) -> ModelFile:
        """Read and check a file's text; ``path`` is what messages call it.

        Raises:
            ModelFileError: as of :meth:`read`.
        """
        try:
            document = yaml.load(text, Loader=_Loader)
        except yaml.YAMLError as error:
            said = f"{path} is not YAML: {in_a_line(error)}. Give the model.yaml that 'sysid identify' wrote."
            raise ModelFileError(said) from None
        if not isinstance(document, dict) or "format" not in document:
            raise ModelFileError(f"{path} is no model: it states no format. Give the model.yaml that 'sysid identify' wrote.")
        if document["format"] != FORMAT:
            said = f"{path} has format {document['format']}; this version reads format {FORMAT}. "
            raise ModelFileError(f"{said}Write it again with 'sysid identify'.")
        try:
            return cls._from_document(document, path)
        except (KeyError, TypeError, ValueError) as error:
            reason = f"it lacks {error}" if isinstance(error, KeyError) else error
            raise ModelFileError(f"{path} is damaged: {reason}. Write it again with 'sysid identify'.") from None

    @classmethod
    def _from_document(cls, document: dict[str, Any], source: str) -> ModelFile:
        robot, noise = _mapping(document["robot"], "robot"), _mapping(document.get("noise"), "noise")
        joints = _strings(robot["joints"], "robot.joints")
        nothing = [0.0] * len(joints)
        if not isinstance(document["effects"], list):
            raise ValueError(f"effects is {_shown(document['effects'])}, not a list")
        effects = tuple(_block(_mapping(entry, "an effect")) for entry in document["effects"])
        return cls(
            robot_name=str(robot["name"]),
            joints=joints,
            urdf_sha256=str(robot.get("urdf_sha256", "")),
            effects=effects,
            torque_std=_numbers(noise.get("torque_std", nothing), "noise.torque_std", (len(joints),), 0.0),
            correlation_time=_numbers(noise.get("correlation_time", nothing), "noise.correlation_time", (len(joints),), 0.0),
            uncertainty=_uncertainty(_mapping(document.get("uncertainty"), "uncertainty"), sum(b.theta.size for b in effects)),
            provenance=_mapping(document.get("provenance"), "provenance"),
            source=source,
        )


def _uncertainty(entry: dict[str, Any], count: int) -> FloatArray | None:
    if not entry:
        return None
    directions = np.asarray(entry["directions"], dtype=float)
    if directions.ndim != 2 or len(directions) != count or not np.isfinite(directions).all():
        raise ValueError(f"uncertainty.directions needs {count} rows of as many finite numbers each")
    return directions


def _block(entry: dict[str, Any]) -> EffectBlock:
    where = f"effect '{entry['effect']}'"
    names = _strings(entry["names"], f"names of {where}")
    count = len(names)
    covariance = entry.get("covariance")
    return EffectBlock(
        effect=str(entry["effect"]),
        joints=_strings(entry["joints"], f"joints of {where}"),
        settings=_mapping(entry.get("settings"), f"settings of {where}"),
        theta=_numbers(entry["theta"], f"theta of {where}", (count,)),
        names=names,
        units=_strings(entry["units"], f"units of {where}"),
        covariance=None if covariance is None else _covariance(covariance, where, count),
    )


def _mapping(value: Any, what: str) -> dict[str, Any]:
    if value is not None and not isinstance(value, dict):
        raise ValueError(f"{what} is {_shown(value)}, not a mapping of names to values")
    return dict(value or {})


def _strings(value: Any, what: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(x, str) for x in value):
        raise ValueError(f"{what} is {_shown(value)}, not a list of names")
    return tuple(value)


def _covariance(value: Any, where: str, count: int) -> FloatArray:
    """Symmetric, and negative in no direction but by rounding."""
    matrix = _numbers(value, f"covariance of {where}", (count, count))
    largest = float(np.abs(matrix).max(initial=0.0))
    if np.abs(matrix - matrix.T).max(initial=0.0) > _ROUNDING * largest or np.any(np.diag(matrix) < 0.0):
        raise ValueError(f"covariance of {where} is none: it must be symmetric, with variances of 0 or more")
    return matrix


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _LONG else f"{text[:_LONG]}..."


def _nearest(effect: str) -> str:
    near = get_close_matches(effect, {**EFFECTS, **TRUNK_EFFECTS}, 1)
    return f"Is '{near[0]}' meant? " if near else ""


def _numbers(value: Any, what: str, shape: tuple[int, ...], least: float = -np.inf) -> FloatArray:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != shape or not np.isfinite(array).all() or np.any(array < least):
        needed = " x ".join(map(str, shape)) + " finite numbers" + (f" of {least:g} or more" if least > -np.inf else "")
        raise ValueError(f"{what} is {_shown(value)}; it needs {needed}")
    return array


_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
