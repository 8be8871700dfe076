"""Motion of a link behind a spring or a play, from the motion of its motor."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit

from sysid_ros.effects.effect import Depends, Effect, carrying
from sysid_ros.effects.traits import Scope
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion

_STEP = 0.02
"""Largest step of the integration, in radians of the spring's own oscillation: errors of its phase add up."""
_COARSE = 0.1
"""The same in a search, and on the flanks of a play, where a bounce is short."""
_MOST_STEPS = 100
_START = 0.1
"""Time over which the load, and its rate, are read that the spring bears at the start [s]."""


@njit(cache=True)  # type: ignore[untyped-decorator]
def _follow(
    load: FloatArray,
    by_q: FloatArray,
    by_v: FloatArray,
    inertia: FloatArray,
    period: float,
    steps: int,
    stiffness: float,
    damping: float,
    gap: float,
    start: float,
    speed: float,
) -> FloatArray:
    out = np.zeros((load.size, 3))
    half, h = 0.5 * gap, period / steps
    x, v = start, speed
    for i in range(load.size):
        k = min(i, load.size - 2)
        for s in range(steps + 1):
            part = s / steps + (i - k)
            torque = 0.0
            if abs(x) > half or gap == 0.0:
                torque = stiffness * (x - np.sign(x) * half) + damping * v
                if gap > 0.0 and torque * x < 0.0:
                    torque = 0.0  # a flank pushes and does not pull
            near, far = 1.0 - part, part
            light = 1.0 / (near * inertia[k] + far * inertia[k + 1])
            carried = near * load[k] + far * load[k + 1] - (near * by_q[k] + far * by_q[k + 1]) * x
            carried -= (near * by_v[k] + far * by_v[k + 1]) * v
            a = (carried - torque) * light
            # half a step of velocity, a step of position, half a step of velocity (Verlet 1967)
            if s > 0:
                v += 0.5 * h * a
            if s == 0:
                out[i, 0], out[i, 1], out[i, 2] = x, v, a
            if s < steps:
                v += 0.5 * h * a
                x += h * v
    return out


def deflection(
    motion: Motion, joint: int, stiffness: float, ratio: float, gap: float = 0.0, side: int = 0, exact: bool = True
) -> FloatArray:
    """x = q_motor - q_link of one joint along a recording and its two derivatives, shape (N, 3) [rad, rad/s, rad/s^2].

    ``M x'' = ID_j(q - x, v - x', a) - T(x, x')``, M the joint's own entry of the mass matrix, to first order in x; all other
    joints move as recorded. ``T = k (x - sign(x) gap / 2) + d x'`` outside of the gap, where it only pushes.

    Args:
        motion: of the motors. joint: index.
        stiffness: k [N m/rad]. ratio: damping d over its critical value ``2 sqrt(k M)``. gap: play [rad].
        side: flank on which the link lies at the start: 1, -1, or 0 for the one that its load pushes it to.
        exact: False for longer steps, and for a spring under a load without the noise of the positions: through a spring that
            noise looks like a part of what it does to the torque.
    """
    by_q, by_v, inertia = _own(motion, joint)
    load, start, speed = _load(motion, joint, exact or gap > 0.0)
    usual, least = float(np.mean(inertia)), float(inertia.min())
    steps = _steps(stiffness, least, motion.period, exact and gap == 0.0)
    start, speed = start / stiffness + 0.5 * gap * (side or np.sign(start)), speed / stiffness
    damping = 2.0 * ratio * np.sqrt(stiffness * usual)
    inertia = np.maximum(inertia, _lightest(stiffness, damping, motion.period / steps))
    return np.asarray(
        _follow(load, by_q, by_v, inertia, motion.period, steps, stiffness, damping, gap, float(start), float(speed))
    )


