"""Instants: some moments of recordings of a robot on legs, with its channels as they were published or with a fault undone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sysid_ros.diagnosis.legs.leg_hypotheses import Hypothesis, ImuFault
from sysid_ros.effects import Channels
from sysid_ros.identification.channel_checks import CheckedRecording
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.floating_motion import smooth_stretch
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.signals.zero_phase import KinematicFilter, SmoothMotion

_CHANNELS = ("t", "q", "v", "a", "tau", "spoiled")


@dataclass(frozen=True, eq=False)
class Instants:
    """Some moments of recordings, with all channels as they were published.

    Attributes:
        motion: of the whole robot, the trunk at its IMU; of each moment three samples, by which values change there.
        place: of the IMU, shape (3,) [m]. run: of which stretch each moment is, shape (N,).
        scale: what the torques are of the published ones. gain: what the gyro shows of the angular velocity.
        force: what the specific force is of the published one.
        pairs: of each two feet whether both stand, shape (N,) each.
    """

    motion: SmoothMotion
    place: FloatArray
    run: NDArray[np.intp]
    scale: float = 1.0
    gain: float = 1.0
    force: float = 1.0
    pairs: tuple[NDArray[np.bool_], ...] = ()

    @classmethod
    def of(
        cls,
        recordings: Sequence[CheckedRecording],
        cutoff_hz: float,
        max_gap: float,
        most: int,
        delays: Sequence[tuple[float, float]],
    ) -> list[Instants]:
        """At most so many, evenly over all recordings, for each pair of delays of the IMU and of the torques [s]; none where no
        recording is long enough."""
        found, good = list[SmoothMotion](), list[NDArray[np.intp]]()
        place = np.zeros(3)
        for checked in recordings:
            r = checked.recording
            if r.trunk is None or not r.period:
                continue
            kinematics, place = KinematicFilter(r.period, cutoff_hz), r.trunk.place
            at_imu = replace(r, trunk=replace(r.trunk, place=np.zeros(3)))
            for part in r.stretches(max_gap):
                if part.stop - part.start <= 2 * kinematics.half:
                    continue
                smooth = smooth_stretch(kinematics, at_imu.at(part), False, checked.spoiled[part], TrunkSetup())
                if smooth is not None:
                    found.append(smooth)
                    good.append(_usable(smooth, 1 + round(max(abs(d) for pair in delays for d in pair) / kinematics.grid_period)))
        total = sum(map(len, good))
        if not total:
            return []
        chosen = np.unique(np.linspace(0, total - 1, min(most, total)).astype(int))
        run = np.repeat(np.arange(len(good)), [len(x) for x in good])[chosen]
        own = np.concatenate(good)[chosen]
        out = []
        for imu, torque in delays:
            parts = [_moments(x, own[run == k], imu, torque) for k, x in enumerate(found)]
            whole = SmoothMotion(*(np.concatenate([getattr(x, name) for x in parts]) for name in _CHANNELS))
            out.append(cls(whole, place, run))
        return out

    def undone(self, fault: Hypothesis) -> Instants:
        """The same without a fault."""
        m, legs = self.motion, slice(FREE, None)
        q, v, a, tau, scale = np.array(m.q), np.array(m.v), np.array(m.a), np.array(m.tau), self.scale
        gain, force = self.gain, self.force
        if isinstance(fault, ImuFault):
            v[:, 3:FREE], a[:, :3] = fault.undo(m.v[:, 3:FREE], m.a[:, :3])
            angular = fault.undo(_turned(m.a[:, 3:FREE], m.v[:, 3:FREE], 1.0), m.a[:, :3])[0]
            a[:, 3:FREE] = _turned(angular, v[:, 3:FREE], -1.0)
            gain, force = gain * fault.gain, force * fault.force
        else:
            channels = fault.effect.undo(Channels(m.q[:, legs], m.v[:, legs], m.tau[:, legs]))
            assert channels.v is not None
            q[:, legs], v[:, legs], tau[:, legs] = channels.q, channels.v, channels.tau
            a[:, legs] = fault.effect.undo(Channels(m.a[:, legs], m.a[:, legs], m.tau[:, legs])).q
            scale /= float(np.exp(np.mean(np.log(np.abs(fault.effect.publish(np.ones((1, tau.shape[1] - FREE))))))))
        return replace(self, motion=replace(m, q=q, v=v, a=a, tau=tau), scale=scale, gain=gain, force=force)

    def every(self, step: int) -> Instants:
        """Each of so many."""
        own = np.arange(0, len(self.run), step)
        return replace(
            self, motion=_at(self.motion, _three(3 * own + 1)), run=self.run[own], pairs=tuple(x[own] for x in self.pairs)
        )

    @property
    def at_trunk(self) -> SmoothMotion:
        """The three samples of each with the accelerations of the trunk's origin."""
        a, w = np.array(self.motion.a), self.motion.v[:, 3:FREE]
        dw = _turned(a[:, 3:FREE], w, 1.0)
        a[:, :3] -= np.cross(dw, self.place) + np.cross(w, np.cross(w, self.place))
        return replace(self.motion, a=a)


def middles(motion: SmoothMotion) -> SmoothMotion:
    """Of three samples of each moment that of the moment itself."""
    return _at(motion, np.arange(1, len(motion.t), 3))


def _usable(motion: SmoothMotion, beside: int) -> NDArray[np.intp]:
    """Samples that may be used with so many on either side of them; none of a stretch that is shorter."""
    if len(motion.t) <= 2 * beside:
        return np.zeros(0, dtype=np.intp)
    spoiled = np.any(motion.spoiled > 1.0, axis=1).astype(float)
    near = np.convolve(spoiled, np.ones(2 * beside + 1), mode="valid")
    return np.flatnonzero(near == 0.0) + beside


def _moments(motion: SmoothMotion, own: NDArray[np.intp], imu: float, torque: float) -> SmoothMotion:
    """Three samples of each moment, those of IMU and torques so much later [s]."""
    three, period = _three(own), float(motion.t[1] - motion.t[0])
    out = _at(motion, three)
    late, after = three + round(imu / period), three + round(torque / period)
    v, a = out.v.copy(), out.a.copy()
    v[:, :FREE], a[:, :FREE] = motion.v[late, :FREE], motion.a[late, :FREE]
    return replace(out, v=v, a=a, tau=motion.tau[after])


def _three(own: NDArray[np.intp]) -> NDArray[np.intp]:
    return np.asarray(own[:, None] + np.arange(-1, 2), dtype=np.intp).ravel()


def _at(motion: SmoothMotion, rows: NDArray[np.bool_] | NDArray[np.intp]) -> SmoothMotion:
    return SmoothMotion(*(getattr(motion, name)[rows] for name in _CHANNELS))


def _turned(a: FloatArray, w: FloatArray, sign: float) -> FloatArray:
    """Angular accelerations from those of three turns at zero, one after the other, or back with -1, shape (N, 3)."""
    return a + sign * np.stack([w[:, 1] * w[:, 2], -w[:, 0] * w[:, 2], w[:, 0] * w[:, 1]], axis=1)
