"""Tolerances: every threshold of the search for exciting motions, with its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Numbers that decide something. What only costs time or rounding stands where it is used."""

    # What is kept
    step: float = 1e-3
    """every limit is checked this often [s]: the cycle of the controllers of arms"""
    rounding: float = 1e-4
    """part of a limit that is left for the rounding of what is written: joint angles have four digits in a file"""
    limit: float = 0.999
    """part of a limit that the optimiser may use: what is left is for what lies between its samples, or is shrunk away"""
    under: float = 0.995
    """the same where a motion is looked at every 10 ms: ``1 - (pi f dt)^2 / 2`` for f = 3 Hz"""
    depth: float = 0.1
    """room between two links that counts as much as a whole limit [m]: about the radius of a link"""

    # What is told apart
    visible: float = 1e-3
    """a combination of parameters that shows less beside the others is there only because a URDF rounds its angles to 1e-4 rad"""
    conditioned: float = 100.0
    """condition number above which a motion is said not to be good enough (Gautier, Khalil 1992)"""
    smooth: float = 0.05
    """part of a joint's velocity limit within which the sign of dry friction turns for a search by gradients: the share of a sine
    between two of its samples"""

    # Where the search goes on from
    little: float = 1.0 / 3.0
    """part of a random motion that must be left within torques and collisions for its posture to be kept"""
    close: float = 0.998
    """a motion that has to be shrunk no more than this is as large as it can be: two of the optimiser's own margins"""
    nearly_use: float = 1.05
    """largest use of a limit from which another stage finds back: half of what shrinking repairs"""
    nearly_room: float = -0.02
    """least room between links from which it does [m]: a fifth of ``depth``"""
    shrinking: float = 4.0
    """what shrinking a motion by a part costs at most in D for each parameter: torques of inertia fall by
    it and by speed squared, and D with their square"""


TOLERANCES = Tolerances()
