"""Diagnosis: what was found, and as the document that machines read."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sysid_ros.effects import Parameter
from sysid_ros.sample import FloatArray
from sysid_ros.torque.model_file import ModelFile

__all__ = ["VERDICTS", "Diagnosis", "Finding", "Parameter", "Predictions", "SimulationError", "TorqueRmse"]

VERDICTS = ("explained", "partly_explained", "unexplained", "nothing_wrong", "refused")


@dataclass(frozen=True)
class Finding:
    """One effect that earned its place.

    Attributes:
        id, label: of the effect. joints: that it concerns. parameters: with their intervals.
        heldout_gain: part of the nominal residual's power that it removes on data that were not fitted; None for faults of the
            data, which have no share in a torque.
        delta_bic: of the fitted rows. p_value: corrected for the number of candidates; log10_p: its decimal logarithm, also where
            it is smaller than a number can be. None where they can't be measured.
        cannot_be_told_from: ids that explain these recordings as well. sentence: for an engineer.
        signature: what it looks like. separated_by: motion that tells it from its look-alikes.
        drift: of a friction that drifts, where a temperature is known: what it follows, and by which evidence.
        of_data: True for a fault of the channels or the messages.
    """

    id: str
    label: str
    joints: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    heldout_gain: float | None
    delta_bic: float | None
    p_value: float | None
    cannot_be_told_from: tuple[str, ...]
    sentence: str
    signature: str = ""
    separated_by: str = ""
    drift: dict[str, Any] | None = None
    log10_p: float | None = None
    of_data: bool = False

    def as_dict(self) -> dict[str, Any]:
        """As it stands in diagnosis.json."""
        return {
            "name": self.id,
            "joints": list(self.joints),
            "parameters": [p.as_dict() for p in self.parameters],
            "evidence": {
                "heldout_gain": self.heldout_gain,
                "delta_bic": self.delta_bic,
                "p_value": self.p_value,
                "log10_p_value": self.log10_p,
            },
            "cannot_be_told_from": list(self.cannot_be_told_from),
            "sentence": self.sentence,
            **({} if self.drift is None else {"drift": self.drift}),
        }


@dataclass(frozen=True)
class RankedUrdf:
    """One of several URDFs: its name and the probability that it is the robot's."""

    urdf: str
    probability: float


@dataclass(frozen=True)
class TorqueRmse:
    """Torque error on held-out data below the cut-off, a joint, shape (n,) each [N m]."""

    joints: tuple[str, ...]
    before: FloatArray
    after: FloatArray
    noise_floor: FloatArray
    torque: FloatArray


@dataclass(frozen=True)
class SimulationError:
    """Error of a forward simulation under the measured torques, over windows of ``horizon_s`` [s], [rad], [rad/s]."""

    horizon_s: float
    position_rmse_before: float
    position_rmse_after: float
    velocity_rmse_before: float
    velocity_rmse_after: float


@dataclass(frozen=True)
class Predictions:
    """Torques on the held-out data: t since the first stamp, shape (N,) [s]; torques of shape (N, n) [N m], and the motion;
    temperature of the joints [degrees Celsius], NaN where it is not known, None where none is."""

    t: FloatArray
    joints: tuple[str, ...]
    measured: FloatArray
    nominal: FloatArray
    extended: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray
    temperature: FloatArray | None = None


@dataclass(frozen=True)
class Diagnosis:
    """What is wrong with a model, and what the fix gains.

    Attributes:
        verdict: one of :data:`VERDICTS`. refusal: why, where it is "refused".
        findings: causes in order of gain, then the faults of the data. torque: error on held-out data.
        simulation: of a forward simulation, where it was run.
        unexplained_fraction: power above the noise that is left on held-out data, as a part of the nominal residual's.
        record_next: what to record next, one sentence each. notes: what the user should know, one sentence each.
        model: the extended model. urdf_model: what a URDF can hold of it. predictions: on the held-out data.
        temperature: how what is left goes with the temperature of each joint, where one is known.
        urdfs: of several URDFs that were given, each with the probability that it is the robot's; the likeliest was diagnosed.
        driven: the same before the faults of units, signs and order are put back: torques that can drive a simulation.
    """

    verdict: str
    joints: tuple[str, ...]
    refusal: str | None = None
    findings: tuple[Finding, ...] = ()
    torque: TorqueRmse | None = None
    simulation: SimulationError | None = None
    unexplained_fraction: float = 0.0
    unexplained: str = ""
    record_next: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    model: ModelFile | None = None
    urdf_model: ModelFile | None = None
    predictions: Predictions | None = None
    driven: Predictions | None = None
    temperature: dict[str, Any] | None = None
    urdfs: tuple[RankedUrdf, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """The document diagnosis.json."""
        nothing = np.zeros(len(self.joints))
        torque = self.torque or TorqueRmse(self.joints, nothing, nothing, nothing, nothing)
        simulation = self.simulation or SimulationError(0.5, 0.0, 0.0, 0.0, 0.0)
        return {
            "verdict": self.verdict,
            "refusal": self.refusal,
            "effects": [f.as_dict() for f in self.findings],
            "data_faults": [f.as_dict() for f in self.findings if f.of_data],
            "torque_rmse": {
                "joints": list(torque.joints),
                "before": torque.before.tolist(),
                "after": torque.after.tolist(),
                "noise_floor": torque.noise_floor.tolist(),
                "torque": torque.torque.tolist(),
            },
            "simulation": {name: getattr(simulation, name) for name in SimulationError.__dataclass_fields__},
            "unexplained_fraction": self.unexplained_fraction,
            "unexplained": self.unexplained,
            **({} if self.temperature is None else {"temperature": self.temperature}),
            **({"urdfs": [asdict(x) for x in self.urdfs]} if self.urdfs else {}),
            "record_next": list(self.record_next),
            "notes": list(self.notes),
        }
