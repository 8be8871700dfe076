"""The figure of control laws side by side: the tip's error and the mass that each believes in, over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.control.tracking_run import TrackingRun
from sysid_ros.pages import palette
from sysid_ros.pages.figure import Axis, Curve, Figure, Mark, Panel, Stack

_COLOURS = (palette.SOFT, *palette.MANY[:4])
_LEAST = 1e-3
"""Errors below this are drawn there, on a logarithmic axis [mm]."""


def tracking_figure(runs: Sequence[TrackingRun], events: Sequence[tuple[float, str]], mass: float) -> Figure:
    """Errors above, masses below.

    Args:
        runs: of the same scenario. events: t [s] and kind. mass: that is carried between pick and drop [kg].
    """
    end = max(float(run.t[-1]) for run in runs)
    time = Axis("time [s]", (0.0, end))
    errors, masses = [], []
    for run, colour in zip(runs, _COLOURS, strict=False):
        name = run.law.replace("_", " ").replace("slotine li", "Slotine-Li")
        errors.append(Curve(run.t, np.maximum(1e3 * run.tip_error, _LEAST), name, colour, 1.2))
        masses.append(Curve(run.t, run.mass, name, colour))
    masses.append(Curve(*_carried(events, mass, end), "truth", width=1.1, dash="dotted"))
    marks = tuple(Mark("x", t, kind) for t, kind in events)
    lines = tuple(Mark("x", t) for t, _ in events)
    above = Panel((*marks, *errors), "Distance of the tip from its path [mm]", x=time, y=Axis(log=True), height=300.0)
    below = Panel((*lines, *masses), "Mass that the law believes in [kg]", x=time, height=200.0)
    return Figure((Stack((above, below)),), "Control laws with a payload unknown to them", f"{mass:g} kg are picked up")


def _carried(events: Sequence[tuple[float, str]], mass: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the true mass over time."""
    times, masses = [0.0], [0.0]
    for t, kind in sorted(events):
        times += [t, t]
        masses += [masses[-1], mass if kind == "pick" else 0.0]
    return np.array([*times, end]), np.array([*masses, masses[-1]])
