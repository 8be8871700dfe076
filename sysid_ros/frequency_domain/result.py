"""What a check in the frequency domain found, in plain values."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from sysid_ros.files import plain
from sysid_ros.frequency_domain.beyond_linear import Distortion, MissingFriction
from sysid_ros.frequency_domain.causes import Cause
from sysid_ros.frequency_domain.local_fit import Window
from sysid_ros.frequency_domain.modes import Modes
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.frequency_domain.verdict import Verdict
from sysid_ros.sample import FloatArray
from sysid_ros.signals.postures import Postures


@dataclass(frozen=True, eq=False)
class Response:
    """One response: from the model's torque to the measured one, or from dq/dt to the published velocity.

    Attributes:
        windows: responses of :mod:`.local_fit`, with the noise of a line. density: of that noise, of each window, shape (w,), in
            the output's unit over the root of Hz. verdict, cause, distortion: what they say; None where they say nothing.
        seconds: that were used. periods: (period [s], count) of records that are whole periods.
    """

    windows: tuple[Window, ...]
    density: FloatArray
    verdict: Verdict
    cause: Cause | None
    distortion: Distortion | None
    seconds: float
    periods: tuple[tuple[float, int], ...]

    def as_dict(self) -> dict[str, Any]:
        """For machines."""
        cause, d = self.cause, self.distortion
        ends = ("holds_from", "holds_to", "fails_from", "told_to", "fails_below")
        return {
            "seconds": self.seconds,
            "periodic": [{"period_s": p, "periods": n} for p, n in self.periods],
            **{f"{end}_hz": getattr(self.verdict, end) for end in ends},
            "bands": [
                {"low_hz": b.low, "high_hz": b.high, "real": b.H.real, "imag": b.H.imag, "radius95": b.radius, "says": b.says}
                for b in self.verdict.bands
            ],
            "cause": cause
            and {
                "name": cause.name,
                "parameters": [
                    {"name": p.name, "value": p.value, "std": p.std, "ci95": [p.low, p.high], "unit": p.unit}
                    for p in cause.parameters
                ],
                "delta_bic": cause.delta_bic,
                "held_out_gain": cause.held_out_gain,
                "cannot_be_told_from": cause.cannot_be_told_from,
                "misfit": cause.misfit,
                "named": cause.named,
                "share_beside_dry_friction": cause.share,
            },
            "distortion": d
            and {
                **_renamed(d, noise="noise_rms", nonlinear="nonlinear_rms", even="even_rms", odd="odd_rms"),
                "found": d.found,
            },
            "response": {
                "frequency_hz": [w.f for w in self.windows],
                "real": [w.H.real for w in self.windows],
                "imag": [w.H.imag for w in self.windows],
                "radius95": [w.radius for w in self.windows],
                "coherence": [w.coherence for w in self.windows],
                "noise_density": self.density,
                "input_noise": [w.input_noise for w in self.windows],
                "clear": [w.clear for w in self.windows],
            },
        }


@dataclass(frozen=True, eq=False)
class JointCheck:
    """What was found on one joint.

    Attributes:
        joint: its name. torque, velocity: responses; None where there is none, for the reason in ``why_not``. modes: of the
            state-space check; None with the reason in ``why_no_modes``. inertia: of the links about the joint, mean and standard
            deviation over the motion [kg m^2]. stiffness: of gravity about it, mean [N m/rad].
        friction: dry friction that the model lacks; no cause is named beside it. sentences: for an engineer.
    """

    joint: str
    torque: Response | None
    velocity: Response | None
    modes: Modes | None
    why_not: str
    why_no_modes: str
    inertia: tuple[float, float]
    stiffness: float
    prismatic: bool
    friction: MissingFriction | None = None
    sentences: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """For machines."""
        m = self.modes
        return {
            "joint": self.joint,
            "sentences": self.sentences,
            "why_not": self.why_not or None,
            "missing_friction": self.friction,
            "torque": self.torque.as_dict() if self.torque else None,
            "velocity": self.velocity.as_dict() if self.velocity else None,
            "link_inertia": {"mean": self.inertia[0], "std": self.inertia[1]},
            "gravity_stiffness": self.stiffness,
            "why_no_modes": self.why_no_modes or None,
            "modes": m
            and {
                **_renamed(m, small="small_motion", band="band_hz", errors="held_out_errors", rigid="rigid_poles", modes="pairs"),
                "pairs": [_renamed(x, frequency="frequency_hz") for x in m.modes],
                "stabilisation": [_renamed(x, frequency="frequency_hz") for x in m.stabilisation],
            },
        }


def _renamed(value: Any, **names: str) -> dict[str, Any]:
    """The fields of a dataclass, some of them by another name."""
    return {names.get(field.name, field.name): getattr(value, field.name) for field in fields(value)}


@dataclass(frozen=True, eq=False)
class FrequencyCheck:
    """What was found on a robot.

    Attributes:
        joints: one a joint, in the model's order. top_hz: upper end of the band that was looked at [Hz].
        recordings: names and seconds.
        sentences: what several joints have in common. warnings: what the user should know of the recordings. assumptions: under
            which all of it is true. postures: of the first recording, to be looked at.
    """

    joints: tuple[JointCheck, ...]
    top_hz: float
    recordings: tuple[tuple[str, float], ...]
    warnings: tuple[str, ...]
    assumptions: tuple[str, ...]
    sentences: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)
    postures: Postures | None = None

    def as_dict(self) -> dict[str, Any]:
        """For machines."""
        document: dict[str, Any] = plain(
            {
                "format": 1,
                "tolerance": TOLERANCES.misfit,
                "level": 0.95,
                "top_hz": self.top_hz,
                "recordings": [{"name": n, "seconds": s} for n, s in self.recordings],
                "joints": [j.as_dict() for j in self.joints],
                "sentences": self.sentences,
                "warnings": self.warnings,
                "assumptions": self.assumptions,
                "provenance": self.provenance,
            }
        )
        return document
