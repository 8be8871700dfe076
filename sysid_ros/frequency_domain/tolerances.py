"""Tolerances: every threshold of the checks in the frequency domain, with its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Numbers that decide something. What only costs time or rounding stands where it is used."""

    # The band
    highest: float = 40.0  # upper end of the band where none is asked for [Hz]: above the first oscillation of arms, 5 to 25 Hz
    of_rate: float = 0.2  # the same as a part of the rate: up to there differences of positions are accelerations within 1 %
    shortest: float = 4.0  # shorter stretches are left out [s]: a transient has more unknowns than there are lines at 1 Hz
    floor: tuple[float, float] = (0.2, 0.42)  # band of nothing but noise in positions, over the rate: below filters of drivers

    # Rests and periods
    stands: float = 0.004  # speed below which dry friction hides the torque [rad/s]: a fifth of that at which a sign has turned
    stands_slide: float = 0.001  # the same of slides [m/s]
    rest: float = 0.15  # shorter rests are reversals, and not bridged [s]
    moving: float = 0.3  # part of the time that a joint must move for a record to be used
    stiction: float = 4.0  # power of the misfit at rest over that in motion that is dry friction: an F test at 5 % is 3.84
    shortest_period: float = 1.0  # shortest period that is looked for [s]
    repeats: float = 2e-3  # mean square of q(t + T) - q(t), over twice the variance, of a motion that repeats: 6 % of its std
    leaves: float = 0.2  # the same, to be exceeded for some shorter lag: a joint that hardly moves repeats itself at every lag

    # The response
    level: float = 0.95  # of every interval
    spare: int = 6  # complex degrees of freedom that a window leaves at least for its noise: its variance is known within 40 %
    width: float = 0.06  # width of a window over its frequency where lines are dense: a pole with damping 0.03 is as wide
    input_noise: float = 0.1  # part of the input's power that may be noise: H is divided by one less it, and beyond not given
    misfit: float = 0.1  # of the response up to which a model is said to hold: what users ask of a torque
    mostly_smooth: float = 0.9  # part of the torque beside dry friction from which on a misfit is put down to the model

    # Causes
    step_up: float = 10.0  # gain of tempered BIC that a more complicated cause must bring: very strong (Kass, Raftery 1995)
    as_good: float = 6.0  # difference of it below which one cause can't be distinguished from another: strong evidence (the same)
    negligible: float = 0.05  # largest |H - 1| in the band that is not reported: half of what a model is held to
    held_out: float = 0.1  # part of the misfit on held-out lines that a cause must explain: not what was fitted by chance
    obvious: float = 200.0  # gain of BIC of a resonance that needs no held-out lines: it may be narrower than a window
    most_noise: float = 0.6  # part of the input's power that may be noise between other windows, as beside a resonance
    last_noise: float = 0.35  # the same of the last window
    lost: int = 2  # windows in a row that may have more: more of them end the band
    wrong_friction: float = 0.1  # part of dry friction that a model may have wrong at a reversal: its scatter on real gears
    beyond: float = 1.1  # part by which the band must go on above an oscillation: it is identified from both of its sides
    most_damped: float = 0.25  # damping of what is called an oscillation at most

    # Distortion and friction that is missing
    sure: float = 0.01  # p-value below which more than chance repeats itself
    harmonic: float = 1e-3  # power of a harmonic of a position over the largest one's from which on it is excited on purpose
    turns: tuple[float, float] = (0.003, 0.08)  # speeds at which dry friction may turn [rad/s]: of sharp and of soft gears
    friction: float = 0.2  # part of the misfit's power that sign(v) must explain beside v and an offset to be named first
    some_friction: float = 0.04  # the same where there is much viscous friction beside it
    all_friction: float = 0.5  # and what both must explain then: a late effort may look like v alone
    notable: float = 0.03  # size of it over the torque's root mean square: a third of what a model is held to

    # Modes
    small: float = 0.3  # part of the linear torque that the rest of the model may have for a motion to be called small
    coherent: float = 0.7  # coherence from which on a frequency carries a state-space model
    mostly: float = 0.6  # part of the windows up to a frequency that must carry it
    least_top: float = 3.0  # the state-space check needs a band up to this or more [Hz]: three times its lower end
    least_low: float = 1.0  # lower end of the band of the modes [Hz]: below it a gravity pole of the rigid model lies
    light: float = 0.5  # damping above which a pair of poles is no oscillation: it does not overshoot by more than a sixth
    cancels: float = 0.03  # relative distance of a pole and a zero that take each other away
    same: float = 0.2  # relative distance within which two frequencies of redrawn data are the same mode
    often: float = 0.9  # part of the redrawn data in which a mode must be found again: one in ten by chance
    mode_std: float = 0.15  # relative standard deviation of a frequency above which it is no finding

    # Sentences
    near: float = 1.2  # ratio of frequencies within which oscillations of two joints are one
    same_gain: float = 0.02  # a gain beside another cause is reported where it differs from 1 by more
    vague: float = 0.7  # half of the interval of a stiffness over its value from which on it is not reported
    through: float = 0.08  # damping above which a resonance may be that of another joint, which shows here through the arm
    as_a_delay: float = 0.1  # part by which a lag may differ from the delay that it is at low frequencies
    apart: float = 3.5  # standard deviations by which delays of joints that are one delay may differ: one in 2,000 by chance
    left: float = 1.5  # misfit over noise from which on a cause does not explain all


TOLERANCES = Tolerances()