def _own(motion: Motion, joint: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What a joint's own torque changes by with its position and velocity, and its inertia, shape (N,) each."""
    by_q, by_v, by_a = motion.own_sensitivity(joint)
    return by_q, by_v, np.maximum(by_a, 1e-9)


def _load(motion: Motion, joint: int, as_it_is: bool) -> tuple[FloatArray, float, float]:
    """A joint's load, shape (N,), its value at the start and its rate: the link follows its load there, and what it swings about
    that nobody knows."""
    load = np.ascontiguousarray(motion.link_torque[:, joint]) if as_it_is else motion.clear_load(joint)
    first = load[: max(2, round(_START / motion.period))]
    t = motion.period * (np.arange(len(first)) - 0.5 * (len(first) - 1))
    rise = float(t @ first) / float(t @ t)
    return load, float(np.mean(first)) + rise * float(t[0]), rise


def _steps(stiffness: float, least: float, period: float, fine: bool) -> int:
    """Of the integration between two samples. Args: least: the joint's least inertia."""
    own = np.sqrt(stiffness / least)
    return int(np.clip(np.ceil(own * period / (_STEP if fine else _COARSE)), 1, _MOST_STEPS))


def _lightest(stiffness: float, damping: float, step: float) -> float:
    """Inertia of a link that swings or comes to rest within about a step [s] of the integration. A lighter one, as links have
    that no body can be, follows at once, too, and would run away from it."""
    return max(stiffness * step**2, damping * step)


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _follow_each(
    load: FloatArray,
    by_q: FloatArray,
    by_v: FloatArray,
    inertia: FloatArray,
    period: float,
    steps: int,
    stiffness: FloatArray,
    damping: FloatArray,
    x: FloatArray,
    v: FloatArray,
) -> FloatArray:
    """As :func:`_follow` for several springs without play side by side, one step after the other; what each does to the joint's
    own torque, shape (N, c). Args: stiffness, damping: shape (c,). x, v: at the start, shape (c,), moved along."""
    out = np.zeros((load.size, stiffness.size))
    h = period / steps
    for i in range(load.size):
        k = min(i, load.size - 2)
        for s in range(steps + 1):
            far = s / steps + (i - k)
            near = 1.0 - far
            light = 1.0 / (near * inertia[k] + far * inertia[k + 1])
            force = (near * load[k] + far * load[k + 1]) * light
            pull = (near * by_q[k] + far * by_q[k + 1]) * light
            drag = (near * by_v[k] + far * by_v[k + 1]) * light
            kick = 0.5 * h if s > 0 else 0.0
            for c in range(stiffness.size):
                a = force - (pull + stiffness[c] * light) * x[c] - (drag + damping[c] * light) * v[c]
                v[c] += kick * a
                if s == 0:
                    out[i, c] = -(by_q[i] * x[c] + by_v[i] * v[c] + inertia[i] * a)
                if s < steps:
                    v[c] += 0.5 * h * a
                    x[c] += h * v[c]
    return out


def own_torques(motion: Motion, joint: int, stiffness: FloatArray, ratio: FloatArray) -> FloatArray:
    """What several springs do to the torque of their own joint, in a search and to first order, shape (c, N) [N m].

    Args:
        stiffness, ratio: as :func:`deflection` has them, shape (c,).
    """
    by_q, by_v, inertia = _own(motion, joint)
    load, start, speed = _load(motion, joint, False)
    usual, least = float(np.mean(inertia)), float(inertia.min())
    steps = np.array([_steps(float(k), least, motion.period, False) for k in stiffness])
    damping = 2.0 * ratio * np.sqrt(stiffness * usual)
    out = np.empty((len(stiffness), len(load)))
    for count in np.unique(steps):
        own = np.flatnonzero(steps == count)
        state = damping[own], start / stiffness[own], speed / stiffness[own]
        out[own] = _follow_each(load, by_q, by_v, inertia, motion.period, int(count), stiffness[own], *state).T
    return out


def torque_of(motion: Motion, joint: int, x: FloatArray, exact: bool) -> FloatArray:
    """What the links' torque changes by when one link lags by x, shape (N, n) [N m].

    ``ID(q - x, v - x', a - x'') - ID(q, v, a)``

    Args:
        x: with its two derivatives, shape (N, 3). exact: else to first order.
    """
    if not exact:
        by_q, by_v, by_a = (s[:, :, joint] for s in motion.sensitivity)
        return np.asarray(-(by_q * x[:, :1] + by_v * x[:, 1:2] + by_a * x[:, 2:]))
    one = np.eye(motion.robot.n)[joint]
    state = motion.q - x[:, :1] * one, motion.v - x[:, 1:2] * one, motion.a - x[:, 2:] * one
    return np.asarray(motion.robot.rnea_along(*state) - motion.rigid_torque)


def own_torque(motion: Motion, joint: int, x: FloatArray) -> FloatArray:
    """As :func:`torque_of` on the joint itself alone, to first order, shape (N,) [N m]."""
    return np.asarray(-sum(own * x[:, i] for i, own in enumerate(motion.own_sensitivity(joint))))


class Compliance(Effect):
    """A joint whose encoder stands on the motor's side, and whose link lags behind the motor by x.

    Attributes:
        around: size at which the columns are those of the moving link, torque over size; 0: of a link that follows its load at
            once, as one sample alone has it too.
        exact: False for the links' torque to first order in x.
        links: what the links' inertials, with all that they carry, differ by from the URDF's, shape (10 n,); empty for nothing. A
            link that is heavier swings slower on the same spring.
    """

    depends_on = frozenset({Depends.LOAD, Depends.LINKS})
    family = "compliance"
    scope = Scope.LINK
    companion = "rotor_inertia"
    around: float
    exact: bool

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), links: Sequence[float] = ()) -> None:
        super().__init__(robot, joints)
        self.links = [float(x) for x in links]
        self._arm = carrying(robot, self.links, self.id)

    @property
    def settings(self) -> dict[str, Any]:
        return {**super().settings, **({"links": self.links} if self.links else {})}

    @abstractmethod
    def lag(self, motion: Motion, joint: int) -> FloatArray:
        """x of a joint with its two derivatives along a recording, shape (N, 3)."""

    @abstractmethod
    def columns_at_once(self, motion: Motion) -> FloatArray:
        """Columns around 0, shape (N, n, p)."""

    def columns_along(self, motion: Motion) -> FloatArray:
        motion = self._carried(motion)
        if not self.around:
            return self.columns_at_once(motion)
        torques = [torque_of(motion, int(j), self.lag(motion, int(j)), self.exact) for j in self.joints]
        return np.stack(torques, axis=-1) / self.around

    def _carried(self, motion: Motion) -> Motion:
        return motion.carrying(self._arm) if self.links else motion

    def own_curve(self, motion: Motion) -> FloatArray:
        motion = self._carried(motion)
        joint = int(self.joints[0])
        lag = self.lag(motion, joint)
        return own_torque(motion, joint, lag) / self.around * self.clear(lag)

    def clear(self, lag: FloatArray) -> bool:
        """False for a lag, as of :meth:`lag`, that something simpler explains as well."""
        return True
