"""CoarseRows: a few hundred instants of recordings, on which robots are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sysid_ros.effects import ChannelEffect, Channels
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.signals.bristle import bristle
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.zero_phase import low_passed

_CUTOFF = 8.0
"""Band that is judged [Hz]: a controlled arm moves below; gears and noise are above."""
_RATE = 12.0
"""Most rows a second: what is faster than the band adds rows that say the same [Hz]."""
_MOST_ROWS = 300
"""Most rows: an exact likelihood costs their cube."""
_SLOW_SIGN = 0.15
"""Second width of the sign of a velocity [rad/s], for friction that falls with the speed."""
_BUILDS_UP = (0.005, 0.01, 0.02, 0.04, 0.08)
"""Displacements over which dry friction builds up after a reversal [rad]: what gears have, each twice the last."""
_STANDS = 0.01
"""Speed below which dry friction leaves a torque undetermined [rad/s]."""


@dataclass(frozen=True, eq=False)
class CoarseRows:
    """Instants of recordings below 8 Hz.

    Attributes:
        t: shape (N,) [s]. stretch: recording without a gap that each belongs to, shape (N,).
        q, v, a, tau: shape (N, n). sign: smoothed sign of the velocity through the torque's filter, shape (N, n).
        dry: other shapes of dry friction through it, shape (N, n, f): it falls with the speed, or builds up after a reversal.
        stands: 1 where a joint stands, shape (N, n).
    """

    t: FloatArray
    stretch: NDArray[np.intp]
    q: FloatArray
    v: FloatArray
    a: FloatArray
    tau: FloatArray
    sign: FloatArray
    dry: FloatArray
    stands: FloatArray

    @classmethod
    def of(cls, robot: RobotModel, recordings: Sequence[Recording]) -> CoarseRows | None:
        """The rows of recordings; None where none can be used."""
        found = [m for r in recordings for m in motions(robot, r)]
        if not found:
            return None
        seconds = sum(len(m.t) * m.period for m in found)
        step = max(1.0 / _RATE, seconds / _MOST_ROWS)
        parts = [_rows(m, step) for m in found]
        stretch = np.concatenate([np.full(len(p[0]), i) for i, p in enumerate(parts)])
        t, *channels = (np.concatenate(x) for x in zip(*parts, strict=True))
        return cls(t, stretch, *channels)

    def every(self, step: int) -> CoarseRows:
        """Each of so many rows."""
        return replace(self, **{name: getattr(self, name)[::step] for name in self.__dataclass_fields__})

    def plain(self, joint: int) -> FloatArray:
        """Columns of a joint's offset, viscous and dry friction, shape (N, 3)."""
        return np.stack([np.ones(len(self.t)), self.v[:, joint], self.sign[:, joint]], axis=1)

    def without(self, effect: ChannelEffect) -> CoarseRows:
        """The rows of the recordings without a fault: it acts on accelerations as on positions, on signs as on velocities."""
        first = effect.undo(Channels(self.q, self.v, self.tau))
        second = effect.undo(Channels(self.a, self.sign, self.tau))
        third = effect.undo(Channels(self.stands, self.sign, self.tau))
        assert first.v is not None
        assert second.v is not None
        dry = []
        for shape in np.moveaxis(self.dry, 2, 0):
            undone = effect.undo(Channels(self.q, shape, self.tau)).v
            assert undone is not None
            dry.append(undone)
        return replace(
            self,
            q=first.q,
            v=first.v,
            a=second.q,
            tau=first.tau,
            sign=second.v,
            dry=np.stack(dry, axis=2),
            stands=np.abs(third.q),
        )


def _rows(m: Motion, step: float) -> tuple[FloatArray, ...]:
    signs = [smoothed_sign(m.v), smoothed_sign(m.v, _SLOW_SIGN), *(bristle(m.q, z_s, m.period) for z_s in _BUILDS_UP)]
    n, every = m.q.shape[1], max(1, round(step / m.period))
    channels = low_passed(np.hstack([m.q, m.v, m.a, m.tau, *signs]), min(_CUTOFF, 0.2 / m.period), m.period)[every // 2 :: every]
    q, v, a, tau, sign, *dry = (channels[:, n * i : n * (i + 1)] for i in range(4 + len(signs)))
    return m.t[every // 2 :: every], q, v, a, tau, sign, np.stack(dry, axis=2), (np.abs(v) < _STANDS).astype(float)
