"""The Bode diagrams of a frequency check: magnitude, phase and coherence of each joint, with the cause that was found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.frequency_domain import FrequencyCheck, JointCheck, Response
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.pages import palette
from sysid_ros.pages.figure import Axis, Band, Curve, Figure, Item, Mark, Panel, Spans, Stack
from sysid_ros.pages.page import VIEW_SUFFIXES, check_plot_path, write_plot
from sysid_ros.pages.robot_view import Track, View, percentages, view
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_SAYS = {"holds": palette.GREEN, "fails": palette.ORANGE, "untold": "#C8C8C8"}
_SMALLEST, _LARGEST = 0.1, 10.0
_POINTS = 400
_KNOWN = 0.5
"""Radius of the 95 % circle, over the response or 1, up to which a response is shown: beyond, gain and phase say nothing."""
_HERTZ = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_RATIOS = tuple((x, f"{x:g}") for x in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0))
_DEGREES = tuple((float(x), f"{x}") for x in (-180, -90, 0, 90, 180))


def write_frequency_plot(
    path: Path, result: FrequencyCheck, title: str, robot: RobotModel | None = None, urdf: Path | None = None
) -> None:
    """Write the response of each joint with its 95 % region, the cause that was found, and the coherence.

    Args:
        path: .png, .svg or .pdf for a report; .html for a page that holds all it needs.
        result: of :func:`sysid_ros.frequency_domain.check_frequency`. title: of the figure.
        robot: to be shown on a page. urdf: its file, beside which meshes are looked for.

    Raises:
        SettingsError: the suffix is not known, or the folder is not there. DataError: no joint has a response.
    """
    check_plot_path(path)
    if not _shown(result):
        raise DataError("There is no response to plot: no joint moves enough in these recordings.")
    sentences = (*result.sentences, *(s for c in result.joints for s in c.sentences))
    seen = _view(robot, urdf, result) if path.suffix.lower() in VIEW_SUFFIXES else None
    answer, heading = _answer(result), "Response of each joint"
    write_plot(path, frequency_figure(result, title), answer=answer, sentences=sentences, heading=heading, view=seen)


def _answer(result: FrequencyCheck) -> str:
    """On how many joints the model holds, and up to where, in a sentence or two."""
    within = f"within {100.0 * TOLERANCES.misfit:.0f} % with {100.0 * TOLERANCES.level:.0f} % confidence"
    holds = {c.joint: v.holds_to for c in result.joints if c.torque and (v := c.torque.verdict).holds_to is not None}
    fails = [c.joint for c in result.joints if c.torque and c.torque.verdict.fails_from is not None]
    off = f" It is off by more on {', '.join(fails)}." if fails else ""
    if not holds:
        return f"On no joint do these recordings show the model to hold {within}.{off}"
    low, high = min(holds.values()), max(holds.values())
    to = f"{low:.2g} Hz" if high < 1.05 * low else f"{low:.2g} to {high:.2g} Hz"
    return f"The model holds {within} on {len(holds)} of {len(result.joints)} joints, up to {to}.{off}"


def _view(robot: RobotModel | None, urdf: Path | None, result: FrequencyCheck) -> View | None:
    """The robot in the first recording, its joints in the colour of the misfit where it is surest."""
    if robot is None or result.postures is None:
        return None
    p = result.postures
    misfits = percentages("misfit", [_misfit(c) for c in result.joints])
    caption = (
        "The motion of the first recording. Each joint has the colour of its misfit |H − 1| in the band that is known best; "
        "grey: nothing is known."
    )
    return view(robot, urdf, [Track("", p.t - p.t[0], p.q)], caption, colourings=(misfits,))


def _misfit(check: JointCheck) -> float:
    """Of the band with the smallest 95 % circle, NaN where there is none."""
    bands = check.torque.verdict.bands if check.torque is not None else ()
    best = min(bands, key=lambda band: band.radius, default=None)
    return float("nan") if best is None else float(abs(best.H - 1.0))


def frequency_figure(result: FrequencyCheck, title: str) -> Figure:
    """For each joint magnitude, phase and coherence over frequency, up to four joints in a row."""
    checks = _shown(result)
    low, high = _span(checks)
    hertz = Axis("frequency [Hz]", (low, high), True, tuple((f, f"{f:g}") for f in _HERTZ if low <= f <= high))
    note = "1 says that the model holds; frequencies at which the motion does not stand clear of the noise are left out"
    columns = min(4, len(checks))
    stacks = tuple(_joint(check, hertz) for check in checks)
    return Figure(stacks, title, note, columns, width=90.0 + 350.0 * columns)


def _joint(check: JointCheck, hertz: Axis) -> Stack:
    assert check.torque is not None
    f = np.array([w.f for w in check.torque.windows])
    magnitude, phase = _bode(check.torque)
    fit_f, fit = np.zeros(0), np.zeros(0, dtype=complex)
    if (cause := check.torque.cause) is not None and cause.named:
        fit_f = np.geomspace(*cause.band, _POINTS)
        fit = cause.H(fit_f)
    size = np.clip(np.abs(fit), _SMALLEST, _LARGEST)
    seen = np.concatenate([magnitude[0][np.isfinite(magnitude[0])], size, [1.0]])
    limits = (max(min(0.45, seen.min() / 1.4), _SMALLEST), min(max(2.2, seen.max() * 1.4), _LARGEST))
    turn = float(np.degrees(np.arcsin(TOLERANCES.misfit)))
    above = _response(f, magnitude, (fit_f, size), (1.0 - TOLERANCES.misfit, 1.0, 1.0 + TOLERANCES.misfit))
    below = _response(f, phase, (fit_f, np.degrees(np.angle(fit))), (-turn, 0.0, turn))
    coherence = Curve(f, np.array([w.coherence for w in check.torque.windows]), colour=palette.SOFT, width=1.1, step=True)
    half = Axis(limits=(0.0, 1.03), ticks=((0.0, "0"), (0.5, "0.5"), (1.0, "1")))
    panels = (
        Panel(_verdict(check.torque, hertz), x=hertz, y=Axis(limits=(0.0, 1.0), ticks=()), height=8.0),
        Panel(above, "magnitude", x=hertz, y=Axis(limits=limits, log=True, ticks=_RATIOS), height=160.0),
        Panel(below, "phase [°]", x=hertz, y=Axis(limits=(-190.0, 190.0), ticks=_DEGREES), height=130.0),
        Panel((coherence,), "coherence", x=hertz, y=half, height=70.0),
    )
    return Stack(panels, check.joint, _short(check), least=260.0)


def _bode(response: Response) -> tuple[FloatArray, FloatArray]:
    """Magnitude and phase [degrees] with their lower and upper ends, shape (3, w) each.

    Windows in which the input is mostly noise, or whose 95 % circle is wider than half the response, are left out, as NaN.
    """
    judged = np.array([w.clear and w.radius < _KNOWN * max(abs(w.H), 1.0) for w in response.windows])
    H = np.where(judged, [w.H for w in response.windows], np.nan)
    radius, size = np.where(judged, [w.radius for w in response.windows], np.nan), np.abs(H)
    # where the circle holds 0 the phase is not known
    part = np.where(radius < size, radius / np.maximum(size, 1e-12), np.nan)
    width = np.degrees(np.arcsin(part))
    angle = np.where(np.isfinite(part), np.degrees(np.angle(H)), np.nan)
    return np.clip([size, size - radius, size + radius], _SMALLEST, _LARGEST), np.array([angle, angle - width, angle + width])


def _verdict(response: Response, hertz: Axis) -> tuple[Item, ...]:
    """The bands that the verdict tells apart, each in its colour."""
    low, high = hertz.limits or (0.0, np.inf)
    bands = [(max(b.low, low), min(b.high, high), b.says) for b in response.verdict.bands]
    items: list[Item] = []
    for says, colour in _SAYS.items():
        x = np.array([f for a, b, found in bands if found == says and a < b for f in (a, b, np.nan)])
        top = np.where(np.isfinite(x), 1.0, np.nan)
        items.append(Band(x, 0.0 * top, top, f"band: {says}", colour, 1.0))
    return tuple(items)


def _response(
    f: FloatArray, values: FloatArray, fit: tuple[FloatArray, FloatArray], held: tuple[float, float, float]
) -> tuple[Item, ...]:
    least, right, most = held
    # an area has no room about one window alone
    alone = np.isfinite(values[0]) & np.isnan(np.append(values[0][1:], np.nan)) & np.isnan(np.append(np.nan, values[0][:-1]))
    upright = np.column_stack([values[1], values[2], np.full(len(f), np.nan)])[alone].ravel()
    within = f"within {100.0 * TOLERANCES.misfit:.0f} % of 1"
    return (
        Spans("y", np.array([least]), np.array([most]), within, palette.GREEN, 0.12),
        Mark("y", right, colour="#888888", width=0.8),
        Band(f, values[1], values[2], "95 % region", palette.BLUE),
        Curve(np.repeat(f[alone], 3), upright, "95 % region", palette.BLUE, 2.5, opacity=0.35),
        Curve(f, values[0], "response", palette.BLUE, 1.3, marker="dot", size=3.5),
        Curve(*fit, "cause that was found", palette.ORANGE, 1.6),
    )


def _shown(result: FrequencyCheck) -> list[JointCheck]:
    """Joints with a response."""
    return [c for c in result.joints if c.torque is not None and c.torque.windows]


def _span(checks: Sequence[JointCheck]) -> tuple[float, float]:
    """Frequencies that the axes show [Hz]: a little more than what any joint tells."""
    windows = [w for c in checks if c.torque for w in c.torque.windows]
    clear = [w for w in windows if w.clear and w.radius < _KNOWN * max(abs(w.H), 1.0)] or windows
    fitted = [c.torque.cause.band[1] for c in checks if c.torque and c.torque.cause and c.torque.cause.named]
    return max(min(w.f for w in clear) / 1.15, 0.05), max([w.high for w in clear] + fitted) * 1.1


def _short(check: JointCheck) -> str:
    """The finding of a joint in a few words."""
    assert check.torque is not None
    v, cause = check.torque.verdict, check.torque.cause
    held = f"holds to {v.holds_to:.2g} Hz" if v.holds_to else "holds in no band"
    if check.friction is not None:
        return f"{held}; lacks dry friction"
    if cause is None or not cause.named:
        return held
    words = []
    for p in cause.parameters:
        if p.name in ("delay", "cutoff", "frequency") or (p.name == "gain" and cause.name == "gain"):
            words.append(f"{1e3 * p.value:.3g} ms" if p.name == "delay" else f"{p.value:.3g} {p.unit}".strip())
    return f"{held}; {cause.name.replace('_', '-').replace('+', ' and ')} {', '.join(words)}"
