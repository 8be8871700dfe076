"""TrackRows: the equation that ``track`` solves, at the rows behind the low-pass, and its derivatives by what is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid_ros.effects import CoulombFriction, Payload
from sysid_ros.fleet.known_robot import KnownRobot
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.identification.rows import BagRows, SmoothRecording
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion

DRY, VISCOUS, OFFSET, GAIN, ZERO, ROTOR, DELAY = range(7)
"""Places of a joint's parameters, in the order of :data:`.schema.JOINT_PARAMETERS` without the noise."""
EACH = len(JOINT_PARAMETERS) - 1
SLOW_PART = 0.02
"""Part of a row that may come from slow motion."""


@dataclass(frozen=True)
class TrackRows:
    """Rows of one bag for n joints and s payloads, one after the other in time::

        tau(t + d) = g T(t) + o + noise
        T = T_known + F s(v) + b v + J a - dT/dq delta + Y_payload theta

    s the smoothed sign, delta the error of the zeros, g a gain, o an offset, d a delay; g, o, d, F, b, J a joint each. All is
    what the robot has more than it is known by, but for the gain, which is over that of the model. Parameters stand as rows of
    (7, n) for the joints, then ten for each payload.

    Attributes:
        known: the robot. smooth: the recording behind the filter of its kinematics. motions: its stretches.
        rows: filtered rows with nothing free; ``rows.y`` is the torque that the known model leaves.
        changes: times at which what is carried changes, ascending [s since the first stamp].
        simple: sign, velocity and acceleration of each stretch, shape (M, 3, n). turned: -dT/dq, shape (M, n, n).
        body: columns of a body, shape (M, n, 10).
        filtered: the columns of friction, rotors and zeros at the rows, (N, 3, n) and (N, n, n), and of each payload, (N, s, n,
            10).
    """

    known: KnownRobot
    smooth: SmoothRecording
    motions: list[Motion]
    rows: BagRows
    changes: tuple[float, ...]
    simple: list[FloatArray]
    turned: list[FloatArray]
    body: list[FloatArray]
    filtered: tuple[FloatArray, FloatArray, FloatArray]

    @classmethod
    def of(cls, known: KnownRobot, smooth: SmoothRecording) -> TrackRows:
        """Of a recording in which nothing changes."""
        n, motions = known.robot.n, _motions(known, smooth)
        dry = CoulombFriction(known.robot)
        simple = [np.stack([dry.curve(m), m.v, m.a], axis=1) for m in motions]
        body = [Payload(known.robot, frame=known.frame).columns_along(m) for m in motions]
        turned = [_turned(known, m, (), np.zeros((1, 10))) for m in motions]
        nothing = (np.empty(0), np.empty(0), np.empty(0))
        made = cls(known, smooth, motions, smooth.rows(known.model, SLOW_PART), (), simple, turned, body, nothing)
        curves = _low_passed(smooth, [x.reshape(-1, 3 * n) for x in simple]).reshape(-1, 3, n)
        return replace(made, filtered=(curves, made._zeros(), made._bodies()))

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.known.robot.n

    @property
    def payloads(self) -> int:
        """Number of payloads, one more than the changes."""
        return len(self.changes) + 1

    @property
    def p(self) -> int:
        """Number of parameters."""
        return EACH * self.n + 10 * self.payloads

    def changing(self, changes: Sequence[float]) -> TrackRows:
        """The same rows where what is carried changes at these times [s since the first stamp]."""
        other = replace(self, changes=tuple(sorted(changes)))
        return replace(other, filtered=(*self.filtered[:2], other._bodies()))

    def around(self, theta: FloatArray) -> TrackRows:
        """The same rows with the columns of the zeros of an arm that carries what ``theta``, shape (p,), says."""
        bodies = theta[EACH * self.n :].reshape(-1, 10)
        other = replace(self, turned=[_turned(self.known, m, self.changes, bodies) for m in self.motions])
        return replace(other, filtered=(self.filtered[0], other._zeros(), self.filtered[2]))

    def linear(self, theta: FloatArray, delay: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives by the parameters, shape (N, n, p), and what is left of the torque, shape (N, n), at ``theta``.

        Args:
            theta: shape (p,). delay: by which the measured torque is taken back already, shape (n,) [s]; of ``theta``'s it is a
                part, and the columns of the delays are exact about it.
        """
        n, (curves, turned, bodies) = self.n, self.filtered
        joint, carried = theta[: EACH * n].reshape(EACH, n), theta[EACH * n :].reshape(-1, 10)
        gain = 1.0 + joint[GAIN]
        torque = self.rows.tau - self.rows.y + np.einsum("tcj,cj->tj", curves, joint[[DRY, VISCOUS, ROTOR]])
        torque += turned @ joint[ZERO] + np.einsum("tsjk,sk->tj", bodies, carried)
        rate = gain * _low_passed(self.smooth, self._torque(joint, carried), derivative=True)
        Y = np.zeros((len(torque), n, self.p))
        each, at = Y[:, :, : EACH * n].reshape(-1, n, EACH, n), np.arange(n)
        for place, curve in ((DRY, curves[:, 0]), (VISCOUS, curves[:, 1]), (ROTOR, curves[:, 2])):
            each[:, at, place, at] = gain * curve
        each[:, at, OFFSET, at] = 1.0
        each[:, at, GAIN, at] = torque
        each[:, at, DELAY, at] = -rate
        each[:, :, ZERO] = gain[:, None] * turned
        Y[:, :, EACH * n :] = (gain[:, None, None] * bodies.transpose(0, 2, 1, 3)).reshape(len(torque), n, -1)
        left = self._measured(delay) - gain * torque - joint[OFFSET] + rate * (joint[DELAY] - delay)
        return Y, left

    def _measured(self, delay: FloatArray) -> FloatArray:
        """The measured torque of later instants, shape (N, n)."""
        if not np.any(delay):
            return self.rows.tau
        later = [np.stack([np.interp(m.t + d, m.t, m.tau[:, j]) for j, d in enumerate(delay)], axis=1) for m in self.motions]
        return _low_passed(self.smooth, later)

    def _torque(self, joint: FloatArray, carried: FloatArray) -> list[FloatArray]:
        """T of each stretch, shape (M, n)."""
        out = []
        for m, simple, turned, body in zip(self.motions, self.simple, self.turned, self.body, strict=True):
            held = np.einsum("tjk,tk->tj", body, carried[_which(m.t, self.changes)])
            added = np.einsum("tcj,cj->tj", simple, joint[[DRY, VISCOUS, ROTOR]]) + turned @ joint[ZERO] + held
            out.append(self.known.model.torque_along(m) + added)
        return out

    def _zeros(self) -> FloatArray:
        n = self.n
        return _low_passed(self.smooth, [x.reshape(-1, n * n) for x in self.turned]).reshape(-1, n, n)

    def _bodies(self) -> FloatArray:
        """Columns of each payload while it is carried, shape (N, s, n, 10)."""
        n, parts = self.n, []
        for s in range(self.payloads):
            during = [_which(m.t, self.changes) == s for m in self.motions]
            values = [(x * now[:, None, None]).reshape(-1, 10 * n) for x, now in zip(self.body, during, strict=True)]
            parts.append(_low_passed(self.smooth, values).reshape(-1, n, 10))
        return np.stack(parts, axis=1)


def _which(t: FloatArray, changes: Sequence[float]) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Which of the payloads is carried at each time."""
    return np.searchsorted(np.asarray(changes, dtype=float), t, side="right")


def _turned(known: KnownRobot, motion: Motion, changes: Sequence[float], bodies: FloatArray) -> FloatArray:
    """-dT/dq along a motion of an arm that carries some bodies, one after the other, shape (M, n, n)."""
    which, n = _which(motion.t, changes), known.robot.n
    out = np.empty((len(motion.t), n, n))
    for s, body in enumerate(bodies):
        here = which == s
        out[here] = -known.arm(body).rnea_derivatives_along(motion.q[here], motion.v[here], motion.a[here])[0]
    return out


def _motions(known: KnownRobot, smooth: SmoothRecording) -> list[Motion]:
    """The smooth motion of each stretch at the rate of its filter, before the low-pass."""
    return [Motion(known.robot, s.t - smooth.start, s.q, s.v, s.a, s.tau) for s in smooth.stretches]


def _low_passed(smooth: SmoothRecording, values: Sequence[FloatArray], derivative: bool = False) -> FloatArray:
    """Values at the points of the motions, shape (M, c) for each, at the rows behind the low-pass, shape (N, c); or, with
    ``derivative``, their derivative by time there."""
    kernel, half = smooth.low_pass.slope if derivative else smooth.low_pass.kernel, smooth.low_pass.half
    at = [(given, m) for given, middle in zip(values, smooth.middles, strict=True) for m in middle]
    return np.array([kernel @ given[m - half : m + half + 1] for given, m in at]).reshape(-1, values[0].shape[1])
