"""Tolerances: every threshold of the identification, with its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Numbers that decide something. What only costs time or rounding stands where it is used."""

    # Which effects are free
    usual: float = 0.5  # Likelier there than not: free without being asked for.
    alternative: float = 0.25  # One joint in four has it: tried by itself; 0.5: UR10e joint 3 from 2.4 to 4.2 % error.
    better: float = 0.97  # Chosen: error on left-out data that an effect must leave at most.
    not_worse: float = 1.01  # Chosen: and in each split of the data.
    sure: float = 3.0  # 3 sigma, 0.3 % by chance: how far an effect is from nothing; 6: UR10e joint 3 from 2.4 to 4.2 % error.
    evidence: float = 3.84  # Chi-squared of one degree of freedom at 95 %: how much worse other values of a determined knob are.
    alike: float = 0.5  # Part of their curve that neighbouring first values of a knob share: else the best lies unseen between.

    # Priors
    part_std: float = 0.3  # Gears lose up to three tenths of what they carry: standard deviation of a friction by load.
    inertia_std: float = 0.05  # A rotor at its joint over the effort limit [s^2/rad]: 5 kg m^2 at 100 N m, above every arm's.
    torque_std: float = 0.2  # Friction and offsets over the effort limit: real joints have 0.02 to 0.1.
    # A link's ten parameters over its mass: half the mass, 10 cm of com, 17 cm of radius of gyration.
    link_std: tuple[float, ...] = (0.5, 0.1, 0.1, 0.1, 0.03, 0.03, 0.03, 0.03, 0.03, 0.03)
    least_link_mass: float = 0.5  # A link that the URDF gives no weight may still have that of a flange [kg].
    usual_effort: float = 100.0  # Effort limit of a joint whose URDF states none, of an arm that carries some kilograms [N m].

    # Rows
    slow: float = 0.06  # Under it a joint presliding or with a Stribeck bump has other friction than any model says [rad/s].
    slow_slide: float = 0.03  # The same of a slide [m/s].
    slow_part: float = 0.1  # Part of a row that may come from such slow motion; 0.2: UR10e: other link weights, errors by 0.1 %.
    off_ground: float = 0.5  # Part of a row of a robot on legs in which its feet may not carry it: more of it than not they must.
    shortest_recording: float = 2.0  # Rows must cover some periods of the slowest motion that a robot is recorded in [s].
    moves: float = 0.05  # Part of the time that each joint must move: 1.5 s of 30, the least that shows both directions.

    # Cut-off of the low-pass
    torque_power: float = 0.995  # Chosen: part of a torque's power above its noise that lies under the cut-off.
    cutoff_margin: float = 1.5  # The Gaussian low-pass then leaves 86 % of the amplitude at the edge.
    lowest_cutoff: float = 2.0  # Chosen: a low-pass of half a second; slower ones leave few rows [Hz].
    segment: float = 8.0  # Of a spectrum: resolves 1/8 Hz, a sixteenth of the lowest cut-off [s].
    acceleration_bias: float = 1e-4  # Power of noise over that of motion in an acceleration: the part by which inertias shrink.
    above_motion: float = 2.0  # The cut-off over the band of the motion, where the low-pass then leaves 92 % of the amplitude.
    above_floor: float = 4.0  # Chosen: power of a line over the noise floor.
    above_noise: float = 10.0  # Chosen: the same for positions, whose noise in an acceleration grows with the fourth power of f.
    motion_power: float = 0.95  # Chosen: part of an acceleration's power that is its band.
    moved: float = 0.01  # Way of a joint above which it moved: half a degree [rad or m].

    # Channels
    frozen: float = 0.5  # Time for which a value must repeat exactly while the joint moves: 50 equal values at 100 Hz [s].
    frozen_runs: float = 10.0  # And so many times longer than the channel's values usually do: a coarse resolution repeats them.
    nothing_measured: float = 0.5  # Part of the motion, a half, from which on a frozen channel measures nothing.
    frozen_position: float = 0.2  # Chosen: time for which a position must stand while by its velocity the joint moved [s].
    saturated: float = 0.03  # Time for which the largest value must repeat exactly: three periods of 100 Hz [s].
    saturated_runs: float = 5.0  # Chosen: and times that the channel's values usually do.
    at_limit: float = 0.98  # Of a drive's greatest torque: torque constants are known to 2 %.
    outside: float = 0.05  # 3 degrees: by that zeros and soft limits differ [rad or m].
    outside_time: float = 0.01  # 1 % of the time beyond the limits is no glitch.

    # Effort against URDF, bag against bag
    judged_gravity: float = 0.15  # Chosen: a joint's gravity torque over the greatest, below which friction hides the slope.
    slope_flipped: float = -0.2  # A slope of 1 expected: torque against gravity by a fifth is no scale.
    slope_low: float = 0.35  # Chosen: no tool or balancer leaves a third of the weight, a current or a part of rated torque does.
    slope_high: float = 4.0  # Chosen: no tool makes an arm four times heavier, milliamperes do.
    slope_suspicious: float = 1.8  # Chosen: a tool that the arm may carry makes it less than twice as heavy.
    follows_urdf: float = 0.5  # Part of the torque that the URDF explains: with less than half it is more wrong than right.
    follows_well: float = 0.8  # Chosen: where a URDF's masses are doubtful, and said to be.
    contradicts: float = 2.0  # Chosen: residual of the common model over that of the bag's own; a gear that warmed up is below.
    contradicts_part: float = 0.08  # Chosen: and over the torque.
    contradicts_alone: float = 3.0  # Chosen: one joint alone must speak louder, being one of many.
    weights_differ: float = 0.02  # Weight of a robot on legs between bags: ten times what steps leave in it, 0.3 kg of 15 kg.
    rows_as_one: float = 4.0  # Rows that count as one where only the size of the residual is known: a period of the cut-off.

    # Noise and fit
    leg_error: float = 0.01  # Part of the torque of a leg in the air that is left without any noise, by impacts just before.
    step: tuple[float, float] = (0.2, 2.0)  # Periods of the gaits of robots on legs from a dog's size to a horse's [s].
    converged: float = 1e-3  # Change of the parameters in their own covariance: a thirtieth of a standard deviation.
    huber: float = 1.345  # 95 % efficient for Gaussian noise (Huber 1964).
    unknown_memory: float = 0.5  # Chosen: time for which an error keeps its sign where there are too few rows to see [s].
    least_freedom: float = 0.05  # Degrees of freedom that a fit leaves a frequency, at least: else noise is divided by nothing.
    fewest_rows: int = 8  # Chosen: fewest rows of which a variance is stated.
    white: float = 0.01  # P-value of the test of whiteness: 1 %.
    white_lags: int = 20  # Lags of that test: twenty periods of the cut-off.

    # How far the URDF's links are trusted
    trunk_weight: float = 100.0  # A trunk is off by a tenth: batteries, computers, what is mounted on it.
    leg_weight: float = 1000.0  # Links of legs are off by 3 %: cables and screws that drawings lack.
    seen: float = 1e-3  # Information over the prior's under which a direction is unseen: it changes the prior by a thousandth.
    least_noise: float = 0.5  # Least variance of a direction over what the weights say: the other half may have been fitted.
    gain: float = 2e-3  # Chosen: a fifth of a per cent of the error, for which no link's weight is changed.
    firmer: float = 0.02  # Chosen: log error that links held more firmly may cost, 1 % of the rms.
    risk_allowed: float = 0.02  # Part by which a joint's squared error may exceed the URDF links' by bad luck: 1 % of the rms.
    risk_cost: float = 5.0  # Chosen: price of every part beyond, finite: one joint must not keep all others from their gain.
    risk_sure: float = 2.0  # Standard deviations of bad luck: 2 sigma, 2.5 %.
    one_recording: float = 1.4  # Squared 2: the halves of one recording repeat their motion; elsewhere a fit is as wrong again.
    flattest: float = 1e-4  # Least second moment of a body over its greatest: a plate one hundredth as thick as long.
    gyration: float = 0.3  # Radius of gyration of a body of which the URDF has none, over the link's length: a rod's is 0.29.
    spare_mass: float = 0.1  # Chosen: mass of a link of which the URDF states none, over the median of the others.
    usual_length: float = 0.1  # Length of a link where no two joints are apart [m].
    raised: float = 1e6  # Chosen: rise of the prior's weight beyond which the data contradict every physical robot.

    # What is said of the result
    determined: float = 0.9  # Part of the information that comes from the bags: a tenth is the prior's.
    shared: float = 0.5  # Half and half.
    rounding: float = 1e-4  # Coefficients below it are the URDF's rounding, as of 1.5708 for a right angle.
    uncertainty_left_out: float = 5e-3  # Of the error's power, 7 % of a standard deviation: directions with less are not written.
    payload_confidence: float = 0.99  # Quantile of the chi-squared that a difference of two runs is a body.
    friction_change: float = 0.2  # Chosen: standard deviation of the part by which a gear's friction changes between two runs.
    well_conditioned: float = 100.0  # Chosen: condition number that is wanted of a designed motion.
    seldom: float = 0.3  # Chosen: part of the time that a joint should move for its friction.
    one_way: float = 0.1  # Chosen: part of the motion in the lesser direction, below which dry friction and offset are one.
    changed: float = 3.0  # Spread between bags over that within: 3 sigma.


TOL = Tolerances()
