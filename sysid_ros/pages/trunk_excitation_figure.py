"""The figure of an exciting motion of a trunk: its pose, what joints and feet use of their limits, and its criterion."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sysid_ros.excitation.excite_trunk import TrunkExcitation
from sysid_ros.excitation.motion_limits import KINDS
from sysid_ros.pages import palette
from sysid_ros.pages.figure import Axis, Curve, Figure, Mark, Panel, Stack
from sysid_ros.pages.page import check_plot_path, write_plot

_POINTS = 600
_PERCENT = Axis(limits=(0.0, 112.0), ticks=tuple((float(x), f"{x}") for x in (0, 25, 50, 75, 100)))


def trunk_excitation_figure(excitation: TrunkExcitation, title: str) -> Figure:
    """Place and turns of the trunk, and over one period the largest use of what joints and feet are allowed."""
    trajectory, limits = excitation.trajectory, excitation.limits
    t = np.linspace(0.0, trajectory.basis.period, _POINTS)
    states = trajectory.sample(t)
    joints, feet = limits.of_states(limits.dynamics.of(*states))
    of_joints = np.abs(joints[:, : len(KINDS) * excitation.feet.base.legs.n])
    largest = 100.0 * of_joints.reshape(len(t), len(KINDS), -1).max(axis=2)
    names = excitation.feet.base.contact_frames
    time = Axis("time in a period [s]", (0.0, float(t[-1])), clock=True)
    end = (Mark("y", 100.0, dash="dashed"),)
    panels = [
        Panel(_curves(t, states[0][:, :3], ("x", "y", "z")), "Place of the trunk [m]", x=time, height=140.0),
        Panel(_curves(t, states[0][:, 3:], ("about x", "about y", "about z")), "Turns of the trunk [rad]", x=time, height=140.0),
        Panel(
            (*end, *_curves(t, largest, KINDS)), "Joints: largest use of what is allowed [%]", x=time, y=_PERCENT, height=140.0
        ),
        Panel(
            (*end, *_curves(t, np.maximum(100.0 * feet[:, : len(names)], 0.0), names)),
            "Feet: use of the friction cone [%]",
            x=time,
            y=_PERCENT,
            height=140.0,
        ),
    ]
    d = [c.d for c in excitation.random]
    headline = (
        f"D {excitation.criteria.d:.1f} (of {len(d)} random feasible motions: median {float(np.median(d)):.1f}, best {d[0]:.1f})"
    )
    return Figure((Stack(tuple(panels), least=480.0),), title, headline, columns=1, width=900.0, legends=True)


def _curves(t: np.ndarray, values: np.ndarray, names: tuple[str, ...]) -> tuple[Curve, ...]:
    return tuple(Curve(t, values[:, j], name, palette.MANY[j % len(palette.MANY)], 1.2) for j, name in enumerate(names))


def write_trunk_excitation(path: Path, excitation: TrunkExcitation, title: str) -> None:
    """Write the motion: .png, .svg or .pdf for a report; .html for a page that begins with the answer.

    Raises:
        SettingsError: the suffix is not known, or the folder is not there.
    """
    check_plot_path(path)
    answer = f"A motion of {excitation.trajectory.duration:g} s of the trunk over feet that stand."
    write_plot(path, trunk_excitation_figure(excitation, title), answer=answer, heading="The motion and its limits")
