"""URDFs of arms that no maker sells: a fleet of them needs nothing but this package."""

from __future__ import annotations

import numpy as np

_AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
_LENGTHS = (0.18, 0.36, 0.30, 0.08, 0.08, 0.06)
"""Of the links, as parts of the reach."""
_MASSES = (0.26, 0.32, 0.20, 0.10, 0.08, 0.04)
"""Of the links, as parts of the mass."""
_ALONG = ("z", "z", "x", "x", "x", "x")
_EFFORTS = (1.1, 1.6, 0.8, 0.20, 0.16, 0.10)
"""Limits, as parts of what it takes to hold the outstretched arm."""
_RANGES = (2.9, 1.7, 2.2, 2.9, 1.9, 2.9)
_GRAVITY = 9.81


def plain_arm(name: str, reach: float, mass: float) -> str:
    """URDF of an arm of six turning joints on a fixed base.

    Args:
        name: of the robot. reach: from the second joint to the tip [m]. mass: of all that moves [kg].
    """
    hold = 0.5 * mass * reach * _GRAVITY
    parts = [f'<robot name="{name}">', '  <link name="base_link"/>']
    parent, before = "base_link", "0 0 0.1"
    for i, (axis, part, along) in enumerate(zip(_AXES, _LENGTHS, _ALONG, strict=True), start=1):
        length, m = part * reach, _MASSES[i - 1] * mass
        thin = 0.5 * m * (0.06 * reach) ** 2
        long = m * (length**2 / 12.0 + 0.25 * (0.06 * reach) ** 2)
        inertia = {a: thin if a == along else long for a in "xyz"}
        end = f"{length:.6g} 0 0" if along == "x" else f"0 0 {length:.6g}"
        middle = f"{0.5 * length:.6g} 0 0" if along == "x" else f"0 0 {0.5 * length:.6g}"
        tensor = f'ixx="{inertia["x"]:.6g}" iyy="{inertia["y"]:.6g}" izz="{inertia["z"]:.6g}" ixy="0" ixz="0" iyz="0"'
        parts += [
            f'  <link name="link_{i}"><inertial><origin xyz="{middle}"/><mass value="{m:.6g}"/><inertia {tensor}/></inertial>'
            "</link>",
            f'  <joint name="joint_{i}" type="revolute"><parent link="{parent}"/><child link="link_{i}"/><origin xyz="{before}"/>'
            f'<axis xyz="{axis}"/><limit lower="-{_RANGES[i - 1]}" upper="{_RANGES[i - 1]}" '
            f'effort="{_EFFORTS[i - 1] * hold:.4g}" velocity="{np.pi:.4g}"/></joint>',
        ]
        parent, before = f"link_{i}", end
    parts += [
        '  <link name="tool0"/>',
        f'  <joint name="flange" type="fixed"><parent link="{parent}"/><child link="tool0"/><origin xyz="{before}"/></joint>',
        "</robot>",
    ]
    return "\n".join(parts) + "\n"


KINDS = {"small": (0.85, 14.0), "large": (1.3, 28.0)}
"""Reach [m] and moving mass [kg] of the kinds of which a fleet consists where no URDF is given."""
