"""Ripple over the position, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenCause, HiddenEffect, register_hidden


@register_hidden
class Cogging(HiddenCause):
    """``amp sin(harmonic q + phase)``."""

    id = "cogging"
    parameters = (("harmonic", "1/rev"), ("amp", "N m"))
    adds = (("ripple", "amp"),)
    puts = (("ripple_harmonic", "harmonic"), ("ripple_phase", "phase"))
    local = True
    counted = ("harmonic",)

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        sizes = [[c.rng.integers(8, 41)], [c.share(0.04, 0.15) * c.torque[j]]]
        return self.on(c, [j], sizes, phase=[c.uniform(-np.pi, np.pi)])

    def as_built(self, c: Circumstances) -> tuple[HiddenEffect, ...]:
        n = c.robot.n
        harmonics = np.round(np.exp(c.rng.uniform(np.log(8.0), np.log(100.0), n))).tolist()
        return (
            self.on(c, list(range(n)), [harmonics, c.of_effort(0.002, 0.008)], phase=c.rng.uniform(-np.pi, np.pi, n).tolist()),
        )
