"""Ripple over the position, hidden."""

from __future__ import annotations

import numpy as np

from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class Cogging(HiddenCause):
    """``amp sin(harmonic q + phase)``."""

    id = "cogging"
    local = True
    counted = ("harmonic",)

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        harmonic, amplitude = float(c.rng.integers(8, 41)), c.share(0.04, 0.15) * c.torque[j]
        values = {"harmonic": ({j: harmonic}, "1/rev"), "amp": ({j: amplitude}, "N m")}
        return c.effect(self.id, [j], values, phase=[c.uniform(-np.pi, np.pi)])

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.add("ripple", effect.per_joint("amp"))
        true.put("ripple_harmonic", effect.per_joint("harmonic"))
        true.put("ripple_phase", dict(zip(effect.joints, effect.settings["phase"], strict=True)))
