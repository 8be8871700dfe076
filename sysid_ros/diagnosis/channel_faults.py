"""Faults of units, signs and order: looked for first, since every other effect would soak them up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sysid_ros.effects import ChannelEffect, Channels, JointOrder, JointSign, TorqueSign, TorqueUnit
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.recording import Recording

UNITS = {
    1000.0: "N mm",
    100.0: "N cm",
    0.737562: "lbf ft",
    8.850746: "lbf in",
    0.001: "kN m",
    57.29578: "N m, times 180 / pi",
    0.101972: "kgf m",
}
"""Factors of units that efforts are published in by mistake."""
_EVERY = 5
_CLOSE = 0.04
_FAR = 0.15
_LOADED, _STRONG = 0.005, 0.05
"""Torque of a joint, of that of the strongest, from which its factor is asked, and from which it alone can refute a unit."""
_CURRENT, _CURRENT_FITS = 3.3, 0.9
"""Factor from which efforts with a factor of their own on each joint are currents, and part of their power that must follow."""
_LEFT = 0.1
"""Part of the squared torque that a fault of signs or order may leave on half of the joints."""


@dataclass(frozen=True)
class Fault:
    """A fault.

    Attributes:
        effect: how it is undone. joints: indices.
        values: (name, joint or None, value, unit, std) of each parameter; std is None where none was measured.
        parameters: free numbers among them. candidates: other faults that were tried, and itself.
    """

    effect: ChannelEffect
    joints: tuple[int, ...]
    values: tuple[tuple[str, int | None, float | str, str, float | None], ...]
    parameters: int = 0
    candidates: int = 1


def find_faults(robot: RobotModel, recordings: Sequence[Recording]) -> list[Fault]:
    """Faults of units, signs and order, in the order in which they are to be undone."""
    found: list[Fault] = []
    screen = _Screen(robot, recordings)
    for look in (_order_and_signs, _gains):
        fault = look(screen)
        if fault is not None:
            found.append(fault)
            screen = _Screen(robot, [undo(r, fault.effect) for r in screen.recordings])
    return found


def undo(recording: Recording, effect: ChannelEffect) -> Recording:
    """The recording without the fault."""
    channels = effect.undo(Channels(recording.q, recording.v, recording.tau))
    return replace(recording, q=channels.q, v=channels.v, tau=channels.tau)


class _Screen:
    """Coarse rows of recordings, on which many faults are tried."""

    def __init__(self, robot: RobotModel, recordings: Sequence[Recording]) -> None:
        self.robot, self.recordings = robot, list(recordings)
        parts = [m for r in recordings for m in motions(robot, r)]
        self.q, self.v, self.a, self.tau = (
            np.concatenate([getattr(m, name)[::_EVERY] for m in parts]) for name in ("q", "v", "a", "tau")
        )
        self.nominal = robot.rnea_along(self.q, self.v, self.a)

    def left(self, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray, nominal: FloatArray | None = None) -> FloatArray:
        """Mean square that the model and any friction of the joints leave, shape (n,)."""
        rest = tau - (self.robot.rnea_along(q, v, a) if nominal is None else nominal)
        out = np.empty(self.robot.n)
        for j in range(self.robot.n):
            X = np.stack([smoothed_sign(v[:, j]), v[:, j]], axis=1)
            theta = np.linalg.lstsq(X, rest[:, j], rcond=None)[0]
            out[j] = np.mean((rest[:, j] - X @ theta) ** 2)
        return out


def _order_and_signs(screen: _Screen) -> Fault | None:
    """The one flip or swap that makes the torques fit, where there is one."""
    n, names = screen.robot.n, screen.robot.joint_names
    size = np.maximum(np.mean(screen.tau**2, axis=0), 1e-12)
    floor = 1e-3 * size
    here = np.log(screen.left(screen.q, screen.v, screen.a, screen.tau, screen.nominal) + floor)
    trials: list[tuple[float, Fault, FloatArray]] = []

    def add(left: FloatArray, fault: Fault, own: FloatArray = size) -> None:
        trials.append((float(np.sum(here - np.log(left + floor))), fault, left / own))

    for j in range(n):
        flip = np.where(np.arange(n) == j, -1.0, 1.0)
        if np.corrcoef(screen.tau[:, j], screen.nominal[:, j])[0, 1] < -0.5:
            left = screen.left(screen.q, screen.v, screen.a, screen.tau * flip, screen.nominal)
            add(left, Fault(TorqueSign([j]), (j,), (("gain", j, -1.0, "1", None),)))
        left = screen.left(screen.q * flip, screen.v * flip, screen.a * flip, screen.tau * flip)
        add(left, Fault(JointSign([j]), (j,), (("sign", j, -1.0, "1", None),)))
    for i, j in combinations(range(n), 2):
        source = np.arange(n)
        source[[i, j]] = j, i
        values = (("takes_from", i, names[j], "", None), ("takes_from", j, names[i], "", None))
        left = screen.left(screen.q, screen.v, screen.a, screen.tau[:, source], screen.nominal)
        add(left, Fault(JointOrder(source.tolist(), True), (i, j), values), size[source])
        moved = [x[:, source] for x in (screen.q, screen.v, screen.a, screen.tau)]
        add(screen.left(*moved), Fault(JointOrder(source.tolist(), False), (i, j), values), size[source])
    gain, best, part = max(trials, key=lambda t: t[0])
    if gain < best.effect.stands_out or float(np.median(part)) > _LEFT:
        return None
    return replace(best, candidates=len(trials))


def _gains(screen: _Screen) -> Fault | None:
    """One factor on all efforts, another unit; or one on each, far from 1: currents."""
    n = screen.robot.n
    gains, stds, fits = np.ones(n), np.full(n, np.inf), np.zeros(n)
    for j in range(n):
        X = np.stack([screen.nominal[:, j], smoothed_sign(screen.v[:, j]), screen.v[:, j], np.ones(len(screen.v))], axis=1)
        theta, *_ = np.linalg.lstsq(X, screen.tau[:, j], rcond=None)
        rest = screen.tau[:, j] - X @ theta
        spread = np.var(rest) * np.linalg.pinv(X.T @ X)
        gains[j], stds[j] = theta[0], np.sqrt(max(spread[0, 0], 0.0) * 20.0)
        fits[j] = 1.0 - np.var(rest) / max(np.var(screen.tau[:, j]), 1e-30)
    size = np.sqrt(np.mean(screen.nominal**2, axis=0))
    loaded = (size > _LOADED * size.max()) & (fits > 0.8) & (gains > 0.0)
    if loaded.sum() < max(2, n // 2):
        return None
    if _gravity_alone(screen, gains, loaded):
        return None
    middle = float(np.exp(np.median(np.log(gains[loaded]))))
    same = np.abs(np.log(gains[loaded] / middle)) < np.log1p(_CLOSE) + 3.0 * stds[loaded] / gains[loaded]
    known = min(UNITS, key=lambda u: abs(np.log(u / middle)))
    if np.mean(same) > 0.7 and abs(np.log(known / middle)) < _CLOSE:
        factor = known
        return Fault(TorqueUnit([factor] * n), tuple(range(n)), (("factor", None, factor, "1", None),), 1, len(UNITS))
    far = np.abs(np.log(np.maximum(gains, 1e-12))) > np.log(_CURRENT)
    strong = loaded & (size > _STRONG * size.max())
    if (
        np.mean(far[loaded]) > 0.7
        and np.mean(far[strong]) > 0.7
        and not 1.0 / _CURRENT < middle < _CURRENT
        and np.median(fits[loaded]) > _CURRENT_FITS
    ):
        factors = np.where((fits > 0.5) & (gains > 0.1 * middle), gains, middle)
        values = tuple(("factor", j, float(factors[j]), "1", None) for j in range(n))
        return Fault(TorqueUnit(factors.tolist()), tuple(range(n)), values, n, len(UNITS))
    return None


def _gravity_alone(screen: _Screen, gains: FloatArray, loaded: NDArray[np.bool_]) -> bool:
    """True where gravity missing or standing twice in the effort explains it better than a factor."""
    still = np.zeros_like(screen.q)
    gravity = screen.robot.rnea_along(screen.q, still, still)
    state = screen.q, screen.v, screen.a
    scaled = np.sum(np.log(screen.left(*state, screen.tau / gains, screen.nominal) * gains**2)[loaded])
    added = [np.sum(np.log(screen.left(*state, screen.tau + c * gravity, screen.nominal))[loaded]) for c in (-1.0, 1.0)]
    return bool(min(added) < scaled)
