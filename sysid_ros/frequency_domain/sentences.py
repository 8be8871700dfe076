"""What a check found, in words for an engineer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid_ros.frequency_domain.causes import Cause, Parameter
from sysid_ros.frequency_domain.modes import Mode
from sysid_ros.frequency_domain.result import JointCheck, Response
from sysid_ros.frequency_domain.tolerances import TOLERANCES

_TWO_SIDED = 1.96


def with_sentences(checks: Sequence[JointCheck]) -> tuple[JointCheck, ...]:
    """The same with what was found in words; an oscillation that several joints show is put down to one of them."""
    return tuple(replace(check, sentences=_sentences(check, owner_of(check, checks))) for check in checks)


def common_findings(checks: Sequence[JointCheck]) -> tuple[str, ...]:
    """What several joints say alike: one lateness of all efforts, where their own agree within their intervals."""
    if any(_oscillation(check) for check in checks):
        return ()
    late = []
    for check in checks:
        cause = check.torque.cause if check.torque else None
        if cause is None or not cause.named:
            continue
        delay, cutoff = cause.parameter("delay"), cause.parameter("cutoff")
        if delay is not None and delay.low * delay.high > 0.0:
            late.append((delay.value, delay.std))
        elif cutoff is not None and "delay" in cause.cannot_be_told_from:
            value = 1.0 / (2.0 * np.pi * cutoff.value)
            # a lag is a delay at low frequencies only
            late.append((value, value * np.hypot(cutoff.std / cutoff.value, TOLERANCES.as_a_delay)))
    if len(late) < 2:
        return ()
    value, std = np.array(late).T
    weight = std**-2.0
    mean = float(np.sum(weight * value) / weight.sum())
    if np.any(np.abs(value - mean) > TOLERANCES.apart * std):
        return ()
    half = _TWO_SIDED / float(np.sqrt(weight.sum()))
    p = Parameter("delay", abs(mean), half / _TWO_SIDED, abs(mean) - half, abs(mean) + half, "s")
    word = "late" if mean > 0.0 else "early (or the positions are late)"
    return (f"The efforts of {len(late)} joints agree: they are {_pm(p, 1e3, 'ms')} {word}, as by one delay.",)


def owner_of(check: JointCheck, checks: Sequence[JointCheck]) -> str:
    """The joint whose oscillation this joint shows, by the largest part of its inertia that swings; "" where it shows none."""
    own = _oscillation(check)
    if own is None:
        return ""
    near = [(c, _oscillation(c)) for c in checks]
    group = [(c, o) for c, o in near if o is not None and max(o[0] / own[0], own[0] / o[0]) < TOLERANCES.near]
    return max(group, key=lambda item: item[1][1])[0].joint


def _oscillation(check: JointCheck) -> tuple[float, float] | None:
    """Frequency and the part of the torque that swings."""
    cause = check.torque.cause if check.torque else None
    if cause is None or cause.name.split("+")[-1] != "resonance" or not cause.named:
        return None
    frequency, ratio = cause.required("frequency"), cause.required("zero_ratio")
    return frequency.value, 1.0 - 1.0 / (1.0 + ratio.value) ** 2


def _sentences(check: JointCheck, owner: str) -> tuple[str, ...]:
    if check.torque is None:
        return (f"{check.joint}: not checked: {check.why_not}",)
    found = [_band(check.torque)]
    if check.friction is not None:
        unit = "N" if check.prismatic else "N m"
        amount = f"{_two_digits(check.friction.coulomb)} {unit} of dry friction"
        if check.friction.viscous > 0.0:
            amount += (
                f" and {_two_digits(check.friction.viscous)} {unit} s/{'m' if check.prismatic else 'rad'} of viscous friction"
            )
        part = 100.0 * check.friction.part
        found.append(f"the model lacks about {amount}, {part:.0f} % of the misfit; find it with 'sysid identify' first")
    if check.torque.cause is not None:
        found += _cause(check, check.torque.cause, owner)
    found += _distortion(check.torque, "N" if check.prismatic else "N m")
    if check.velocity is not None:
        found += _velocity(check.velocity)
    if check.modes is not None:
        found += [_mode(m) for m in check.modes.unmodelled]
    return tuple(f"{check.joint}: {sentence}." for sentence in found)


def _band(response: Response) -> str:
    v = response.verdict
    if v.holds_to is not None:
        text = f"the model holds to 10 % from {v.holds_from:.2g} to {v.holds_to:.2g} Hz"
        above = "; above, this motion does not tell"
        if v.fails_from is not None:
            above = f" and is off by more from {v.fails_from:.2g} Hz on"
        if v.fails_below is not None:
            above += f"; below {v.fails_below:.2g} Hz it is off, too, or disturbances move the joint more than what is asked for"
        return text + above
    if v.fails_from is not None:
        return f"the model is off by more than 10 % from {v.fails_from:.2g} Hz on, and in no lower band surely within it"
    return "this motion tells in no band whether the model holds to 10 %"


def _pm(p: Parameter, scale: float = 1.0, unit: str = "") -> str:
    """Value and half of the 95 % interval, rounded to two digits of the latter."""
    half = 0.5 * (p.high - p.low) * scale
    digits = max(0, 1 - int(np.floor(np.log10(half)))) if np.isfinite(half) and half > 0.0 else 3
    return f"{p.value * scale:.{digits}f} ± {half:.{digits}f}{unit and ' ' + unit}"


def _cause(check: JointCheck, cause: Cause, owner: str) -> list[str]:
    if cause.name == "nothing" or cause.effect < TOLERANCES.negligible:
        return []
    if cause.share < TOLERANCES.mostly_smooth:
        return ["what it misses in the rest can't be identified beside the dry friction, which makes most of its torque"]
    if not cause.explains:
        return ["no gain, delay, low-pass or spring explains what it misses"]
    parts = []
    gain, delay, cutoff = (cause.parameter(x) for x in ("gain", "delay", "cutoff"))
    if delay is not None and (cause.name == "delay" or delay.low * delay.high > 0.0):
        late = "late" if delay.value > 0.0 else "early (or the positions are late)"
        parts.append(f"effort is {_pm(replace(delay, value=abs(delay.value)), 1e3, 'ms')} {late}")
    if cutoff is not None:
        late_ms = 1e3 / (2.0 * np.pi * cutoff.value)
        parts.append(
            f"effort goes through a first-order low-pass at {_pm(cutoff, 1.0, 'Hz')}, which makes it {late_ms:.2g} ms late"
        )
    name = cause.name.split("+")[-1]
    if name in ("resonance", "anti_resonance"):
        parts.append(_second_order(check, cause, name, owner))
    if (
        gain is not None
        and (cause.name == "gain" or abs(gain.value - 1.0) > TOLERANCES.same_gain)
        and not gain.low <= 1.0 <= gain.high
    ):
        parts.append(f"effort is {_pm(gain)} times the model's torque")
    if not parts:
        return []
    text = "; ".join(parts)
    if cause.cannot_be_told_from:
        words = {"low_pass": "a first-order low-pass", "delay": "a delay", "gain": "a gain"}
        others = " or ".join(words.get(x, x.replace("_", "-").replace("+", " and a ")) for x in cause.cannot_be_told_from)
        text += f" (this motion does not tell it from {others})"
    if cause.misfit > TOLERANCES.left:
        text += f"; what is left is {np.sqrt(cause.misfit):.1f} times the noise"
    return [text]


def _second_order(check: JointCheck, cause: Cause, name: str, owner: str) -> str:
    frequency, damping = cause.required("frequency"), cause.required("damping")
    where = f"{_pm(frequency, 1.0, 'Hz')}, damping {damping.value:.2g}"
    if name == "anti_resonance":
        return f"anti-resonance at {where}: an elastic joint whose encoder stands on the link's side would do this"
    if owner and owner != check.joint:
        return f"resonance at {where}: that of {owner}"
    stiffness, half = stiffness_of(check, frequency)
    unit = "N/m" if check.prismatic else "N m/rad"
    size, what = (stiffness / 1e3, f"k{unit}") if stiffness >= 1e3 else (stiffness, unit)
    inertia = f"{'mass' if check.prismatic else 'inertia'} {check.inertia[0]:.2g} {'kg' if check.prismatic else 'kg m²'}"
    if check.inertia[1] > 0.05 * check.inertia[0]:
        inertia += f" (± {check.inertia[1]:.1g} over the motion)"
    about = f"about {_two_digits(size)} {what} (± {100.0 * half / stiffness:.0f} %)"
    if half > TOLERANCES.vague * stiffness:
        return f"resonance at {where}: an elastic joint, whose link inertia changes too much in this motion to tell the stiffness"
    through = "; so much damping may also mean that it is another joint's" if damping.value > TOLERANCES.through else ""
    return f"resonance at {where}: an elastic joint of {about} given the link {inertia}{through}"


def _two_digits(x: float) -> str:
    digits = max(0, 1 - int(np.floor(np.log10(max(abs(x), 1e-12)))))
    return f"{x:.{digits}f}"


def stiffness_of(check: JointCheck, frequency: Parameter) -> tuple[float, float]:
    """k = M (2 pi f)^2 less the stiffness of gravity, and half of its 95 % interval [N m/rad]: the spread of M over the motion
    counts as its error."""
    inertia, spread = check.inertia
    k = inertia * (2.0 * np.pi * frequency.value) ** 2
    part = np.hypot(2.0 * frequency.std / frequency.value, spread / max(inertia, 1e-12))
    return float(k - check.stiffness), float(_TWO_SIDED * part * k)


def _distortion(response: Response, unit: str) -> list[str]:
    d = response.distortion
    if d is None:
        return []
    if d.found:
        text = (
            f"not linear: {d.nonlinear:.2g} {unit} repeat in all {d.periods} periods without a smooth response to explain them "
        )
        text += f"(noise {d.noise:.2g} {unit})"
    else:
        text = f"no distortion above the noise of {d.noise:.2g} {unit} in {d.periods} periods"
    spare = [f"{x:.2g} {unit} ({kind})" for x, kind in ((d.even, "even"), (d.odd, "odd")) if x is not None]
    if spare:
        text += f"; on harmonics that were not asked for {' and '.join(spare)}"
    return [text]


def _velocity(response: Response) -> list[str]:
    cause = response.cause
    if cause is None or cause.name == "nothing" or cause.effect < TOLERANCES.misfit:
        return []
    delay, cutoff, gain = (cause.parameter(x) for x in ("delay", "cutoff", "gain"))
    if cutoff is not None:
        return [f"the published velocity goes through a first-order low-pass at {_pm(cutoff, 1.0, 'Hz')}"]
    if delay is not None:
        late = "late" if delay.value > 0.0 else "early"
        return [f"the published velocity is {_pm(replace(delay, value=abs(delay.value)), 1e3, 'ms')} {late}"]
    if gain is not None:
        return [f"the published velocity is {_pm(gain)} times the derivative of the position"]
    return []


def _mode(mode: Mode) -> str:
    kind = "poles" if mode.kind == "pole" else "zeros"
    return (
        f"a pair of {kind} at {mode.frequency:.3g} ± {_TWO_SIDED * mode.frequency_std:.1g} Hz, damping {mode.damping:.2g} ± "
        f"{_TWO_SIDED * mode.damping_std:.1g}, from torque to velocity, which the rigid model lacks"
    )
