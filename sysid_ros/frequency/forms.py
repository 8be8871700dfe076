"""What a model may miss, as a transfer function from its torque to the measured one; s = 2 pi i f.

    gain            g
    delay           g exp(-s d)
    low_pass        g / (1 + s / w)
    resonance       g (1 + b s + s^2 / z^2) / (1 + b s + s^2 / p^2),      b = 2 zeta / p,  z > p
    anti_resonance  g (1 + 2 zeta s / z + s^2 / z^2)

The last two are a joint of two masses, motor Jm and link M with a spring k and a damper b k between them (Spong 1987):
p^2 = k / M is the link's oscillation with the motor held, z^2 = k (M + Jm) / (M Jm) that of both against each other. Where the
encoder stands on the motor, torque of the rigid model M + Jm times H is the motor's torque; where it stands on the link, only the
zero is left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sysid_ros.frequency.lines import ComplexArray
from sysid_ros.sample import FloatArray

Shape = Callable[[FloatArray, FloatArray], ComplexArray]


@dataclass(frozen=True, slots=True)
class Form:
    """A family of transfer functions.

    Attributes:
        name: of the cause. shape: (parameters, f) -> H. parameters: names of what is searched for.
        logarithmic: whether the logarithm of each is searched.
        says: name and unit of what is reported, for each parameter.
        free_gain: whether the gain is one of them.
    """

    name: str
    shape: Shape
    parameters: tuple[str, ...]
    logarithmic: tuple[bool, ...]
    free_gain: bool

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    def H(self, x: FloatArray, f: FloatArray) -> ComplexArray:
        """The response at f (K,) [Hz] for parameters as they are searched, shape (p,)."""
        return self.shape(self.values(x), f)

    def values(self, x: FloatArray) -> FloatArray:
        """Parameters in their units from those that are searched."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, x, 0.0)), x)

    def searched(self, values: FloatArray) -> FloatArray:
        """The inverse of :meth:`values`."""
        return np.where(self.logarithmic, np.log(np.where(self.logarithmic, values, 1.0)), values)


UNITS = {"gain": "", "delay": "s", "cutoff": "Hz", "frequency": "Hz", "damping": "", "zero_ratio": "", "zero_damping": ""}


def _s(f: FloatArray) -> ComplexArray:
    return np.asarray(2j * np.pi * f)


def _gain(v: FloatArray, f: FloatArray) -> ComplexArray:
    return np.full(len(f), v[0], dtype=complex)


def _delay(v: FloatArray, f: FloatArray) -> ComplexArray:
    return np.asarray(np.exp(-_s(f) * v[0]))


def _low_pass(v: FloatArray, f: FloatArray) -> ComplexArray:
    return np.asarray(1.0 / (1.0 + 1j * f / v[0]))


def _resonance(v: FloatArray, f: FloatArray) -> ComplexArray:
    """v: frequency and damping of the pole, the zero's frequency over the pole's, less one."""
    x = f / v[0]
    loss = 2j * v[1] * x
    return np.asarray((1.0 + loss - (x / (1.0 + v[2])) ** 2) / (1.0 + loss - x**2))


def _anti_resonance(v: FloatArray, f: FloatArray) -> ComplexArray:
    x = f / v[0]
    return np.asarray(1.0 + 2j * v[1] * x - x**2)


def _times(one: Shape, count: int, other: Shape) -> Shape:
    return lambda v, f: np.asarray(one(v[:count], f) * other(v[count:], f))


def _forms() -> tuple[Form, ...]:
    plain = {
        "delay": (_delay, ("delay",), (False,)),
        "low_pass": (_low_pass, ("cutoff",), (True,)),
        "resonance": (_resonance, ("frequency", "damping", "zero_ratio"), (True, True, True)),
        "anti_resonance": (_anti_resonance, ("frequency", "damping"), (True, True)),
    }
    out = [
        Form("nothing", lambda v, f: np.ones(len(f), dtype=complex), (), (), False),
        Form("gain", _gain, ("gain",), (False,), True),
    ]
    for name, (shape, parameters, logarithmic) in plain.items():
        out.append(Form(name, shape, parameters, logarithmic, False))
        out.append(Form(name, _times(_gain, 1, shape), ("gain", *parameters), (False, *logarithmic), True))
    late, names, logs = plain["delay"]
    for name in ("resonance", "anti_resonance"):
        shape, parameters, logarithmic = plain[name]
        both = _times(_gain, 1, _times(late, 1, shape))
        out.append(Form(f"delay+{name}", both, ("gain", *names, *parameters), (False, *logs, *logarithmic), True))
    return tuple(out)


FORMS = _forms()
