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

:class:`LineFit` fits them to the lines of one channel, weighted by their noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid_ros.frequency_domain.lines import ComplexArray, Record
from sysid_ros.frequency_domain.local_fit import Window, beside_basis, enough, smoothed_noise
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray

Shape = Callable[[FloatArray, FloatArray], ComplexArray]
FOLDS = 4
"""Every fourth window is held out in turn."""
_AT_ONCE = 40


@dataclass(frozen=True, slots=True)
class Form:
    """A family of transfer functions.

    Attributes:
        name: of the cause. shape: (parameters, f) -> H. parameters: names of what is searched for.
        logarithmic: whether the logarithm of each is searched. says: name and unit of what is reported, for each parameter.
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


class LineFit:
    """Lines of windows that tell something, ready for a fit.

    Args:
        records: of one channel. windows: of :func:`.local_fit.local_fit`.
    """

    def __init__(self, records: Sequence[Record], windows: Sequence[Window]) -> None:
        used = _useful(windows)
        noise = smoothed_noise(used)
        f, U, Y, N, fold, bases = [], [], [], [], [], []
        at, self.freedom = 0, 0.0
        for i, (window, s2) in enumerate(zip(used, noise + [_dry(records, w) for w in used], strict=True)):
            for record, here in zip(records, window.lines, strict=True):
                if not enough(record, len(here)):
                    continue
                f.append(record.f[here])
                U.append(record.U[here] / np.sqrt(s2))
                Y.append(record.Y[here] / np.sqrt(s2))
                N.append(record.input_noise[here] / s2)
                fold.append(np.full(len(here), i % FOLDS))
                basis = beside_basis(record, here, window.f, 0.5 * (window.high - window.low))
                self.freedom += len(here)
                if basis is not None:
                    bases.append((at, basis))
                    self.freedom -= basis.shape[1]
                at += len(here)
        self.count = at
        empty = np.zeros(0)
        self.f = np.concatenate(f) if f else empty
        self.share = float(np.sqrt(np.mean([w.share**2 for w in used]))) if used else 1.0
        self.input_noise = np.concatenate(N) if N else empty
        self.U, self.Y = (np.concatenate(x) if x else empty.astype(complex) for x in (U, Y))
        self.fold = np.concatenate(fold) if fold else empty
        self._beside = _together(bases, at)
        self._adjoint = self._beside.conj().T  # a fit asks for it thousands of times
        self._Y = self._clean(self.Y)

    def _clean(self, x: ComplexArray) -> ComplexArray:
        return np.asarray(x - self._beside @ (self._adjoint @ x))

    def residual(self, H: ComplexArray) -> ComplexArray:
        """Weighted misfit of the lines for the response H at them, shape (K,), or of several, shape (K, c)."""
        shape = (-1,) + (1,) * (H.ndim - 1)
        U, Y, noise = (x.reshape(shape) for x in (self.U, self._Y, self.input_noise))
        return np.asarray((Y - self._clean(H * U)) / np.sqrt(1.0 + np.abs(H) ** 2 * noise))

    def costs(self, form: Form, xs: Sequence[FloatArray]) -> FloatArray:
        """Sums of squares for several parameters, shape (c,); about the number of lines where one is right."""
        out = []
        for first in range(0, len(xs), _AT_ONCE):
            H = np.stack([form.H(x, self.f) for x in xs[first : first + _AT_ONCE]], axis=1)
            out.append(np.sum(np.abs(self.residual(H)) ** 2, axis=0))
        return np.concatenate(out)

    def fit(self, form: Form, starts: Sequence[FloatArray], lines: FloatArray | None = None) -> tuple[FloatArray, float]:
        """The best parameters (as searched) of a form and their cost; on some lines alone where a mask says so."""
        from scipy.optimize import least_squares

        used = np.ones(self.count, dtype=bool) if lines is None else lines.astype(bool)

        def misfit(x: FloatArray) -> FloatArray:
            r = self.residual(form.H(x, self.f))[used]
            return np.concatenate([r.real, r.imag])

        if not form.p:
            return np.zeros(0), float(np.sum(misfit(np.zeros(0)) ** 2))
        lower, upper = bounds(form, self.f)
        best, least = np.array(starts[0]), np.inf
        for start in starts:
            found = least_squares(misfit, np.clip(start, lower + 1e-9, upper - 1e-9), bounds=(lower, upper), x_scale="jac")
            if 2.0 * found.cost < least:
                best, least = found.x, 2.0 * float(found.cost)
        return best, least

    def jacobian(self, form: Form, x: FloatArray) -> FloatArray:
        """Derivatives of the misfit's real and imaginary parts, shape (2 K, p)."""
        out = []
        for i in range(form.p):
            step = np.zeros(form.p)
            step[i] = 1e-5 if form.logarithmic[i] or form.parameters[i] == "gain" else 1e-7
            d = self.residual(form.H(x + step, self.f)) - self.residual(form.H(x - step, self.f))
            out.append(np.concatenate([d.real, d.imag]) / (2.0 * step[i]))
        return np.stack(out, axis=1)


def _together(bases: Sequence[tuple[int, ComplexArray]], count: int) -> Any:
    """Orthonormal bases of what is beside the response, each on its own lines, as one sparse matrix (count, b)."""
    from scipy import sparse

    rows = [at + np.repeat(np.arange(len(Q)), Q.shape[1]) for at, Q in bases]
    first = np.cumsum([0, *(Q.shape[1] for _, Q in bases)])
    columns = [a + np.tile(np.arange(Q.shape[1]), len(Q)) for a, (_, Q) in zip(first, bases, strict=False)]
    values = [Q.ravel() for _, Q in bases]
    empty = [np.zeros(0, dtype=int)]
    where = (np.concatenate(rows or empty), np.concatenate(columns or empty))
    return sparse.csr_array(
        (np.concatenate(values or [np.zeros(0, dtype=complex)]), where), shape=(count, max(int(first[-1]), 1))
    )


def _dry(records: Sequence[Record], window: Window) -> float:
    """Power of a line that may be dry friction which the model has wrong, and which no response of its own follows."""
    parts = [np.abs(r.D[k, 0]) ** 2 for r, k in zip(records, window.lines, strict=True) if r.D is not None]
    return float(TOLERANCES.wrong_friction**2 * np.mean(np.concatenate(parts))) if parts and sum(map(len, parts)) else 0.0


def _useful(windows: Sequence[Window]) -> list[Window]:
    """Up to the last one in which motion prevails, without those in which there is next to none.

    A few of these in a row may stand beside a resonance; more of them end the band.
    """
    last, lost = -1, 0
    for i, window in enumerate(windows):
        lost = lost + 1 if window.input_noise >= TOLERANCES.most_noise else 0
        if lost > TOLERANCES.lost:
            break
        if window.input_noise < TOLERANCES.last_noise:
            last = i
    return [w for w in windows[: last + 1] if w.input_noise < TOLERANCES.most_noise]


def bounds(form: Form, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Limits of the parameters as they are searched, shape (p,) each, for lines at f (K,) [Hz]."""
    low, high = float(f.min()), float(f.max())
    inside = max(high / TOLERANCES.beyond, 2.0 * low)
    limits = {
        "gain": (0.05, 20.0),
        "delay": (-0.1, 0.1),
        "cutoff": (0.2 * low, 20.0 * high),
        "frequency": (1.5 * low, inside),
        "damping": (1e-3, TOLERANCES.most_damped),
        "zero_ratio": (0.02, 20.0),
    }
    pairs = np.array([limits[name] for name in form.parameters])
    return form.searched(pairs[:, 0]), form.searched(pairs[:, 1])
