"""KnownEffect: a cause of torque whose parameters are given; KnownError: what their uncertainty does to the torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.effects import Effect
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class KnownEffect:
    """An effect with its parameters.

    Attributes:
        effect: the cause.
        theta: its parameters, shape (p,).
        covariance: how well they are known, shape (p, p), or None where they are taken as exact.
    """

    effect: Effect
    theta: FloatArray
    covariance: FloatArray | None = None


class KnownError:
    """``error of the known torque = Z z``, z ~ N(0, 1), with Z = Y L and ``L L'`` the covariance of the known parameters.

    Args:
        robot: the arm.
        known: its known effects.
        directions: L, shape (number of known parameters, c), rows in the order of the effects; None where it is not known.
        links: the same of the URDF's link inertials, shape (10 n, c), where they are what is known.
        gain: standard deviation of each joint's effort over the torque, as a part of it.

    Attributes:
        c: number of directions. links: L of the link inertials, shape (10 n, c). others: other effects with their rows of L.
        gains: of the error of each joint's effort over the torque, as a part of it, ``gains z``, shape (n, d): what they make of
            a row is that row's measured torque. Of z only the last ``gained`` are of the efforts, and go on after the c of the
            directions as long as these know nothing of them.

    Raises:
        ModelFileError: L does not fit the effects.
    """

    def __init__(
        self,
        robot: RobotModel,
        known: Sequence[KnownEffect],
        directions: FloatArray | None,
        links: FloatArray | None = None,
        gain: float = 0.0,
    ) -> None:
        self.gained = robot.n if gain else 0
        count = sum(k.effect.p for k in known)
        if directions is not None and directions.shape[0] != count:
            raise ModelFileError(
                f"the model's uncertainty has {directions.shape[0]} rows, its effects have {count} parameters. "
                "Write the model again with 'sysid identify'."
            )
        self.others: list[tuple[Effect, FloatArray]] = []
        if directions is None:
            self.links = np.zeros((10 * robot.n, 0)) if links is None else links
            self.c = self.links.shape[1]
            self.gains = np.hstack([np.zeros((robot.n, self.c)), gain * np.eye(robot.n)[:, : self.gained]])
            return
        self.c = directions.shape[1]
        self.gains = np.zeros((robot.n, self.c))
        self.links = np.zeros((10 * robot.n, self.c))
        start = 0
        for k in known:
            rows = directions[start : start + k.effect.p]
            start += k.effect.p
            if k.effect.replaces_links:
                nothing = k.effect.as_links(np.zeros(k.effect.p))
                self.links += np.stack([(k.effect.as_links(d) - nothing).ravel() for d in rows.T], axis=1)
            else:
                self.others.append((k.effect, rows))
