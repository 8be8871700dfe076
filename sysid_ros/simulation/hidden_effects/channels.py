"""What lies between the robot and its messages: offsets, gains, units, delays, mirrored and exchanged joints.

A channel changes what is published and nothing that moves. Shapes: t (N,), q, v, tau (N, n).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class Signals:
    """All messages of a recording: t [s] since the first, q [rad], v [rad/s], tau [N m]."""

    t: FloatArray
    q: FloatArray
    v: FloatArray
    tau: FloatArray


class Channel(Protocol):
    """A change of what is published."""

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        """The changed messages; ``true`` is the robot's motion and torque without noise."""


@dataclass(frozen=True)
class Gained:
    """Effort times a gain: another constant, unit or sign, shape (n,)."""

    gain: FloatArray

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        return replace(signals, tau=signals.tau * self.gain)


@dataclass(frozen=True)
class Offset:
    """Effort plus an offset [N m] and a ramp [N m/s], shape (n,) each."""

    offset: FloatArray
    rate: FloatArray

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        return replace(signals, tau=signals.tau + self.offset + np.multiply.outer(signals.t, self.rate))


@dataclass(frozen=True)
class Coupled:
    """Effort of one motor that also carries a part of another joint's: ``tau_j - c tau_other``."""

    joint: int
    other: int
    c: float

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        tau = signals.tau.copy()
        tau[:, self.joint] -= self.c * true.tau[:, self.other]
        return replace(signals, tau=tau)


@dataclass(frozen=True)
class WithGravity:
    """Effort plus ``coef`` times the torque that the controller's model says gravity costs."""

    robot: RobotModel
    coef: float

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        gravity = np.array([self.robot.gravity_torque(q) for q in true.q])
        return replace(signals, tau=signals.tau + self.coef * gravity)


@dataclass(frozen=True)
class Delayed:
    """Effort published late [s]."""

    delay: float

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        late = np.column_stack([np.interp(signals.t - self.delay, signals.t, x) for x in true.tau.T])
        return replace(signals, tau=signals.tau + late - true.tau)


@dataclass(frozen=True)
class Lagging:
    """Velocity through a first-order low-pass with its cutoff [Hz]; straight lines between the messages, solved exactly."""

    cutoff: float

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        v = signals.v.copy()
        for k in range(1, len(v)):
            x = 2.0 * np.pi * self.cutoff * (signals.t[k] - signals.t[k - 1])
            decay = np.exp(-x)
            slope = (1.0 - decay) / x
            v[k] = decay * v[k - 1] + (1.0 - slope) * signals.v[k] + (slope - decay) * signals.v[k - 1]
        return replace(signals, v=v)


@dataclass(frozen=True)
class Quantised:
    """Effort in steps [N m], shape (n,); 0: none."""

    step: FloatArray

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        step = np.where(self.step > 0.0, self.step, 1.0)
        return replace(signals, tau=np.where(self.step > 0.0, np.round(signals.tau / step) * step, signals.tau))


@dataclass(frozen=True)
class Clipped:
    """Effort that ends at a limit [N m], shape (n,)."""

    limit: FloatArray

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        return replace(signals, tau=np.clip(signals.tau, -self.limit, self.limit))


@dataclass(frozen=True)
class Misaligned:
    """Positions with an offset [rad], shape (n,): measured minus true."""

    delta: FloatArray

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        return replace(signals, q=signals.q + self.delta)


@dataclass(frozen=True)
class Mirrored:
    """Position, velocity and effort times 1 or -1, shape (n,)."""

    sign: FloatArray

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        return Signals(signals.t, signals.q * self.sign, signals.v * self.sign, signals.tau * self.sign)


@dataclass(frozen=True)
class Exchanged:
    """Channels under other joints' names: entry j shows joint ``order[j]``; of the efforts alone or of all channels."""

    order: tuple[int, ...]
    effort_only: bool

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        order = list(self.order)
        if self.effort_only:
            return replace(signals, tau=signals.tau[:, order])
        return Signals(signals.t, signals.q[:, order], signals.v[:, order], signals.tau[:, order])


@dataclass(frozen=True)
class Wobbling:
    """Effort whose gain swings with time: ``1 + size sin(2 pi t / period)``, of one joint."""

    joint: int
    size: float
    period: float

    def __call__(self, signals: Signals, true: Signals) -> Signals:
        tau = signals.tau.copy()
        tau[:, self.joint] *= 1.0 + self.size * np.sin(2.0 * np.pi * signals.t / self.period)
        return replace(signals, tau=tau)
