"""The figure of an exciting motion: the motion, what it uses of its limits, and its criteria beside those of random motions."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sysid_ros.excitation.excite import Excitation
from sysid_ros.excitation.motion_limits import KINDS
from sysid_ros.pages import palette
from sysid_ros.pages.figure import Axis, Cells, Curve, Figure, Mark, Panel, Stack
from sysid_ros.pages.page import VIEW_SUFFIXES, check_plot_path, write_plot
from sysid_ros.pages.robot_view import RATE, Track, View, percentages, view

_TITLES = {"position": "Position", "velocity": "Velocity", "acceleration": "Acceleration", "torque": "Nominal torque"}
_POINTS = 1000
_PERCENT = Axis(limits=(-112.0, 112.0), ticks=tuple((float(x), f"{x}") for x in (-100, -50, 0, 50, 100)))


def excitation_figure(excitation: Excitation, title: str) -> Figure:
    """Positions, and the used part of the other limits, over time; criteria and margins beside them."""
    trajectory, limits = excitation.trajectory, excitation.limits
    t = np.linspace(0.0, trajectory.duration, _POINTS)
    q, v, a = trajectory.sample(t)
    use = 100.0 * limits.use(q, v, a, limits.torque(q, v, a))
    slides = limits.robot.is_prismatic
    unit = "m" if np.all(slides) else "rad" if not np.any(slides) else "rad or m"
    time = Axis("time from start [s]", (0.0, float(t[-1])), clock=True)
    ends = tuple(Mark("y", limit, dash="dashed") for limit in (-100.0, 100.0))
    motion = []
    for k, kind in enumerate(KINDS):
        values = q if k == 0 else use[k]
        curves = tuple(
            Curve(t, values[:, j], name, palette.MANY[j % len(palette.MANY)], 1.2)
            for j, name in enumerate(limits.robot.joint_names)
        )
        if k == 0:
            motion.append(Panel(curves, f"{_TITLES[kind]} [{unit}]", x=time, height=140.0))
        else:
            motion.append(Panel((*ends, *curves), f"{_TITLES[kind]} [% of what is allowed]", x=time, y=_PERCENT, height=140.0))
    beside = (_criteria(excitation), _largest_use(excitation))
    stacks = (Stack(tuple(motion), width=1.8, least=480.0), Stack(beside, shared=False, least=330.0))
    return Figure(stacks, title, _headline(excitation), columns=2, width=1240.0)


def write_excitation(path: Path, excitation: Excitation, title: str, urdf: Path | None = None) -> None:
    """Write the motion; a page also shows the robot that is to make it, and begins with the answer.

    Args:
        path: .png, .svg or .pdf for a report; .html for a page. urdf: the robot's file, beside which meshes are looked for.

    Raises:
        SettingsError: the suffix is not known, or the folder is not there.
    """
    check_plot_path(path)
    seen = _view(excitation, urdf) if path.suffix.lower() in VIEW_SUFFIXES else None
    d = [c.d for c in excitation.random]
    answer = (
        f"A motion of {excitation.trajectory.duration:g} s that tells more than each of {len(d)} random feasible ones."
        if d and excitation.criteria.d > d[0]
        else f"A feasible motion of {excitation.trajectory.duration:g} s; random ones tell as much."
    )
    write_plot(path, excitation_figure(excitation, title), answer=answer, heading="The motion and its limits", view=seen)


def _view(excitation: Excitation, urdf: Path | None) -> View | None:
    """The robot in the motion, before it makes it."""
    trajectory, robot = excitation.trajectory, excitation.limits.robot
    t = trajectory.grid(1.0 / RATE)
    limited = np.isfinite(excitation.limits.effort)
    used = [np.where(limited | (kind != "torque"), part, np.nan) for kind, part in zip(KINDS, excitation.use.limits, strict=True)]
    colourings = tuple(percentages(f"{kind}", part, 1.0) for kind, part in zip(KINDS, used, strict=True))
    caption = (
        "The motion that the robot is to make. Each joint has the colour of the largest part that it uses of its limit of one "
        "kind."
    )
    return view(robot, urdf, [Track("", t, trajectory.sample(t)[0])], caption, colourings=colourings)


def _headline(excitation: Excitation) -> str:
    """The criteria in a line, and what comes nearest to a collision."""
    d = [c.d for c in excitation.random]
    headline = (
        f"D {excitation.criteria.d:.1f} (of {len(d)} random feasible motions: median {float(np.median(d)):.1f}, "
        f"best {d[0]:.1f}), condition number {excitation.criteria.condition_number:.1f}"
    )
    if not excitation.pairs:
        return headline
    k = int(np.argmin(excitation.use.room))
    pair = " and ".join(excitation.pairs[k])
    return f"{headline}; nearest to a collision: {pair}, {1e3 * excitation.use.room[k]:.1f} mm more than they must keep"


def _criteria(excitation: Excitation) -> Panel:
    d = np.array([c.d for c in excitation.random if np.isfinite(c.d)])
    own = np.array([excitation.criteria.d])
    items = (
        Curve(d, np.zeros(len(d)), f"{len(d)} random feasible motions", palette.SOFT, 0.0, marker="bar", size=22.0),
        Curve(own, np.zeros(1), "this motion", palette.GREEN, 0.0, marker="diamond", size=12.0),
    )
    ends = np.array([*d, *own])
    room = 0.06 * float(np.ptp(ends)) + 1.0
    x = Axis("more is better", (float(ends.min()) - room, float(ends.max()) + room))
    return Panel(items, "D, log det of the information", x=x, y=Axis(limits=(-1.0, 1.0), ticks=()), height=80.0)


def _largest_use(excitation: Excitation) -> Panel:
    parts, limits = 100.0 * np.asarray(excitation.use.limits.T), excitation.limits
    limited = np.isfinite(limits.effort)
    texts = tuple(
        tuple(f"{x:.0f}" if KINDS[k] != "torque" or limited[i] else "–" for k, x in enumerate(row)) for i, row in enumerate(parts)
    )
    names = ("Pos.", "Vel.", "Acc.", "Torque")
    cells = Cells(parts, texts, limits.robot.joint_names, names, 130.0)
    return Panel((cells,), "Largest use of what is allowed [%]", height=40.0 + 36.0 * len(parts))
