"""What is expected of the drives of a robot's legs before any data, by its size."""

from __future__ import annotations

_TORQUE = 0.06
"""What a leg's joint holds while the robot stands, over a quarter of the weight and the cube root of the mass [m/kg^(1/3)]: bent
knees have a lever of 0.15 m on 16 kg."""
ROTOR, DRY, VISCOUS = 2e-3, 0.03, 0.01
"""Prior standard deviations over that torque: of the rotors' inertia [s^2], of dry friction, and of viscous friction [s].
That is 0.012 kg m^2, 0.18 N m and 0.06 N m s/rad on 16 kg; supposed, not measured on robots."""
OFFSET = 0.01
"""The same of a constant that the sensor of a torque adds: 0.06 N m on 16 kg, of motors whose current is measured; supposed."""


def standing_torque(mass: float) -> float:
    """What a joint of the legs of a robot of some mass [kg] holds while it stands [N m]."""
    return float(mass * 9.81 / 4.0 * _TORQUE * mass ** (1.0 / 3.0))
