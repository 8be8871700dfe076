"""Findings in words."""

from __future__ import annotations

from collections.abc import Sequence

from sysid_ros.diagnosis.result import Parameter

_FEW = 2
"""Joints up to which each number is stated by itself."""


def sentence(label: str, joints: Sequence[str], parameters: Sequence[Parameter], gain: float, of: int = 0) -> str:
    """One sentence for an engineer: what, where, how much, and what it gains; ``of`` is the number of the robot's joints."""
    where = f"all {of} joints" if len(joints) == of > _FEW else _listed(joints)
    if len(joints) > 1 and all(p.joint is None for p in parameters):
        where = "the whole arm"
    several = len(joints) > 1
    sizes = ", ".join(_ranges(parameters) if len(joints) > _FEW else [_size(p, several) for p in parameters])
    part = f"{100 * gain:.0f} %" if gain >= 0.005 else "less than 1 %"
    return f"{label[0].upper()}{label[1:]} on {where} ({sizes}) removes {part} of the held-out residual's power."


def _ranges(parameters: Sequence[Parameter]) -> list[str]:
    """The smallest and the largest of each number that every joint has."""
    by_name: dict[str, list[Parameter]] = {}
    for p in parameters:
        by_name.setdefault(p.name, []).append(p)
    out = []
    for name, group in by_name.items():
        if len(group) == 1 or isinstance(group[0].value, list | str):
            out += [_size(p, True) for p in group[:_FEW]] + (["..."] if len(group) > _FEW else [])
            continue
        unit = "" if group[0].unit == "1" else f" {group[0].unit}"
        values = [p.value for p in group]
        out.append(f"{name} = {min(values):.3g} to {max(values):.3g}{unit}")
    return out


def _size(p: Parameter, several: bool) -> str:
    unit = "" if p.unit == "1" else f" {p.unit}"
    name = f"{p.name} of {p.joint}" if several and p.joint else p.name
    if isinstance(p.value, str):
        return f"{name} = {p.value}"
    if isinstance(p.value, list):
        return f"{name} = ({', '.join(f'{v:.3g}' for v in p.value)}){unit}"
    spread = "" if p.std is None else f" ± {1.96 * p.std:.2g}"
    return f"{name} = {p.value:.3g}{spread}{unit}"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
