"""Quantities: what a change of each parameter is called, what it costs and what to look at."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

CARRIED = "payload"
"""What is not a joint's: the thing at the tip."""


@dataclass(frozen=True, slots=True)
class Costs:
    """What errors on one joint cost in its bags' motions, None where the store does not tell.

    Attributes:
        joint: its name. torque: rms [N m]. lever: of the tip about it [m/rad]. per_zero: torque per error of its zero, where that
            is most [N m/rad]. per_mass: its torque per mass at the tip [N m/kg].
    """

    joint: str
    torque: float | None = None
    lever: float | None = None
    per_zero: float | None = None
    per_mass: float | None = None


@dataclass(frozen=True, slots=True)
class Quantity:
    """A parameter as people are told of it.

    Attributes:
        words: its name. unit: that it is shown in. factor: from SI to that. more, less: the kind of change where it grew or
            became smaller. cost: what a change of a size (SI) costs on a joint; of what is carried, on that which it costs most.
            look: at what.
    """

    words: str
    unit: str
    factor: float
    more: str
    less: str
    cost: Callable[[float, Costs], str]
    look: str


def _gain(d: float, on: Costs) -> str:
    size = f"{100.0 * abs(d):.2g} % of every torque that is read"
    return size if on.torque is None else f"{size}: {abs(d) * on.torque:.2g} N m in the usual motion"


def _zero(d: float, on: Costs) -> str:
    if on.lever is None or on.per_zero is None:
        return f"{1000.0 * abs(d):.2g} mm at the tip for each metre from this joint"
    return f"{1000.0 * abs(d) * on.lever:.2g} mm at the tip, {abs(d) * on.per_zero:.2g} N m in the usual motion"


def _mass(d: float, on: Costs) -> str:
    more = "more" if d > 0 else "less"
    if on.per_mass is None:
        return f"{9.81 * abs(d):.2g} N m {more} for each metre from the tip to a joint"
    return f"{abs(d) * on.per_mass:.2g} N m {more} on {on.joint} in the usual motion"


QUANTITIES: Mapping[str, Quantity] = {
    "coulomb_friction": Quantity(
        "Coulomb friction", "N m", 1.0, "friction grew", "friction fell",
        lambda d, on: f"{abs(d):.2g} N m {'more' if d > 0 else 'less'} at every motion",
        "gear, bearings, seals, grease, brake that drags",
    ),
    "viscous_friction": Quantity(
        "viscous friction", "N m s/rad", 1.0, "friction by speed grew", "friction by speed fell",
        lambda d, on: f"{abs(d):.2g} N m {'more' if d > 0 else 'less'} at 1 rad/s",
        "grease (age, amount, kind), temperature sensor, bearings",
    ),
    "torque_offset": Quantity(
        "torque offset", "N m", 1.0, "torque sensor's offset", "torque sensor's offset",
        lambda d, on: f"{abs(d):.2g} N m in every torque that is read",
        "zero of the torque sensor (tare), current sensor, a cable or hose that pulls",
    ),
    "torque_gain": Quantity(
        "torque gain", "%", 100.0, "torque sensor's gain", "torque sensor's gain",
        _gain,
        "torque constant, current sensor, motor magnets (heat), a drive that was exchanged",
    ),
    "joint_offset": Quantity(
        "zero of the joint", "deg", float(np.degrees(1.0)), "zero that slipped", "zero that slipped",
        _zero,
        "collisions at that time, coupling, belt, encoder, mastering; teach the zero anew",
    ),
    "rotor_inertia": Quantity(
        "rotor inertia", "kg m²", 1.0, "inertia of the drive", "inertia of the drive",
        lambda d, on: f"{10.0 * abs(d):.2g} N m at 10 rad/s²",
        "motor or gear that was exchanged, a brake disc, a filter of the velocity that was changed",
    ),
    "torque_delay": Quantity(
        "delay of the torque", "ms", 1e3, "delay", "delay",
        lambda d, on: f"{1e3 * abs(d):.2g} ms between position and torque",
        "bus and driver: firmware, cycle time, filters; clocks of the computers",
    ),
    "noise": Quantity(
        "noise of the torque", "N m", 1.0, "noise grew", "noise fell",
        lambda d, on: f"{abs(d):.2g} N m {'more' if d > 0 else 'less'} noise (standard deviation)",
        "cables and shields, play of the gear, something loose",
    ),
    CARRIED: Quantity(
        "mass at the tip", "kg", 1.0, "tool heavier", "tool lighter",
        _mass,
        "tool, gripper, hoses; the known payload in robots.yaml and in the controller",
    ),
}  # fmt: skip
"""Of every parameter of ``JOINT_PARAMETERS``, and of what is carried."""
