"""Tolerances: every threshold of the search for exciting motions, with its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Numbers that decide something. What only costs time or rounding stands where it is used."""

    # What is kept
    step: float = 1e-3  # every limit is checked this often [s]: the cycle of the controllers of arms
    rounding: float = 1e-4  # part of a limit left for the rounding of what is written: joint angles have four digits in a file
    limit: float = 0.999  # part of a limit that the optimiser may use: the rest is for what lies between its samples
    under: float = 0.995  # the same where a motion is looked at every 10 ms: ``1 - (pi f dt)^2 / 2`` for f = 3 Hz
    depth: float = 0.1  # room between two links that counts as much as a whole limit [m]: about the radius of a link

    # What is distinguished
    visible: float = 1e-3  # combinations that show less are there only because a URDF rounds its angles to 1e-4 rad
    conditioned: float = 100.0  # condition number above which a motion is said not to be good enough (Gautier, Khalil 1992)
    smooth: float = 0.05  # part of the velocity limit in which dry friction's sign turns: a sine's between two samples
    leg_noise: float = 0.02  # Noise of a leg's torque over what it holds standing: 0.1 N m of 6, what the ripple of a gear leaves
    leg_rate: float = (
        20.0  # Rows a second that are independent [Hz]: twice the band in which trunks are moved and drives are quiet
    )

    # Where the search goes on from
    little: float = 1.0 / 3.0  # part of a random motion left within torques and collisions for its posture to be kept
    close: float = 0.998  # a motion shrunk no more than this is as large as it can be: two of the optimiser's own margins
    nearly_use: float = 1.05  # largest use of a limit from which another stage finds back: half of what shrinking repairs
    nearly_room: float = -0.02  # least room between links from which it does [m]: a fifth of ``depth``
    shrinking: float = 4.0  # most that shrinking costs in D a parameter: torques fall with it and with speed squared


TOLERANCES = Tolerances()
