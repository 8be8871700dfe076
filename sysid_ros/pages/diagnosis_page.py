"""The report of a diagnosis: one HTML file that opens without a network."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.diagnosis.result import Diagnosis, Finding, Parameter, SimulationError
from sysid_ros.pages.diagnosis_figures import residual_figure, torque_figure, tracking_error_figure
from sysid_ros.pages.page import page
from sysid_ros.simulation.simulators import NAMES

_VERDICTS = {
    "explained": "The causes below explain what the nominal model gets wrong.",
    "partly_explained": "The causes below explain a part of what the nominal model gets wrong; something else is left.",
    "unexplained": "The nominal model is wrong, and no cause that is known here explains it.",
    "nothing_wrong": "Nothing is wrong that these recordings could show: the model predicts the torques down to the noise.",
    "refused": "These recordings can't be judged.",
}


def diagnosis_page(result: Diagnosis, name: str, provenance: Mapping[str, object]) -> str:
    """HTML of the report: a paragraph in plain words, the causes, the figures, the numbers, where they come from."""
    p = result.predictions
    units = ["N m"] * len(result.joints)
    floor = result.torque.noise_floor if result.torque is not None else np.zeros(len(result.joints))
    return page(
        "diagnosis.html",
        title=f"Diagnosis of {name or 'robot'}",
        where=f"{len(result.joints)} joints; {_judged_on(provenance)}.",
        result=result,
        verdict=_VERDICTS[result.verdict],
        first=_first(result),
        worst=_worst(result),
        tiles=_tiles(result),
        parameters=[(f.label, q.joint or "", q.name, *_values(q)) for f in result.findings for q in f.parameters],
        torque=torque_figure(p, units) if p is not None else None,
        tracking=tracking_error_figure(result.tracking) if result.tracking is not None else None,
        simulation=_held(result.simulation),
        residual=residual_figure(p, units, floor) if p is not None else None,
        facts=[(key, ", ".join(map(str, v)) if isinstance(v, list) else str(v)) for key, v in provenance.items()],
    )


def _judged_on(provenance: Mapping[str, object]) -> str:
    bags, others = (
        [Path(str(path)).name for path in found] if isinstance(found := provenance.get(key), list) else []
        for key in ("bags", "validate")
    )
    judged = f"judged on {', '.join(others)}, never fitted" if others else "judged on the last part of each, which was not fitted"
    return f"from {', '.join(bags) or 'recordings'}; {judged}"


def _first(result: Diagnosis) -> dict[str, str] | None:
    """The first cause, where it is, and what comes after it."""
    if not result.findings or result.torque is None:
        return None
    first, *others = result.findings[:4]
    return {"label": first.label, "joints": _where(first, result), "then": _listed(tuple(f.label for f in others))}


def _worst(result: Diagnosis) -> dict[str, str] | None:
    """Error on held-out data of the joint that is furthest above its noise, before and after."""
    if not result.findings or result.torque is None:
        return None
    t = result.torque
    floor = np.maximum(t.noise_floor, 1e-12)
    most, left = int(np.argmax(t.before / floor)), int(np.argmax(t.after / floor))
    torque = max(float(t.torque[most]), 1e-12)
    return {
        "joint": result.joints[most],
        "before": _times(t.before[most] / floor[most]),
        "after": _times(t.after[most] / floor[most]),
        "parts": f"{100 * t.before[most] / torque:.2g} to {100 * t.after[most] / torque:.2g} %",
        "left": result.joints[left],
    }


def _tiles(result: Diagnosis) -> list[tuple[str, str]]:
    tiles = [(result.verdict.replace("_", " "), "verdict")]
    if result.torque is not None:
        weight = np.maximum(result.torque.noise_floor, 1e-12)
        before = float(np.sqrt(np.mean((result.torque.before / weight) ** 2)))
        after = float(np.sqrt(np.mean((result.torque.after / weight) ** 2)))
        tiles += [
            (str(len(result.findings)), "causes that earned their place"),
            (f"{before:.1f} → {after:.2f}", "error over noise floor, before and after"),
        ]
    if (s := result.simulation) is not None:
        angles = f"{_angle(s.position_rmse_before)} → {_angle(s.position_rmse_after)}"
        tiles.append((angles, f"tracking error of the simulation; noise alone makes {_angle(s.position_rmse_perfect)}"))
    return tiles


def _held(s: SimulationError | None) -> str:
    """What the figure of the tracking error shows, in words."""
    if s is None:
        return ""
    before, after, perfect = map(_angle, (s.position_rmse_before, s.position_rmse_after, s.position_rmse_perfect))
    return (
        f"{s.horizon_s:.0f} s of the held-out data in {NAMES[s.simulator]}. Each model gets the measured torques, and one and "
        f"the same controller (PD) keeps it on the recorded motion. It strays by {before} (rms) with the nominal model and by "
        f"{after} with the extended one; the noise of the torques alone, drawn here anew, makes {perfect}."
    )


def _angle(value: float) -> str:
    scale, unit = (1.0, "rad") if value >= 0.1 else (1e3, "mrad") if value >= 1e-4 else (1e6, "µrad")
    return f"{value * scale:.2g} {unit}"


def _values(p: Parameter) -> tuple[str, list[str]]:
    """A parameter with its unit, and the interval of each of its values."""
    values: list[tuple[Any, Any, Any]] = (
        list(zip(p.value, p.low, p.high, strict=True)) if isinstance(p.value, list) else [(p.value, p.low, p.high)]
    )
    unit = "" if p.unit == "1" else f" {p.unit}"
    return f"{', '.join(_number(v) for v, _, _ in values)}{unit}", [f"{_number(a)} to {_number(b)}" for _, a, b in values]


def _number(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float | int) else "–" if value is None else str(value)


def _listed(names: tuple[str, ...]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)


def _where(finding: Finding, result: Diagnosis) -> str:
    return "all joints" if len(finding.joints) == len(result.joints) > 2 else _listed(finding.joints)


def _times(ratio: float) -> str:
    return f"{ratio:.1f} times" if ratio < 10.0 else f"{ratio:.0f} times"
