"""Figures of the identification's report: torque measured and predicted, and what is left of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.identification.result import ResidualSeries
from sysid_ros.pages import palette
from sysid_ros.pages.compared_figure import compared, thinned
from sysid_ros.pages.figure import Axis, Curve, Figure, Panel, Stack, evenly, peaks
from sysid_ros.pages.residual_curves import class_means, spectrum
from sysid_ros.sample import FloatArray

_CURVE_POINTS = 40_000
"""Points of all curves of measured and predicted torque: the file stays small whatever was recorded."""
_CLOUD_POINTS = 500
_PARTS = 4.0
"""Recordings of a joint are pieced together with a gap of this [s]."""


def torque_figure(
    series: ResidualSeries, joints: Sequence[str], units: Sequence[str], share: float = 1.0, clock: bool = False
) -> Figure:
    """Measured and predicted torque, and that of the URDF alone, a joint a panel over the time of one recording.

    Args:
        share: part of the file's points that this figure may take. clock: its time is that of the robot on the page.
    """
    most = max(round(share * _CURVE_POINTS / (3 * len(joints))), 200)
    x, channels = thinned(series.t, (series.tau_nominal, series.tau_measured, series.tau_predicted), most)
    titles = [f"{name} [{unit}]" for name, unit in zip(joints, units, strict=True)]
    return compared(
        x, channels, ("URDF alone", "measured", "predicted"), titles, Axis("time since the first stamp [s]", clock=clock)
    )


def residual_figure(
    series: Sequence[ResidualSeries], joints: Sequence[str], units: Sequence[str], prismatic: Sequence[bool], cutoff_hz: float
) -> Figure:
    """The residual of all recordings against position, velocity, time and frequency, a joint a row.

    Points are samples, lines the mean over classes of equally many samples; rows in which the joint hardly moves are grey.
    """
    columns: tuple[list[Panel], ...] = ([], [], [], [])
    for j, (joint, unit) in enumerate(zip(joints, units, strict=True)):
        title, length = f"{joint} [{unit}]", "m" if prismatic[j] else "rad"
        residual = np.concatenate([s.residual[:, j] for s in series])
        limit = 1.15 * float(np.quantile(np.abs(residual), 0.995)) + 1e-12
        y = Axis(limits=(-limit, limit))
        q, v = (
            np.concatenate([values[:, j] for values in channel]) for channel in zip(*((s.q, s.v) for s in series), strict=True)
        )
        moving = np.concatenate([s.moving[:, j] for s in series])
        columns[0].append(Panel(_cloud(q, residual, moving), title, x=Axis(f"position [{length}]"), y=y, height=105.0))
        columns[1].append(Panel(_cloud(v, residual, moving), title, x=Axis(f"velocity [{length}/s]"), y=y, height=105.0))
        most = max(_CURVE_POINTS // (3 * len(joints) * len(series)), 200)
        columns[2].append(Panel(_over_time(series, j, most), title, x=Axis("time [s]"), y=y, height=105.0))
        spectra = _spectra(series, j, 1.5 * cutoff_hz)
        columns[3].append(Panel(spectra, title, x=Axis("frequency [Hz]"), y=Axis(log=True), height=105.0))
    widths = (0.24, 0.24, 0.3, 0.22)
    return Figure(
        tuple(Stack(tuple(c), shared=False, width=w, least=150.0) for c, w in zip(columns, widths, strict=True)), columns=4
    )


def _cloud(x: FloatArray, residual: FloatArray, moving: np.ndarray) -> tuple[Curve, ...]:
    items = []
    for where, label, colour, opacity in ((~moving, "hardly moves", palette.PALE, 0.6), (moving, "residual", palette.BLUE, 0.35)):
        chosen = np.flatnonzero(where)
        chosen = chosen[evenly(len(chosen), _CLOUD_POINTS)]
        items.append(Curve(x[chosen], residual[chosen], label, colour, 0.0, marker="dot", size=3.0, opacity=opacity))
    return (*items, Curve(*class_means(x[moving], residual[moving]), "mean", palette.INK, 1.8))


def _over_time(series: Sequence[ResidualSeries], j: int, most: int) -> tuple[Curve, ...]:
    start = np.cumsum([0.0, *(s.t[-1] - s.t[0] + _PARTS for s in series[:-1])])
    at = [peaks(s.residual[:, j], most) for s in series]
    return tuple(
        Curve(s.t[keep] - s.t[0] + begin, s.residual[keep, j], "residual", palette.BLUE, 1.0)
        for s, begin, keep in zip(series, start, at, strict=True)
    )


def _spectra(series: Sequence[ResidualSeries], j: int, top: float) -> tuple[Curve, ...]:
    times, period = [s.t for s in series], series[0].period
    items = []
    for values, label, colour in (
        ([s.tau_measured[:, j] for s in series], "torque", palette.PALE),
        ([s.residual[:, j] for s in series], "residual", palette.BLUE),
    ):
        frequency, density = spectrum(values, times, period)
        shown = frequency <= top
        items.append(Curve(frequency[shown], density[shown], label, colour, 1.5))
    return tuple(items)
