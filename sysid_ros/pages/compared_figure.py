"""What was measured beside what two models say, a joint a panel: torques, or simulated positions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.pages import palette
from sysid_ros.pages.figure import Axis, Curve, Figure, Panel, Stack, evenly, with_gaps, without_gaps
from sysid_ros.sample import FloatArray


def compared(
    x: FloatArray,
    channels: tuple[FloatArray, FloatArray, FloatArray],
    names: tuple[str, str, str],
    titles: Sequence[str],
    axis: Axis,
    limits: Sequence[tuple[float, float]] | None = None,
) -> Figure:
    """The figure.

    Args:
        x: shape (N,); NaN between stretches. channels: nominal, measured and found, shape (N, n) each. names: of the three.
        titles: of the n panels, with units. axis: of x. limits: of each panel, where the curves do not decide.
    """
    styles = ((palette.NOMINAL, 1.3), (palette.MEASURED, 1.7), (palette.FOUND, 1.2))
    panels = tuple(
        Panel(
            tuple(Curve(x, v[:, j], name, c, w) for v, name, (c, w) in zip(channels, names, styles, strict=True)),
            title,
            x=axis,
            y=Axis(limits=None if limits is None else limits[j]),
            height=105.0,
        )
        for j, title in enumerate(titles)
    )
    return Figure((Stack(panels),))


def thinned(
    t: FloatArray, channels: tuple[FloatArray, FloatArray, FloatArray], most: int
) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
    """At most so many times since the first, and the channels there, both with NaN in gaps."""
    keep = evenly(len(t), most)
    gap = without_gaps(t[keep])
    x = with_gaps(gap, t[keep] - t[0])[0]
    first, second, third = (
        np.column_stack([with_gaps(gap, t[keep], values[keep, j])[1] for j in range(values.shape[1])]) for values in channels
    )
    return x, (first, second, third)
