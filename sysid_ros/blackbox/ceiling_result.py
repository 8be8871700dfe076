"""What the ceiling says: how much is left, how much of it is no noise, where and with what; in numbers and in a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sysid_ros.blackbox.rest_boxes import BOXES

_MOST_NAMED = 3
_MOSTLY, _PARTLY = 0.5, 0.2
"""Parts of the gain from which one channel alone is said to make most of it, or to be among what makes it."""
_SLOW = 1.0
"""Frequency below which blocks do not tell one from another [Hz]."""
_NUMBERS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five", 6: "six", 7: "seven"}


@dataclass(frozen=True, eq=False)
class JointCeiling:
    """What black boxes predict of the torque that is left on one joint, as parts of the rms of its torque while it moves.

    Attributes:
        joint: name. left: rms of what the physical model leaves.
        gain: by how much the black boxes together make it smaller on left-out data. gain_std: its standard error from blocks.
        interval: of the gain, 95 %; skewed where few blocks hold most of it.
        missing: what is left less what is noise, of which the gain is a lower bound; only where something is claimed, else None.
        missing_interval: 95 %.
        p_value: that chance makes so much, one joint alone. claimed: whether it is no chance, all joints considered.
        boxes: the same gain of each black box with the ridge that is best for it in hindsight, by name. blocks: their number.
        torque: rms [N m]. frequency: in the middle of the power that is gained [Hz]. follows: channel that gains most alone, and
            its part of the gain. Both only where something is claimed, else None.
        chosen: name and ridge of the black box that is best in all; None where that is nothing.
    """

    joint: str
    left: float | None
    gain: float | None
    gain_std: float | None
    p_value: float | None
    claimed: bool
    boxes: dict[str, float]
    blocks: int
    torque: float
    frequency: float | None = None
    follows: tuple[str, float] | None = None
    chosen: tuple[str, float] | None = None
    interval: tuple[float, float] | None = None
    missing: float | None = None
    missing_interval: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Ceiling:
    """What is left of the torque, and what any of the black boxes predicts of it on data that it was not fitted to.

    Attributes:
        joints: each. left, missing: of all joints together: rms over the rms of all torques [N m], and how much of it is missing
            where that is claimed. tried: number of black boxes, their sum among them.
    """

    joints: tuple[JointCeiling, ...]
    left: float
    missing: float
    tried: int

    @property
    def claimed(self) -> tuple[JointCeiling, ...]:
        """Joints on which something is missing, the largest part of their torque first."""
        return tuple(sorted((j for j in self.joints if j.claimed), key=lambda j: -(j.missing or 0.0)))

    @property
    def sentence(self) -> str:
        """For an engineer."""
        return in_words(self)

    def as_dict(self) -> dict[str, Any]:
        """For machines: ``share`` is the part of each joint's torque that is missing in the model, 0 where none is claimed."""
        return {
            "joints": [j.joint for j in self.joints],
            "share": [j.missing or 0.0 for j in self.joints],
            "share_ci95": [j.missing_interval and list(j.missing_interval) for j in self.joints],
            "left": [j.left for j in self.joints],
            "gain": [j.gain for j in self.joints],
            "gain_std": [j.gain_std for j in self.joints],
            "gain_ci95": [j.interval and list(j.interval) for j in self.joints],
            "p_value": [j.p_value for j in self.joints],
            "frequency_hz": [j.frequency for j in self.joints],
            "follows": [j.follows and {"what": j.follows[0], "part": j.follows[1]} for j in self.joints],
            "black_box": [j.chosen[0] if j.chosen else None for j in self.joints],
            "black_boxes": {b.name: [j.boxes.get(b.name) for j in self.joints] for b in BOXES},
            "left_of_all": self.left,
            "share_of_all": self.missing,
            "sentence": self.sentence,
        }


def in_words(found: Ceiling) -> str:
    """One or two sentences."""
    judged = [j for j in found.joints if j.left is not None]
    if not judged:
        return "How much of what is left is noise can not be told: no joint moves for long enough to leave parts of it out."
    boxes = f"the mean of {_NUMBERS.get(found.tried, str(found.tried))} black boxes"
    first = f"What is left: {_percent(found.left)} of the torque"
    if not found.claimed:
        best = max(judged, key=lambda j: (j.gain or 0.0) / max(j.gain_std or 0.0, 1e-12))
        if not (best.gain or 0.0) > 0.0:
            return (
                f"{first}; {boxes} predicts nothing of it on data that were not fitted: noise, as far as these recordings tell."
            )
        return (
            f"{first}; {boxes} predicts {_points(best.gain or 0.0)} ({_spread(best.interval)}) of the "
            f"{_percent(best.left or 0.0)} of {best.joint}'s torque that are left, and less elsewhere, on data that were not "
            "fitted: noise, as far as these recordings tell."
        )
    parts = [_of_joint(j) for j in found.claimed[:_MOST_NAMED]]
    more = len(found.claimed) - len(parts)
    others = f"; and less on {more} more" if more > 0 else ""
    predicted = "; ".join(f"{_points(j.gain or 0.0)} of {j.joint}'s" for j in found.claimed[:_MOST_NAMED])
    return (
        f"{first}; missing in the model: {'; '.join(parts)}{others}. On data that were not fitted {boxes} predicts {predicted}."
    )


def _of_joint(j: JointCeiling) -> str:
    left, missing = j.left or 0.0, j.missing or 0.0
    where = "" if j.frequency is None else f", around {j.frequency:.2g} Hz" if j.frequency > _SLOW else f", below {_SLOW:g} Hz"
    with_what = ""
    if j.follows is not None and j.follows[1] >= _PARTLY:
        with_what = f" and {'' if j.follows[1] >= _MOSTLY else 'partly '}with {j.follows[0]}"
    spread = _spread(j.missing_interval)
    return f"{_points(missing)} ({spread}) of the {_percent(left)} of {j.joint}'s torque that are left{where}{with_what}"


def _spread(interval: tuple[float, float] | None) -> str:
    if interval is None:
        return "spread unknown"
    low, high = (100.0 * max(x, 0.0) for x in interval)
    return f"{low:.2g} to {high:.2g}"


def _percent(part: float) -> str:
    return f"{100.0 * part:.2g} %" if part < 0.995 else f"{100.0 * part:.0f} %"


def _points(part: float) -> str:
    return f"{100.0 * part:.2g} points"
