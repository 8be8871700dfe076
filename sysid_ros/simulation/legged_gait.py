"""LeggedGait: where the feet of a robot on four legs are wanted in the axes of its trunk."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sysid_ros.robot.rotation import rotation_of
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.quadruped_motion import TrunkMotion

LEGGED_GAITS = ("stand", "sway", "step", "crawl", "trot", "turn", "flying_trot")
"""All feet stand; the trunk moves over them; one foot after the other is lifted, in place and ahead; diagonal pairs, ahead and
turning on the spot; and with all feet in the air."""

_LIFT = 0.2
"""Height of a step as a part of the trunk's height."""
_BLEND = 1.0
"""Time in which a gait begins [s]."""
_SHIFT = 0.25
"""How far the trunk moves away from a foot that is to be lifted, as a part of the foot's distance."""
_SIDE, _LEANS = 0.33, 0.12
"""The same of a crawl, to the other side; and for which part of the cycle before and after the middle of a side's two steps the
trunk stays there."""
_CYCLES = {"step": (8.0, 0.94), "crawl": (5.0, 0.9), "trot": (0.55, 0.6), "turn": (0.55, 0.6), "flying_trot": (0.5, 0.42)}
"""Period of the cycle [s] of a robot of half a metre of leg, and share of it that a foot stands."""
_DIAGONAL = (0.0, 0.5, 0.5, 0.0)
_OFFSETS = {
    # the crawl's: hind left, front left, hind right, front right, so that the trunk goes from side to side once a cycle
    "step": (0.0, 0.5, 0.75, 0.25), "crawl": (0.61, 0.11, 0.75, 0.25),
    "trot": _DIAGONAL, "turn": _DIAGONAL, "flying_trot": _DIAGONAL,
}  # fmt: skip
_SPEEDS = {"crawl": 0.3, "trot": 1.0, "flying_trot": 1.0}
"""Of each gait, as a part of that which is asked for."""
_TURNS = {"crawl": 0.1, "trot": 0.2, "turn": 0.8, "flying_trot": 0.2}
"""Rate at which it turns at most [rad/s]; "turn" at least at half of it."""
_EVENS = 0.3
"""Time in which the trunk follows the mean height of the ground under its feet [s]."""
_USUAL_HEIGHT = 0.3
_FELT = 0.01
"""Time constant by which velocity and tilt are known [s], that of an estimate from joints and IMU; without one the wanted places
answer the forces of the same step, and light legs chatter from one step to the next."""


