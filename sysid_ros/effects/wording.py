"""Parameters in words: what an effect is told as."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.parameter import Parameter

_SMALL = {"s": ("ms", 1e3), "m": ("mm", 1e3), "rad": ("mrad", 1e3)}
"""Units that a small value is told in, and how many of them one is."""

_UNSEEN = 10.0
"""Times the largest component that half of a component's interval is from which no motion has shown it."""


def phrase(words: str, label: str, parameters: Sequence[Parameter], where: str) -> str:
    """``words`` with what stands in braces filled in.

    Args:
        words: {label}, {where}, {sizes} for all parameters, the name of a parameter for its values over the joints, {unmodelled}
            for which way the model is off, by their signs. where: the joints in words.
    """
    by_name: dict[str, list[Parameter]] = {}
    for p in parameters:
        by_name.setdefault(p.name, []).append(p)
    signs = {float(np.sign(p.value)) for p in parameters if isinstance(p.value, float | int)}
    unmodelled = "unmodelled" if signs <= {1.0} else "overestimated" if signs <= {-1.0} else "wrongly modelled"
    values = {name: size(group) for name, group in by_name.items()}
    sizes = ", ".join(f"{name} {text}" for name, text in values.items())
    return words.format_map({**values, "label": label, "where": where, "sizes": sizes, "unmodelled": unmodelled})


def size(parameters: Sequence[Parameter]) -> str:
    """Values of one name: one with its 95 % interval, several as a range."""
    first = parameters[0]
    if len(parameters) == 1 or (isinstance(first.value, str) and first.joint is None):
        return one(first)
    if isinstance(first.value, list | str):
        several = "; ".join(f"{one(p)} on {p.joint}" if p.joint else one(p) for p in parameters[:2])
        return several if len(parameters) == 2 else f"{several}; ..."
    values = [p.value for p in parameters]
    unit, factor = _unit(first.unit, max(values, key=abs))
    low, high = (format(factor * x, ".3g") for x in (min(values), max(values)))
    return f"{low}{unit}" if low == high else f"{low} to {high}{unit}"


def one(p: Parameter) -> str:
    """A parameter's value with its unit, and with half its 95 % interval where it is one number."""
    if isinstance(p.value, str):
        return p.value
    if isinstance(p.value, list):
        unit, factor = _unit(p.unit, max(p.value, key=abs))
        largest = max(max(abs(x) for x in p.value), 1e-12)
        digits = max(0, 2 - int(np.floor(np.log10(factor * largest))))
        seen = [1.96 * std <= _UNSEEN * largest for std in p.std or [0.0] * len(p.value)]
        texts = [f"{factor * x + 0.0:.{digits}f}" if told else "unseen" for x, told in zip(p.value, seen, strict=True)]
        return f"({', '.join(texts)}){unit}"
    unit, factor = _unit(p.unit, p.value)
    value, half = factor * p.value, 0.0 if p.std is None else 1.96 * factor * p.std
    if not half > 0.0:
        return f"{value:.3g}{unit}"
    digits = min(max(0, 1 - int(np.floor(np.log10(half)))), max(0, 3 - int(np.floor(np.log10(max(abs(value), half))))))
    return f"{value:.{digits}f} ± {half:.{digits}f}{unit}" if round(half, digits) > 0.0 else f"{value:.{digits}f}{unit}"


def listed(names: Sequence[str]) -> str:
    """Names as a sentence lists them."""
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)


def of_joints(names: Sequence[str], count: int) -> str:
    """Some of a robot's ``count`` joints in words."""
    if len(names) == count > 2:
        return f"all {count} joints"
    return listed(names) if len(names) <= 3 else f"{len(names)} of {count} joints ({listed(names)})"


def _unit(unit: str, value: float) -> tuple[str, float]:
    """A unit as it is written behind a number, and what the number is multiplied by."""
    small, factor = _SMALL.get(unit, (unit, 1.0)) if abs(value) < 0.1 else (unit, 1.0)
    return "" if small == "1" else f" {small.replace('^2', '²')}", factor


def percent(gain: float | None) -> str:
    """A share in per cent; a dash where there is none."""
    if gain is None:
        return "-"
    size = abs(gain)
    digits = 0 if size >= 0.0995 else 1
    return f"{100 * gain:.{digits}f} %" if size >= 0.0005 else "below 0.1 %" if size > 0.0 else "0 %"


def first_sentence(text: str) -> tuple[str, str]:
    """A text's first sentence, and what follows it."""
    first, stop, rest = text.partition(". ")
    return f"{first}." if stop else first, rest


def capital(text: str) -> str:
    """With a capital at its beginning."""
    return text[:1].upper() + text[1:]
