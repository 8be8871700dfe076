"""Five black boxes for the torque of one joint that a physical model leaves; each is linear in what it learns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sysid_ros.blackbox.rest_features import (
    Blocks,
    Making,
    all_joints,
    dynamics,
    loads,
    memories,
    positions,
    process,
    ripples,
    speeds,
)
from sysid_ros.blackbox.rest_inputs import RestInputs, Spread
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class Box:
    """One black box.

    Attributes:
        name: for people. made: the functions that it learns a sum of.
    """

    name: str
    made: tuple[Making, ...]

    def blocks(self, i: RestInputs, s: Spread, joint: int) -> Blocks:
        """Its functions of a stretch, by kind, shape (N, c) each."""
        return {name: x for make in self.made for name, x in make(i, s, joint).items()}

    def columns(self, i: RestInputs, s: Spread, joint: int) -> FloatArray:
        """All of them, shape (N, c)."""
        return np.column_stack(list(self.blocks(i, s, joint).values()))


BOXES = (
    Box("functions of all joints", (all_joints, loads, speeds)),
    Box("ripple over the position", (ripples, positions)),
    Box("Gaussian process of the joint", (process, speeds)),
    Box("memory", (memories, speeds)),
    Box("linear dynamics", (dynamics,)),
)


def _of_position(k: int) -> Making:
    return lambda i, s, j: {**ripples(i, s, k), **positions(i, s, k)}


def _of(name: str, k: int) -> Callable[[RestInputs, Spread, int], Blocks]:
    def made(i: RestInputs, s: Spread, j: int) -> Blocks:
        mean = s.load_mean[k] if name == "load" else 0.0
        x = (getattr(i, name)[:, k] - mean) / getattr(s, name)[k]
        out = {name: i.below(np.column_stack([x, np.abs(x), x * np.abs(x), x**3]))}
        return {**out, **speeds(i, s, k)} if name == "v" else out

    return made


def single_inputs(names: tuple[str, ...], joint: int) -> list[Box]:
    """Boxes that see one channel alone, in words: of all joints the position, of the own joint the rest too."""
    out = [Box(f"the position of {name}", (_of_position(k),)) for k, name in enumerate(names)]
    out += [Box(f"the speed of {name}", (_of("v", k),)) for k, name in enumerate(names)]
    own = names[joint]
    return [*out, Box(f"the acceleration of {own}", (_of("a", joint),)), Box(f"the load of {own}", (_of("load", joint),))]
