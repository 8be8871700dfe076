"""The one smoothed sign of a velocity: what dry friction turns with."""

from __future__ import annotations

import numpy as np

from sysid_ros.sample import FloatArray

TURNS = 0.02
"""Speed at which it has turned where nothing else is known [rad/s], [m/s] for slides. Noise of a velocity from an encoder of
1e-4 rad is 1e-3 rad/s behind a low-pass of 10 Hz, which must not make a column chatter; the Stribeck velocities of gears lie at
0.02 to 0.5 rad/s (Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, section 2.1), below which no static curve is right anyway."""

SLIDE = 0.1
"""Speed of a slide [m/s] that corresponds to 1 rad/s: on an arm of a tenth of a metre it is the same."""


def smoothed_sign(v: FloatArray, width: float | FloatArray = TURNS) -> FloatArray:
    """``tanh(v / width)``, of the shape of v: a velocity, or whatever else a torque turns with, and a width in its unit."""
    return np.asarray(np.tanh(v / width))


def smoothed_sign_slope(v: FloatArray, width: float | FloatArray = TURNS) -> FloatArray:
    """Its derivative by v, ``1 / (width cosh(v / width)^2)``."""
    return np.asarray((1.0 - np.tanh(v / width) ** 2) / width)
