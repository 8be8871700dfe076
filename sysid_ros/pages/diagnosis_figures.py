"""Figures of a diagnosis: torque measured and predicted, and what the model leaves against everything that could explain it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.gain import Tracking
from sysid_ros.diagnosis.result import Predictions
from sysid_ros.pages import palette
from sysid_ros.pages.compared_figure import compared, thinned
from sysid_ros.pages.figure import Axis, Curve, Figure, Mark, Panel, Stack, evenly
from sysid_ros.sample import FloatArray

_BAND = 8.0
"""Upper end of the band that is judged [Hz]."""
_CURVE_POINTS = 4000
_CLOUD_POINTS = 500
_MODELS = (("model as given", palette.NOMINAL), ("with the causes", palette.FOUND))
_TIME = Axis("time since the first stamp [s]", clock=True)
_NAMES = ("model as given", "measured", "with the causes")


def torque_figure(p: Predictions, units: Sequence[str]) -> Figure:
    """The measured torque, that of the nominal and of the extended model, a joint a panel."""
    x, channels = thinned(p.t, (p.nominal, p.measured, p.extended), _CURVE_POINTS)
    titles = [f"{name} [{unit}]" for name, unit in zip(p.joints, units, strict=True)]
    return compared(x + p.t[0], channels, _NAMES, titles, _TIME)


def tracking_error_figure(tracking: Tracking) -> Figure:
    """How far the simulated arm strays from the recorded motion under the measured torques, a joint a panel."""
    channels = tuple(1e3 * values for values in (tracking.before, tracking.perfect, tracking.after))
    titles = [f"{name} [mrad]" for name in tracking.joints]
    names = ("nominal model", "noise alone", "extended model")
    return compared(tracking.t, (channels[0], channels[1], channels[2]), names, titles, _TIME)


def residual_figure(p: Predictions, units: Sequence[str], floor: FloatArray) -> Figure:
    """The residual before and after, against position, velocity, acceleration, load, time, the temperature of the joint
    where one is known, and frequency; a joint a row.

    Args:
        floor: noise floor of each joint below 8 Hz, shape (n,) [N m].
    """
    against = {
        "position [rad]": p.q,
        "velocity [rad/s]": p.v,
        "acceleration [rad/s²]": p.a,
        "load [N m]": p.nominal,
        "time [s]": np.repeat(p.t[:, None], len(p.joints), axis=1),
    }
    if p.temperature is not None:
        against["temperature [°C]"] = p.temperature
    titles = [f"{name} [{unit}]" for name, unit in zip(p.joints, units, strict=True)]
    left = (p.measured - p.nominal, p.measured - p.extended)
    joints = range(len(titles))
    stacks = [_column(tuple(_cloud(x[:, j], left, j, name, titles[j]) for j in joints)) for name, x in against.items()]
    stacks.append(_column(tuple(_spectrum(left, j, p.t, float(floor[j]), titles[j]) for j in joints)))
    stacks.append(_column(tuple(_coherence(left, j, p, titles[j]) for j in joints)))
    return Figure(tuple(stacks), columns=4)


def _column(panels: tuple[Panel, ...]) -> Stack:
    return Stack(panels, shared=False, least=150.0)


def _cloud(x: FloatArray, left: tuple[FloatArray, FloatArray], j: int, name: str, title: str) -> Panel:
    if np.isnan(x).all():
        return Panel((), title, x=Axis(name, ticks=()), y=Axis(ticks=()), height=100.0, within="not recorded")
    keep = evenly(len(x), _CLOUD_POINTS)
    clouds = (
        Curve(x[keep], values[keep, j], label, colour, 0.0, marker="dot", size=3.0, opacity=0.45)
        for values, (label, colour) in zip(left, _MODELS, strict=True)
    )
    return Panel(tuple(clouds), title, x=Axis(name), height=100.0)


def _spectrum(left: tuple[FloatArray, FloatArray], j: int, t: FloatArray, floor: float, title: str) -> Panel:
    """Amplitude density below 10 Hz, [N m / sqrt(Hz)]."""
    from scipy import signal

    rate = 1.0 / float(np.median(np.diff(t)))
    curves = []
    for values, (label, colour) in zip(left, _MODELS, strict=True):
        f, power = signal.welch(values[:, j], rate, nperseg=min(len(values), int(8.0 * rate)))
        below = (f > 0.0) & (f < 10.0)
        curves.append(Curve(f[below], np.sqrt(power[below]), label, colour, 1.2))
    level = [Mark("y", floor / np.sqrt(_BAND), label="noise floor", dash="dotted")] if floor > 0.0 else []
    return Panel((*curves, *level), title, x=Axis("frequency [Hz]"), y=Axis(log=True), height=100.0)


def _coherence(left: tuple[FloatArray, FloatArray], j: int, p: Predictions, title: str) -> Panel:
    """Part of the power of the residual that goes along with the velocity, below 10 Hz."""
    from scipy import signal

    rate = 1.0 / float(np.median(np.diff(p.t)))
    curves = []
    for values, (label, colour) in zip(left, _MODELS, strict=True):
        f, share = signal.coherence(values[:, j], p.v[:, j], rate, nperseg=min(len(values) // 4, int(4.0 * rate)))
        below = (f > 0.0) & (f < 10.0)
        # 0/0 where one of the two has no power: nothing goes along with it there
        curves.append(Curve(f[below], np.nan_to_num(share[below]), label, colour, 1.2))
    return Panel(tuple(curves), title, x=Axis("coherence [Hz]"), y=Axis(limits=(0.0, 1.0)), height=100.0)