class LeggedGait:
    """Wanted places of the feet over time, for joints that hold their positions.

    Feet that stand move backward under the trunk as it walks; those that swing are set down where they keep the trunk over them
    (Raibert 1986, section 2): in front of the hip by half of a step and by what the velocity is off. Roll and pitch are held by
    legs that are made longer or shorter.

    Args:
        gait: one of :data:`LEGGED_GAITS`. feet: contact points of standing, in the trunk, shape (4, 3) [m].
        rng: of the sway and of the way that is walked. extent: factor on the sway. speed: of walking [m/s].
        end: when it stands again [s].

    Attributes:
        stands: which feet are wanted on the ground, shape (4,), bool.
    """

    _TILT, _TILT_SUM, _MOST = 0.4, 1.0, 0.25

    def __init__(
        self, gait: str, feet: FloatArray, rng: np.random.Generator, extent: float, speed: float, end: float = math.inf
    ) -> None:
        self.gait, self._feet = gait, feet
        self._height = float(-feet[:, 2].mean())
        small = self._height / _USUAL_HEIGHT
        self._small = math.sqrt(small)
        # gaits of smaller robots are faster, by the square root of their size (Alexander 1984)
        period, self.duty = _CYCLES.get(gait, (math.inf, 1.0))
        self.period = period * self._small
        # front left, front right, hind left, hind right, whatever the order of the feet
        place = 2 * (feet[:, 0] < feet[:, 0].mean()) + (feet[:, 1] < feet[:, 1].mean())
        self._offset = np.array(_OFFSETS.get(gait, (0.0,) * 4))[place]
        self._motion = TrunkMotion("sway" if gait == "sway" else "stand", self._height, rng, extent * small)
        walks = gait in _TURNS
        self._wanted = _SPEEDS.get(gait, 0.0) * speed * rng.uniform(0.4, 1.0) * rng.choice([-1.0, 1.0]) if walks else 0.0
        self._turn = _TURNS[gait] * rng.uniform(-1.0, 1.0) if walks else 0.0
        if gait == "turn":
            self._turn = 0.5 * (self._turn + math.copysign(_TURNS[gait], self._turn))
        self._end = end
        self._under, self._from, self._even = np.zeros(4), np.zeros(4), 0.0
        self._lifted_from, self._swings = feet[:, :2].copy(), np.zeros(4, dtype=bool)
        self._standing_at = feet[:, :2].copy()
        self._level, self._velocity, self._tilt = np.zeros(2), np.zeros(2), np.zeros(2)
        self.stands = np.ones(4, dtype=bool)

    def places(
        self, t: float, period: float, velocity: FloatArray, tilt: FloatArray, ground: Callable[[FloatArray], float] | None = None
    ) -> FloatArray:
        """Contact points of the feet at t [s], in the trunk, shape (4, 3) [m].

        Args:
            period: since the last call [s]. velocity: of the trunk in its own heading, shape (2,) [m/s].
            tilt: roll and pitch of the trunk, shape (2,) [rad].
            ground: its height at a place in the trunk, shape (2,) [m]; None: it is even.
        """
        blend = smooth(t / _BLEND) * smooth((self._end - t) / _BLEND)
        self._velocity += min(period / _FELT, 1.0) * (velocity - self._velocity)
        self._tilt += min(period / _FELT, 1.0) * (tilt - self._tilt)
        velocity, tilt = self._velocity, self._tilt
        if self.gait in ("stand", "sway"):
            return self._sway(t, smooth((self._end - t) / _BLEND))
        phase = (t / self.period + self._offset + 0.5 * self.duty) % 1.0
        swing = np.clip((phase - self.duty) / (1.0 - self.duty), 0.0, 1.0)
        swings = (phase >= self.duty) & (t > 0.0)
        stand = self.duty * self.period
        speed = blend * np.array([self._wanted, 0.0])
        out = self._feet.copy()
        across = np.column_stack([-self._feet[:, 1], self._feet[:, 0]])
        for i in range(4):
            moves = speed + blend * self._turn * across[i]
            if swings[i]:
                if not self._swings[i]:
                    self._lifted_from[i], self._from[i] = self._standing_at[i], self._under[i]
                goal = self._feet[i, :2] + 0.5 * stand * moves + (0.2 * self._small) * (velocity - speed)
                way = smooth(swing[i] / 0.85)
                self._standing_at[i] = self._lifted_from[i] + way * (goal - self._lifted_from[i])
                out[i, 2] += blend * _LIFT * self._height * math.sin(math.pi * min(swing[i] / 0.95, 1.0)) ** 2
                if ground is not None:
                    left = (1.0 - swing[i]) * (1.0 - self.duty) * self.period
                    self._under[i] = self._onto(float(swing[i]), self._from[i], ground(goal + left * velocity))
            else:
                self._standing_at[i] -= moves * period
            out[i, :2] = self._standing_at[i]
        self._swings, self.stands = swings, ~swings
        if self.gait == "step":
            out[:, :2] -= self._shift(phase, blend)
        elif self.gait == "crawl":
            out[:, 1] -= blend * self._aside(phase)
        self._even += min(period / _EVENS, 1.0) * (float(self._under.mean()) - self._even)
        out[:, 2] += self._under - self._even
        self._level = np.clip(self._level + self._TILT_SUM * period * tilt, -self._MOST, self._MOST)
        level = self._TILT * tilt + self._level
        out[:, 2] += out[:, 1] * level[0] - out[:, 0] * level[1]
        return out

    def _shift(self, phase: FloatArray, blend: float) -> FloatArray:
        """How far the trunk is to be from its middle, (2,) [m]: away from the foot that is lifted."""
        middle = 0.5 * (1.0 + self.duty)
        near = np.abs((phase - middle + 0.5) % 1.0 - 0.5)
        weight = np.array([smooth((0.18 - x) / 0.11) for x in near])
        return np.asarray(-_SHIFT * blend * (weight @ self._feet[:, :2]) / max(float(weight.sum()), 1.0))

    def _aside(self, phase: FloatArray) -> float:
        """How far the trunk is to be to the left [m]: on the side whose feet stand."""
        left = self._feet[:, 1] > self._feet[:, 1].mean()
        centre = 0.5 * (1.0 + self.duty)
        off = float(np.mean((phase[left] - centre + 0.5) % 1.0 - 0.5))
        # feet of one side are at most a quarter of the cycle apart, but where one of them has begun the cycle anew
        if np.ptp((phase[left] - centre + 0.5) % 1.0) > 0.5:
            off += 0.5
        away = min(abs(off), 1.0 - abs(off))
        side = 1.0 - 2.0 * smooth((away - _LEANS) / (0.5 - 2.0 * _LEANS))
        return -_SIDE * float(np.abs(self._feet[:, 1]).mean()) * side

    @staticmethod
    def _onto(swing: float, before: float, after: float) -> float:
        """Height of a foot's way from one step onto another at a share of its swing: up at first, down at last [m]."""
        share = smooth(swing / 0.5) if after > before else smooth((swing - 0.4) / 0.5)
        return before + share * (after - before)

    def _sway(self, t: float, blend: float) -> FloatArray:
        moved = blend * self._motion.sway(t) if self.gait == "sway" else np.zeros(6)
        return np.asarray((self._feet - moved[:3]) @ rotation_of(moved[3:]))


def smooth(u: float) -> float:
    """From 0 at 0 to 1 at 1 without a jump of velocity or acceleration."""
    u = min(max(u, 0.0), 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
