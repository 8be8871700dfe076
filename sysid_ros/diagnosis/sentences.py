"""Findings in words."""

from __future__ import annotations

from collections.abc import Sequence

from sysid_ros.diagnosis.result import Parameter


def sentence(label: str, joints: Sequence[str], parameters: Sequence[Parameter], gain: float) -> str:
    """One sentence for an engineer: what, where, how much, and what it buys."""
    where = "the whole arm" if len(joints) > 1 and all(p.joint is None for p in parameters) else _listed(joints)
    shown = parameters[:6]
    sizes = ", ".join(_size(p, len(joints) > 1) for p in shown) + (", ..." if len(parameters) > len(shown) else "")
    return f"{label[0].upper()}{label[1:]} on {where} ({sizes}) removes {100 * gain:.0f} % of the held-out residual's power."


def _size(p: Parameter, several: bool) -> str:
    unit = "" if p.unit == "1" else f" {p.unit}"
    name = f"{p.name} of {p.joint}" if several and p.joint else p.name
    if isinstance(p.value, list):
        return f"{name} = ({', '.join(f'{v:.3g}' for v in p.value)}){unit}"
    return f"{name} = {p.value:.3g} ± {1.96 * p.std:.2g}{unit}"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
