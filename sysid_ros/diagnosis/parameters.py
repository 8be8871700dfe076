"""From linear parameters to the ones that an engineer knows: names, signs and units, with 95 % intervals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sysid_ros.diagnosis.evidence import interval
from sysid_ros.diagnosis.result import Parameter
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray


def parameters(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    """Parameters of a term.

    Args:
        values: theta of the term's columns, then its knobs in the order of the effect's ``knobs``, shape (p + k,).
        covariance: of them, shape (p + k, p + k).
    """
    return _READERS.get(term.id, _plain)(term, values, covariance)


def coulomb_part(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    """The Coulomb friction in any form of dry friction: the mean of both directions, where they differ."""
    if term.id == "asymmetric_coulomb_friction":
        unit = term.effect.units[0]
        return [_number("Fc", _joint(term), unit, lambda x: 0.5 * float(x[0] + x[1]), values, covariance)]
    return [p for p in parameters(term, values, covariance) if p.name == "Fc"]


def _number(
    name: str, joint: str | None, unit: str, f: Callable[[FloatArray], float], values: FloatArray, covariance: FloatArray
) -> Parameter:
    """A function of the values, by the delta method."""
    value = f(values)
    gradient = np.zeros(len(values))
    for i, spread in enumerate(np.sqrt(np.maximum(np.diag(covariance), 0.0))):
        step = np.zeros(len(values))
        step[i] = max(0.1 * float(spread), 1e-9 * max(abs(float(values[i])), 1e-6))
        gradient[i] = (f(values + step) - f(values - step)) / (2.0 * step[i])
    std = float(np.sqrt(max(float(gradient @ covariance @ gradient), 0.0)))
    return Parameter(name, joint, float(value), unit, std, *interval(value, std))


def _vector(name: str, joint: str | None, unit: str, parts: list[Parameter]) -> Parameter:
    return Parameter(
        name, joint, [p.value for p in parts], unit, [p.std for p in parts], [p.low for p in parts], [p.high for p in parts]
    )


def _joint(term: Term) -> str:
    return term.effect.robot.joint_names[term.joints[0]]


def _plain(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    """Linear parameters under their own names, then the knobs that are more than the width of a sign function."""
    joint = _joint(term) if term.row is not None or len(term.joints) == 1 else None
    units = term.effect.units
    out = [
        _number(name.split("[")[0], joint, units[i], lambda x, i=i: float(x[i]), values, covariance)  # type: ignore[misc]
        for i, name in enumerate(term.effect.parameter_names)
    ]
    for i, knob in enumerate(term.effect.knobs, start=term.p):
        if knob.name != "width":
            out.append(_number(knob.name, joint, knob.unit, lambda x, i=i: float(x[i]), values, covariance))  # type: ignore[misc]
    return out


def _scale(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    return [_number("gain", _joint(term), "1", lambda x: 1.0 + float(x[0]), values, covariance)]


def _stiffness(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    unit = "N/m" if term.effect.robot.is_prismatic[term.joints[0]] else "N m/rad"
    compliance = _number("stiffness", _joint(term), unit, lambda x: float(x[0]), values, covariance)
    # the interval of the compliance turned over: that of the stiffness is not symmetric, and without an upper end where no
    # compliance at all is in it
    low = 1.0 / compliance.high
    high = 1.0 / compliance.low if compliance.low > 0.0 else None
    value = 1.0 / compliance.value
    return [Parameter("stiffness", compliance.joint, value, unit, value**2 * compliance.std, low, high)]


def _backlash(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    return [_number("gap", _joint(term), "rad", lambda x: float(x[0]), values, covariance)]


def _body(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    out = [_number("mass", None, "kg", lambda x: float(x[0]), values, covariance)]
    parts = [
        _number("com", None, "m", lambda x, i=i: float(x[i] / x[0]), values, covariance)  # type: ignore[misc]
        for i in (1, 2, 3)
    ]
    out.append(_vector("com", None, "m", parts))
    if term.id == "payload_change":
        out.append(_number("t0", None, "s", lambda x: float(x[-1]), values, covariance))
        if name := term.effect.settings.get("recording"):
            out.append(Parameter("recording", None, name, ""))
    return out


def _force(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    parts = [_number("force", None, "N", lambda x, i=i: float(x[i]), values, covariance) for i in range(3)]  # type: ignore[misc]
    return [_vector("force", None, "N", parts)]


def _spring(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    joint, unit = _joint(term), term.effect.units
    if term.form == "line":
        return [
            _number("k", joint, unit[0], lambda x: float(x[0]), values, covariance),
            _number("q0", joint, "rad", lambda x: float(-x[1] / x[0]), values, covariance),
        ]
    return [
        _number("k", joint, unit[1], lambda x: float(np.hypot(x[0], x[1])), values, covariance),
        _number("q0", joint, "rad", lambda x: float(np.arctan2(-x[1], x[0])), values, covariance),
    ]


def _cogging(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    joint = _joint(term)
    return [
        _number("harmonic", joint, "1/rev", lambda x: float(x[2]), values, covariance),
        _number("amp", joint, term.effect.units[0], lambda x: float(np.hypot(x[0], x[1])), values, covariance),
    ]


def _link(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    joint = _joint(term)
    basis = np.eye(10)[:, : term.p] if term.basis is None else term.basis
    error, spread = basis @ values, basis @ covariance @ basis.T
    out = [_number("dm", joint, "kg", lambda x: float(x[0]), error, spread)]
    parts = [_number("dmc", joint, "kg m", lambda x, i=i: float(x[i]), error, spread) for i in (1, 2, 3)]  # type: ignore[misc]
    out.append(_vector("dmc", joint, "kg m", parts))
    return out


def _saturation(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    return [_number("limit", _joint(term), "N m", lambda x: float(x[1]), values, covariance)]


def _whole(term: Term, values: FloatArray, covariance: FloatArray) -> list[Parameter]:
    return [
        _number(name, None, unit, lambda x, i=i: float(x[i]), values, covariance)  # type: ignore[misc]
        for i, (name, unit) in enumerate(zip(term.effect.parameter_names, term.effect.units, strict=True))
    ]


_READERS: dict[str, Callable[[Term, FloatArray, FloatArray], list[Parameter]]] = {
    "torque_scale": _scale,
    "joint_elasticity": _stiffness,
    "backlash": _backlash,
    "payload": _body,
    "payload_change": _body,
    "external_force": _force,
    "spring": _spring,
    "cogging": _cogging,
    "link_inertia": _link,
    "torque_saturation": _saturation,
    "base_tilt": _whole,
    "gravity_compensated_effort": _whole,
    "time_delay": _whole,
}


def as_plain(value: Any) -> Any:
    """Numbers as Python's own."""
    return value.tolist() if isinstance(value, np.ndarray) else value
