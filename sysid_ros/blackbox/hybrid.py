"""Hybrid: a physical model and, on joints where something is missing in it, the black box that predicts the rest."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.blackbox.ceiling_result import Ceiling
from sysid_ros.blackbox.left_out_ridge import ridge_path
from sysid_ros.blackbox.rest_boxes import BOXES
from sysid_ros.blackbox.rest_inputs import RestInputs, Spread, cutoff_of
from sysid_ros.exceptions import ModelFileError
from sysid_ros.files import plain
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion

FORMAT = 2


@dataclass(frozen=True, eq=False)
class RestModel:
    """What one black box learned of one joint: ``rest = ((columns - mean) / size) w + offset``.

    Attributes:
        joint: index. box: its name. mean, size, w: shape (c,). offset: [N m].
    """

    joint: int
    box: str
    mean: FloatArray
    size: FloatArray
    w: FloatArray
    offset: float


@dataclass(frozen=True, eq=False)
class Hybrid:
    """Torque that a physical model leaves, predicted from the motion.

    Attributes:
        joints: names. cutoff: of the low-pass that what is seen goes through [Hz]. spread: of the fitted channels. parts: of the
            joints where something was claimed.
    """

    joints: tuple[str, ...]
    cutoff: float
    spread: Spread
    parts: tuple[RestModel, ...]

    @classmethod
    def fitted(cls, found: Ceiling, motions: Sequence[Motion], rest: Sequence[FloatArray]) -> Hybrid:
        """The black box that each claimed joint chose, fitted to motions and what the physical model leaves of them, (N, n)."""
        cutoff = cutoff_of(motions)
        inputs = [RestInputs.of(m, cutoff) for m in motions]
        left = [i.seen(x) for x, i in zip(rest, inputs, strict=True)]
        spread, parts = Spread.of(inputs), []
        for j, joint in enumerate(found.joints):
            if not joint.claimed or joint.chosen is None:
                continue
            box = next(b for b in BOXES if b.name == joint.chosen[0])
            own = np.concatenate([i.moving[:, j] for i in inputs])
            X = np.concatenate([box.columns(i, spread, j) for i in inputs])[own]
            weights = ridge_path(X, np.concatenate([x[:, j] for x in left])[own], [joint.chosen[1]])
            parts.append(RestModel(j, box.name, weights.mean, weights.size, weights.w[:, 0], weights.offset))
        return cls(tuple(j.joint for j in found.joints), cutoff, spread, tuple(parts))

    def rest(self, motion: Motion) -> FloatArray:
        """Torque to be added to the physical model's, on the grid of a motion, shape (N, n); 0 where a joint stands [N m]."""
        inputs = RestInputs.of(motion, self.cutoff)
        out = np.zeros(motion.q.shape)
        for part in self.parts:
            box = next(b for b in BOXES if b.name == part.box)
            made = ((box.columns(inputs, self.spread, part.joint) - part.mean) / part.size) @ part.w + part.offset
            out[:, part.joint] = np.interp(motion.t, inputs.t, np.where(inputs.moving[:, part.joint], made, 0.0))
        return out

    def as_dict(self) -> dict[str, Any]:
        """For machines."""
        spread = {f.name: getattr(self.spread, f.name) for f in fields(Spread)}
        parts = [
            {
                "joint": self.joints[p.joint],
                "black_box": p.box,
                "mean": p.mean,
                "inverse_size": 1.0 / p.size,
                "weights": p.w,
                "offset": p.offset,
            }
            for p in self.parts
        ]
        document: dict[str, Any] = plain(
            {"format": FORMAT, "joints": self.joints, "cutoff_hz": self.cutoff, "spread": spread, "parts": parts}
        )
        return document

    @classmethod
    def read(cls, path: Path) -> Hybrid:
        """From a file of :meth:`as_dict`.

        Raises:
            ModelFileError: it can't be read, is none, or is of another version.
        """
        try:
            d = json.loads(path.read_text(encoding="utf-8"))
            if d["format"] != FORMAT:
                raise ModelFileError(f"{path}: the format is {d['format']}; this version reads {FORMAT}. Diagnose again.")
            joints = tuple(d["joints"])
            spread = Spread(**{f.name: np.array(d["spread"][f.name]) for f in fields(Spread)})
            known = {b.name for b in BOXES}
            parts = []
            for p in d["parts"]:
                if p["black_box"] not in known:
                    raise ModelFileError(
                        f"{path}: there is no black box '{p['black_box']}'; known are {', '.join(sorted(known))}."
                    )
                inverse = np.array(p["inverse_size"], dtype=float)
                size = np.divide(1.0, inverse, out=np.full(len(inverse), np.inf), where=inverse > 0.0)
                weights = np.array(p["weights"], dtype=float)
                parts.append(RestModel(joints.index(p["joint"]), p["black_box"], np.array(p["mean"]), size, weights, p["offset"]))
            return cls(joints, float(d["cutoff_hz"]), spread, tuple(parts))
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ModelFileError(f"{path}: it is no hybrid of 'sysid diagnose' ({error}). Give its hybrid.json.") from None
