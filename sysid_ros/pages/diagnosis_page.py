"""The report of a diagnosis: one HTML file that opens without a network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.diagnosis.gain import SimulationError
from sysid_ros.diagnosis.result import Diagnosis
from sysid_ros.effects import Parameter
from sysid_ros.effects.wording import capital, first_sentence, listed, percent
from sysid_ros.pages import palette
from sysid_ros.pages.ceiling_view import ceiling_view
from sysid_ros.pages.diagnosis_figures import residual_figure, torque_figure, tracking_error_figure
from sysid_ros.pages.diagnosis_view import diagnosis_view
from sysid_ros.pages.page import page
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.simulators import NAMES

_VERDICTS = {
    "explained": ("good", "These causes explain what the model gets wrong: hardly more than noise is left."),
    "partly_explained": (
        "fair",
        "These causes explain only a part, or are not all sure: see below what else was noticed.",
    ),
    "unexplained": ("poor", ""),
    "nothing_wrong": ("good", ""),
    "refused": ("poor", ""),
}
"""How good news a verdict is, and what it means where the answer does not say it."""
_CAUSES = (palette.BLUE, palette.ORANGE, palette.GREEN, palette.AMBER, palette.PINK, palette.SKY, palette.BROWN)
_REST = (palette.PALE, palette.SOFT, palette.GRID)
_SEEN = 5e-4
"""Part of the error from which it is shown, in tenths of a per cent."""
_MODELS = (("model as given", palette.NOMINAL), ("with the causes", palette.FOUND), ("noise", palette.PALE))


def diagnosis_page(
    result: Diagnosis,
    name: str,
    provenance: Mapping[str, object],
    robot: RobotModel | None = None,
    urdf: Path | None = None,
) -> str:
    """HTML of the report: the answer, faults of the data, what makes the error, figures, numbers, where they come from.

    Args:
        robot: to be shown. urdf: its file, beside which meshes are looked for.
    """
    p = result.predictions
    units = result.units or ["N m"] * len(result.joints)
    floor = result.torque.noise_floor if result.torque is not None else np.zeros(len(result.joints))
    chip, meaning = _VERDICTS[result.verdict]
    return page(
        "diagnosis.html",
        title=f"Diagnosis of {name}" if name else "Diagnosis",
        where=f"{_rows(result)}; {_judged_on(provenance)}." if result.joints else "",
        result=result,
        chip=chip,
        view=diagnosis_view(robot, urdf, result),
        meaning=" ".join(s for s in (meaning, first_sentence(result.refusal or "")[1], result.unexplained) if s),
        tiles=_tiles(result),
        ceiling=ceiling_view(result.ceiling),
        parts=_parts(result),
        likely=any(f.probability is not None for f in result.causes),
        models=[m for i, m in enumerate(_MODELS) if result.causes or i != 1],
        errors=_errors(result),
        numbers=[(f, [(q.joint or "", q.name, *_values(q)) for q in f.parameters]) for f in result.findings],
        torque=torque_figure(p, units) if p is not None else None,
        tracking=tracking_error_figure(result.tracking) if result.tracking is not None else None,
        simulation=_held(result.simulation),
        residual=residual_figure(p, units, floor) if p is not None else None,
        facts=[(key, ", ".join(map(str, v)) if isinstance(v, list) else str(v)) for key, v in provenance.items()],
    )


def recording_of(path: Path, result: Diagnosis, robot: RobotModel | None, urdf: Path | None = None) -> None:
    """Write the robot with what was found on it, the torques and the tracking error of the simulation over time, and what is
    left, for the viewer of Rerun.

    Args:
        path: the .rrd file. robot, urdf: as of :func:`diagnosis_page`.

    Raises:
        SettingsError: Rerun is not installed. OutputError: it can't be written.
    """
    from sysid_ros.pages.rerun_renderer import write_recording

    figures = []
    if (p := result.predictions) is not None:
        units = result.units or ["N m"] * len(result.joints)
        figures.append(replace(torque_figure(p, units), title="Torque"))
        if result.torque is not None:
            figures.append(replace(residual_figure(p, units, result.torque.noise_floor), title="What is left"))
    if result.tracking is not None:
        figures.append(replace(tracking_error_figure(result.tracking), title="Tracking error"))
    write_recording(path, figures, diagnosis_view(robot, urdf, result))


@dataclass(frozen=True)
class _Share:
    """A part of the error: a cause, or what stands beside the causes.

    Attributes:
        width: of its piece of the bar [%], 0 for what does harm. share, sure: in per cent. other: what it may be as well.
    """

    colour: str
    width: float
    share: str
    sure: str
    words: str
    main: bool = False
    other: str = ""
    remark: str = ""


def _parts(result: Diagnosis) -> list[_Share]:
    """The causes, and what else the error on held-out data is made of: the pieces of one bar."""
    rest = [] if result.rest is None else [(*x, _REST[i]) for i, x in enumerate(result.rest.in_words()) if abs(x[0]) >= _SEEN]
    gains = [*(f.heldout_gain or 0.0 for f in result.causes), *(part for part, _, _ in rest)]
    whole = max(sum(max(gain, 0.0) for gain in gains), 1e-12)
    widths = [100.0 * max(gain, 0.0) / whole for gain in gains]
    out = []
    for i, f in enumerate(result.causes):
        sure = "" if f.probability is None else f"{100 * f.probability:.0f} %"
        colour = _CAUSES[i] if i < len(_CAUSES) else palette.SOFT
        other = listed(f.look_alikes)
        out.append(_Share(colour, widths[i], percent(f.heldout_gain), sure, capital(f.words), f.headline, other, f.remark))
    for width, (part, words, colour) in zip(widths[len(result.causes) :], rest, strict=True):
        out.append(_Share(colour, width, percent(part), "", capital(words)))
    return out


def _errors(result: Diagnosis) -> list[dict[str, Any]]:
    """Of each joint its torque and the errors of both models and of the noise [N m], with their parts of the torque."""
    t = result.torque
    if t is None:
        return []
    values = np.stack([t.before, t.after, t.noise_floor])
    parts = values / np.maximum(t.torque, 1e-12)
    widths = 100.0 * parts / max(float(parts.max()), 1e-12)
    shown = [i for i in range(len(_MODELS)) if result.causes or i != 1]
    out = []
    for j, joint in enumerate(t.joints):
        bars = []
        for i in shown:
            name, colour = _MODELS[i]
            part = percent(parts[i, j]) if i < 2 else ""
            bars.append({"name": name, "colour": colour, "value": values[i, j], "part": part, "width": widths[i, j]})
        out.append(
            {"joint": f"{joint} ({result.units[j]})" if result.units else joint, "torque": float(t.torque[j]), "bars": bars}
        )
    return out


def _rows(result: Diagnosis) -> str:
    return (
        "force and moment on the whole robot" if result.units else f"{len(result.joints)} joint{'s' * (len(result.joints) != 1)}"
    )


def _judged_on(provenance: Mapping[str, object]) -> str:
    bags, others = (
        [Path(str(path)).name for path in found] if isinstance(found := provenance.get(key), list) else []
        for key in ("bags", "validate")
    )
    judged = f"judged on {', '.join(others)}, never fitted" if others else "judged on the last part of each, which was not fitted"
    return f"from {', '.join(bags) or 'recordings'}; {judged}"


def _tiles(result: Diagnosis) -> list[tuple[str, str]]:
    tiles = []
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
    intervals = ["–" if a is None and b is None else f"{_number(a)} to {_number(b)}" for _, a, b in values]
    return f"{', '.join(_number(v) for v, _, _ in values)}{unit}", intervals


def _number(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float | int) else "–" if value is None else str(value)
