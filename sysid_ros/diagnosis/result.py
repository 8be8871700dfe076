"""Diagnosis: what was found, and as the document that machines read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sysid_ros.blackbox.ceiling_result import Ceiling
from sysid_ros.blackbox.hybrid import Hybrid
from sysid_ros.diagnosis.gain import SimulationError, Tracking
from sysid_ros.effects import Parameter, named
from sysid_ros.effects.wording import capital, first_sentence, listed, percent
from sysid_ros.sample import FloatArray
from sysid_ros.torque.model_file import ModelFile

_MOST_REFINEMENTS = 4
_UNNAMED = "effects too small or too uncertain to be named; model.yaml has them"
_HARM = f"{_UNNAMED}, and on other motion they do harm"
VERDICTS = ("explained", "partly_explained", "unexplained", "nothing_wrong", "refused")
_MOST_NAMED = 3
"""Causes that one sentence names."""


@dataclass(frozen=True)
class Finding:
    """One effect that earned its place.

    Attributes:
        id, label: of the effect. joints: that it concerns. parameters: with their intervals.
        heldout_gain: its share of the nominal model's error on data that were not fitted (power, over that of each joint's
            noise) by Shapley's rule: the shares of all causes add up to what all remove, and one that does harm beside the
            others has a negative one. None for faults of the data, which have no share in a torque.
        delta_bic: of the fitted rows. p_value: corrected for the number of candidates; log10_p: its decimal logarithm, also where
            it is smaller than a number can be. None where they can't be measured.
        cannot_be_told_from: ids that explain these recordings as well. words: what is wrong, where, how large.
        signature: what it looks like. separated_by: motion that tells it from its look-alikes.
        drift: of a friction that drifts, where a temperature is known: what it follows, and by which evidence.
        of_data: True for a fault of the channels or the messages.
        headline: True for one of the fewest causes that remove nearly all of what all causes remove.
        probability: that it is a cause; None where it was not computed. remark: further sentences.
    """

    id: str
    label: str
    joints: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    heldout_gain: float | None
    delta_bic: float | None
    p_value: float | None
    cannot_be_told_from: tuple[str, ...]
    words: str
    signature: str = ""
    separated_by: str = ""
    drift: dict[str, Any] | None = None
    log10_p: float | None = None
    of_data: bool = False
    headline: bool = False
    probability: float | None = None
    remark: str = ""

    @property
    def look_alikes(self) -> tuple[str, ...]:
        """What explains these recordings as well, in words."""
        return tuple(kind.label if (kind := named(id_)) else id_ for id_ in self.cannot_be_told_from)

    @property
    def sentence(self) -> str:
        """For an engineer: what is wrong, where, how large, what share of the error it makes, and what else there is to say."""
        return f"{sentence(self.words, self.heldout_gain)} {self.remark}".rstrip()

    def as_dict(self) -> dict[str, Any]:
        """As it stands in diagnosis.json."""
        return {
            "name": self.id,
            "joints": list(self.joints),
            "parameters": [p.as_dict() for p in self.parameters],
            "probability": self.probability,
            "headline": self.headline,
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
class Rest:
    """What the nominal model's error on held-out data is made of beside the findings, as parts of its power; with the findings'
    shares they add up to 1.

    Attributes:
        unclaimed: removed by terms that stand in the model and are no finding, each too small or too usual.
        noise: what no model removes. unexplained: beyond the noise.
    """

    unclaimed: float
    noise: float
    unexplained: float

    def in_words(self) -> list[tuple[float, str]]:
        """Its parts, and what they are."""
        return [
            (self.unclaimed, _UNNAMED if self.unclaimed > 0.0 else _HARM),
            (self.unexplained, "of no cause that is known here"),
            (self.noise, "noise, which no model removes"),
        ]

    def scaled(self, factor: float) -> Rest:
        """As parts of a whole of which it is ``factor``."""
        return Rest(factor * self.unclaimed, factor * self.noise, factor * self.unexplained)


@dataclass(frozen=True)
class Predictions:
    """Torques on the held-out data: t since the first stamp, shape (N,) [s]; torques of shape (N, n) [N m], and the motion;
    temperature of the joints [degrees Celsius], NaN where it is not known, None where none is; hybrid: extended with the rest."""

    t: FloatArray
    joints: tuple[str, ...]
    measured: FloatArray
    nominal: FloatArray
    extended: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray
    temperature: FloatArray | None = None
    hybrid: FloatArray | None = None


@dataclass(frozen=True)
class Diagnosis:
    """What is wrong with a model, and what the fix gains.

    Attributes:
        verdict: one of :data:`VERDICTS`. refusal: why, where it is "refused".
        findings: causes in order of gain, then the faults of the data. rest: of the error beside them.
        torque: error on held-out data.
        simulation: of the recorded motion held in a simulator, where it was run. tracking: its position errors.
        unexplained_fraction: power above the noise that is left on held-out data, as a part of the nominal residual's.
        record_next: what to record next, one sentence each. notes: what the user should know, one sentence each.
        model: the extended model. urdf_model: what a URDF can hold of it. predictions: on the held-out data.
        temperature: how what is left goes with the temperature of each joint, where one is known.
        urdfs: of several URDFs that were given, each with the probability that it is the robot's; the likeliest was diagnosed.
        ceiling: what black boxes predict of what is left. hybrid: the extended model with what they predict, where they do.
        units: of the torque of each joint; empty for N m.
    """

    verdict: str
    joints: tuple[str, ...]
    refusal: str | None = None
    findings: tuple[Finding, ...] = ()
    rest: Rest | None = None
    torque: TorqueRmse | None = None
    simulation: SimulationError | None = None
    unexplained_fraction: float = 0.0
    unexplained: str = ""
    record_next: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    model: ModelFile | None = None
    urdf_model: ModelFile | None = None
    predictions: Predictions | None = None
    tracking: Tracking | None = None
    temperature: dict[str, Any] | None = None
    urdfs: tuple[RankedUrdf, ...] = ()
    ceiling: Ceiling | None = None
    hybrid: Hybrid | None = None
    units: tuple[str, ...] = ()

    @property
    def causes(self) -> tuple[Finding, ...]:
        """The findings that have a share in the torque."""
        return tuple(f for f in self.findings if not f.of_data)

    @property
    def data_faults(self) -> tuple[Finding, ...]:
        """The findings between the robot and the messages."""
        return tuple(f for f in self.findings if f.of_data)

    @property
    def headline(self) -> str:
        """What an engineer would answer who was asked what is wrong."""
        main = [f for f in self.causes if f.headline]
        return answer(
            self.verdict,
            self.refusal,
            [f.words for f in main],
            sum(f.heldout_gain or 0.0 for f in main),
            len(self.causes) - len(main),
            [f.words for f in self.data_faults],
            self.unexplained_fraction,
        )

    @property
    def refinements(self) -> str:
        """The causes that are not of the headline and make a part of the error, in a sentence; empty where there is none."""
        others = [f for f in self.causes if not f.headline and (f.heldout_gain or 0.0) > 0.0]
        named = [f"{f.label} ({percent(f.heldout_gain)})" for f in others[:_MOST_REFINEMENTS]]
        more = [f"{len(others) - len(named)} more"] if len(others) > len(named) else []
        return f"Then: {listed([*named, *more])}." if others else ""

    def as_dict(self) -> dict[str, Any]:
        """The document diagnosis.json."""
        nothing = np.zeros(len(self.joints))
        torque = self.torque or TorqueRmse(self.joints, nothing, nothing, nothing, nothing)
        return {
            "verdict": self.verdict,
            "headline": self.headline,
            "refusal": self.refusal,
            "effects": [f.as_dict() for f in self.findings],
            "data_faults": [f.as_dict() for f in self.data_faults],
            "rest_of_error": None if self.rest is None else asdict(self.rest),
            "torque_rmse": {
                "joints": list(torque.joints),
                "before": torque.before.tolist(),
                "after": torque.after.tolist(),
                "noise_floor": torque.noise_floor.tolist(),
                "torque": torque.torque.tolist(),
                **({"units": list(self.units)} if self.units else {}),
            },
            "simulation": SimulationError.as_dict(self.simulation),
            "unexplained_fraction": self.unexplained_fraction,
            "unexplained": self.unexplained,
            **({} if self.temperature is None else {"temperature": self.temperature}),
            **({} if self.ceiling is None else {"ceiling": self.ceiling.as_dict()}),
            **({"urdfs": [asdict(x) for x in self.urdfs]} if self.urdfs else {}),
            "record_next": list(self.record_next),
            "notes": list(self.notes),
        }


def sentence(words: str, gain: float | None) -> str:
    """One sentence for an engineer: what, where, how large, and how much of the error it makes."""
    return f"{capital(words)}." if gain is None else f"{capital(words)}. It {makes(gain)}."


def makes(gain: float) -> str:
    """A share of the error in words; that of a cause which does harm beside the others is negative."""
    if gain <= -0.0005:
        return f"makes the error on data that were not fitted {percent(-gain)} larger"
    return f"makes {percent(gain)} of the error"


def answer(
    verdict: str, refusal: str | None, main: Sequence[str], gain: float, others: int, faults: Sequence[str], left: float
) -> str:
    """The first sentence of a report: what an engineer would answer who was asked what is wrong.

    Args:
        main: the causes of the headline in words. gain: what all of them make of the error. others: number of the other causes.
        faults: of the data, in words. left: part of the error that nothing explains.
    """
    if verdict == "refused":
        return f"No answer: {first_sentence(refusal or 'these recordings can not be judged.')[0]}"
    data = f" The data have {'a fault' if len(faults) == 1 else 'faults'} of their own: {listed(faults)}." if faults else ""
    if verdict == "unexplained":
        return f"The model is wrong, and no cause that is known here explains it.{data}"
    if not main and not others:
        if faults:
            return f"The model is right, the data are not: {listed(faults)}."
        return "Nothing is wrong that these recordings could show: the model predicts the torques down to their noise."
    if not main:
        return f"What was found in the fitted recordings does not make the error on other data smaller.{data}"
    named = [*main[:_MOST_NAMED], *([f"{len(main) - _MOST_NAMED} more"] if len(main) > _MOST_NAMED else [])]
    first = "Mostly: " if others else ""
    whole = f"{first}{_in_a_row(named)}. {'It makes' if len(main) == 1 else 'Together they make'} {percent(gain)} of the error"
    rest = f"; {percent(left)} of it is of no cause that is known here" if verdict == "partly_explained" and left >= 0.005 else ""
    return f"{capital(whole)}{rest}.{data}"


def _in_a_row(clauses: Sequence[str]) -> str:
    return listed(clauses) if all("," not in c and ";" not in c for c in clauses) else "; ".join(clauses)
