"""Tolerances: every threshold of the identification, with its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Numbers that decide something. What only costs time or rounding stands where it is used."""

    # Which effects are free
    usual: float = 0.5
    """an effect is free without being asked for where it is likelier there than not"""
    alternative: float = 0.25
    """another form of friction is asked for without a wish where one real joint in four has it"""
    better: float = 0.97
    """an effect must leave so much of the error on left-out data at most"""
    not_worse: float = 1.01
    """and at most so much in each split of the data"""
    sure: float = 3.0
    """and differ from nothing by so many standard deviations"""
    evidence: float = 3.84
    """chi-squared of one degree of freedom at 95 %: how much worse other values of a knob must be for the data to determine it"""
    alike: float = 0.5
    """neighbouring first values of a knob must share half of their curve, or the best value lies unseen between two"""

    # Priors
    part_std: float = 0.3
    """coefficient of friction by load and other parts of a torque: of Hamon, Gautier, Garrec 2010, figure 5"""
    inertia_std: float = 0.05
    """a rotor's inertia at the joint over the effort limit: 5 kg m^2 at 100 N m, above every arm's"""
    torque_std: float = 0.2
    """friction and offsets over the effort limit, per rad/s or 1: real joints have 0.02 to 0.1"""
    link_std: tuple[float, ...] = (0.5, 0.1, 0.1, 0.1, 0.03, 0.03, 0.03, 0.03, 0.03, 0.03)
    """a link's ten parameters over its mass: half the mass, 10 cm of com, 17 cm of radius of gyration"""
    least_link_mass: float = 0.5
    """mass that a link counts as at least for that [kg]"""
    usual_effort: float = 100.0
    """effort limit of a joint whose URDF states none [N m]"""

    # Rows
    slow: float = 0.06
    """"""
    slow_slide: float = 0.03
    """the same for a slide [m/s]"""
    slow_part: float = 0.1
    """"""
    shortest_recording: float = 2.0
    """"""
    moves: float = 0.05
    """"""

    # Cut-off of the low-pass
    torque_power: float = 0.995
    """"""
    cutoff_margin: float = 1.5
    """"""
    lowest_cutoff: float = 2.0
    """"""
    segment: float = 8.0
    """"""
    acceleration_bias: float = 1e-4
    """"""
    above_motion: float = 2.0
    """"""
    above_floor: float = 4.0
    """"""
    above_noise: float = 10.0
    """"""
    motion_power: float = 0.95
    """"""
    moved: float = 0.01
    """"""

    # Channels
    frozen: float = 0.5
    """"""
    frozen_runs: float = 10.0
    """"""
    nothing_measured: float = 0.5
    """"""
    frozen_position: float = 0.2
    """"""
    frozen_travel: float = 5.0
    """"""
    frozen_speed: float = 0.05
    """"""
    saturated: float = 0.03
    """"""
    saturated_runs: float = 5.0
    """"""
    outside: float = 0.05
    """"""
    outside_time: float = 0.01
    """"""

    # Effort against URDF, bag against bag
    judged_gravity: float = 0.15
    """"""
    judged_rows: int = 60
    """"""
    rows_alike: float = 8.0
    """"""
    slope_errors: float = 4.0
    """"""
    slope_flipped: float = -0.2
    """"""
    slope_low: float = 0.35
    """"""
    slope_high: float = 4.0
    """"""
    slope_suspicious: float = 1.8
    """"""
    follows_urdf: float = 0.5
    """"""
    follows_well: float = 0.8
    """"""
    contradicts: float = 2.0
    """"""
    contradicts_part: float = 0.08
    """"""
    contradicts_alone: float = 3.0
    """"""
    contradicts_part_alone: float = 0.10
    """"""
    contradicts_rows: float = 50.0
    """"""
    rows_as_one: float = 4.0
    """"""

    # Noise and fit
    converged: float = 1e-3
    """"""
    huber: float = 1.345
    """"""
    unknown_memory: float = 0.5
    """"""
    least_freedom: float = 0.05
    """"""
    fewest_rows: int = 8
    """"""
    white: float = 0.01
    """"""
    white_lags: int = 20
    """"""

    # How far the URDF's links are trusted
    seen: float = 1e-3
    """"""
    least_noise: float = 0.5
    """"""
    gain: float = 2e-3
    """"""
    firmer: float = 0.02
    """"""
    risk_allowed: float = 0.02
    """"""
    risk_cost: float = 5.0
    """"""
    risk_sure: float = 2.0
    """"""
    one_recording: float = 1.4
    """"""
    flattest: float = 1e-4
    """"""
    gyration: float = 0.3
    """"""
    spare_mass: float = 0.1
    """"""
    usual_length: float = 0.1
    """"""
    raised: float = 1e6
    """"""

    # What is said of the result
    determined: float = 0.9
    """"""
    shared: float = 0.5
    """"""
    rounding: float = 1e-4
    """"""
    uncertainty_left_out: float = 5e-3
    """"""
    payload_confidence: float = 0.99
    """"""
    friction_change: float = 0.2
    """"""
    well_conditioned: float = 100.0
    """"""
    seldom: float = 0.3
    """"""
    one_way: float = 0.1
    """"""
    changed: float = 3.0
    """"""


TOL = Tolerances()
