"""What every finding keeps to: its evidence and its intervals come from the recordings.

A cause that is hidden larger, or in more recordings, has more evidence; its interval narrows with the root of the data and holds
the truth. The check is a function, and a value that is fixed by hand does not pass it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, product
from typing import Any

import numpy as np
import pytest
from robots import robot
from scipy import stats
from unsimulated import unsimulated as unsimulated

from sysid_ros.diagnosis import Finding, diagnose, fault_findings
from sysid_ros.diagnosis.channel_faults import fault_evidence
from sysid_ros.diagnosis.contacts import find_contacts
from sysid_ros.diagnosis.covariance import Gains, with_knobs
from sysid_ros.diagnosis.evidence import Evidence, bic_difference, count_interval, interval, log_p_value
from sysid_ros.diagnosis.fault_findings import message_finding, signal_findings
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared, prepare
from sysid_ros.diagnosis.signal_faults import lattice_of, lattices, velocity_lag
from sysid_ros.diagnosis.whose.robot_hypotheses import judge
from sysid_ros.effects import CHANNEL_EFFECTS, EFFECTS, Parameter
from sysid_ros.effects.parameter import CHAIN
from sysid_ros.input_gate.message_faults import find_message_faults
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.simulation.hidden_effects import (
    CAUSES,
    Circumstances,
    DiagnosisMotion,
    HiddenEffect,
    Noise,
    move,
    publish,
    realise,
    stiffening_for,
)
from sysid_ros.simulation.hidden_effects.channels import Signals

ARM, RATE = "small_arm", 250
LITTLE, MUCH = 1, 4
SMALL, LARGE = 0.4, 1.0
NOISE = 0.03
# what Circumstances do not scale
SIZES: dict[str, dict[str, tuple[float, float]]] = {
    "velocity_lag": {"cutoff": (10.0, 4.0)},
    "torque_quantisation": {"step": (0.1, 0.4)},
    "torque_unit": {"factor": (0.737562, 1000.0)},
}
# a sign, an order, gravity: they are there or not
WITHOUT_SIZE = {"torque_sign", "joint_sign", "joint_order", "gravity_compensated_effort"}
# steps are known to what a double holds, whatever the data; each event has parameters of its own; a gear is a linear spring, or
# has flanks that are alike, to a part of its stiffness or gap that stands in `covariance`, and more data makes it no more of one
AS_SURE_AS_BEFORE = {"torque_quantisation", "payload_change", "joint_elasticity", "backlash"}
# what these equations leave of a large deflection is no noise: it scatters from one stretch of time to the next, and evidence
# that scatters counts for less
SCATTERS_WITH_SIZE = {"joint_elasticity", "backlash", "payload_change"}

INSIDE = [id_ for id_, cause in CAUSES.items() if not cause.outside]
"""Causes that a diagnosis can name."""


@dataclass(frozen=True)
class Trial:
    """Findings of one cause, hidden small and large in few recordings, and large in many, and the parameters that are true."""

    small: Finding | None
    large: Finding
    much: Finding
    truth: HiddenEffect


def check_evidence(trial: Trial) -> None:
    """Raises AssertionError where evidence does not move as that of a measurement must."""
    few = [f for f in (trial.small, trial.large) if f is not None]
    for f in (*few, trial.much):
        assert (f.delta_bic is None) == (f.p_value is None) == (f.log10_p is None)
        assert (f.heldout_gain is None) == f.of_data, f"{f.id} has a gain of {f.heldout_gain}"
        if f.p_value is not None and f.log10_p is not None:
            assert f.p_value == pytest.approx(10.0**f.log10_p, rel=1e-6)
    for name in ("delta_bic", "log10_p", "heldout_gain"):
        sign = -1.0 if name == "log10_p" else 1.0
        values = [getattr(f, name) for f in (*few, trial.much)]
        if None in values:
            assert set(values) == {None}
            continue
        for a, b in combinations(values, 2):
            assert a != b, f"{name} of {trial.large.id} is {a} whatever is hidden"
        # a share of the power does not depend on how long one looks; evidence does
        if name != "heldout_gain":
            assert sign * values[-1] > sign * values[-2], f"{name} of {trial.large.id} does not grow with the data: {values}"
        if len(few) == 2 and (name == "heldout_gain" or trial.large.id not in SCATTERS_WITH_SIZE):
            assert sign * values[1] > sign * values[0], f"{name} of {trial.large.id} does not grow with the size: {values}"
    _check_widths(trial)


def _check_widths(trial: Trial) -> None:
    """Intervals of the same parameters are narrower by about the root of how much more data there is."""
    ratios = []
    later = {(p.name, p.joint): p for p in trial.much.parameters}
    for p in trial.large.parameters:
        q = later.get((p.name, p.joint))
        assert (p.std is None) == (p.low is None) == (p.high is None)
        if p.std is None or q is None:
            continue
        assert np.all(np.asarray(p.std) > 0.0), f"{p.name} of {trial.large.id} has a std of {p.std}"
        ratios += np.atleast_1d(_of_noise(q) / _of_noise(p)).tolist()
    if ratios and trial.large.id not in AS_SURE_AS_BEFORE:
        usual = float(np.sqrt(LITTLE / MUCH))
        assert 0.6 * usual < np.median(ratios) < 1.6 * usual, f"intervals of {trial.large.id} narrow by {ratios}, not by {usual}"


def _of_noise(p: Parameter) -> FloatArray:
    """The part of a standard deviation that comes from the noise: that of the chain is the same for any amount of data."""
    std, chain = np.asarray(p.std, dtype=float), CHAIN * np.asarray(p.value, dtype=float)
    return np.asarray(np.sqrt(np.where(std > np.abs(chain), std**2 - chain**2, std**2)))


def inside(finding: Finding, truth: HiddenEffect) -> Iterator[bool]:
    """Is the true size inside the interval, for every number that is stated with one."""
    for true in truth.parameters:
        for p in finding.parameters:
            if p.name == true.name and p.joint in (true.joint, None) and p.std is not None and not isinstance(true.value, str):
                low, high, value = (np.atleast_1d(np.asarray(x, dtype=float)) for x in (p.low, p.high, true.value))
                yield from (bool(a <= x <= b) for a, x, b in zip(low, value, high, strict=True))


def check_coverage(held: list[bool]) -> None:
    """Raises AssertionError where 95 % intervals hold the truth too rarely for that to be chance."""
    assert held
    assert stats.binomtest(sum(held), len(held), 0.95, "less").pvalue > 0.01, (
        f"{sum(held)} of {len(held)} intervals hold the truth"
    )


@cache
def hidden(id_: str, scale: float, seed: int) -> tuple[HiddenEffect, Signals, Signals]:
    """The cause, and two motions of a robot that has it."""
    model, rng = robot(ARM), np.random.default_rng([seed, 7])
    motion, other = DiagnosisMotion(model, rng, 8.0, 4.0), DiagnosisMotion(model, rng, 6.0, 3.0)
    draw = np.random.default_rng([seed, 8])
    usual = Circumstances(model, motion, draw, scale, np.full(model.n, NOISE))
    effect = CAUSES[id_].draw(usual)
    large = scale == LARGE
    for name, sizes in SIZES.get(id_, {}).items():
        effect = replace(
            effect, parameters=tuple(replace(p, value=sizes[large]) if p.name == name else p for p in effect.parameters)
        )
    stiffening = stiffening_for(usual.torque)
    true = realise(model, (effect,))
    return effect, move(true, motion, RATE, stiffening), move(true, other, RATE, stiffening)


@cache
def recordings(id_: str, scale: float, count: int, seed: int) -> tuple[list[Recording], list[Recording]]:
    """To fit, the same motion each time with noise of its own, and to judge."""
    effect, moved, other = hidden(id_, scale, seed)
    model = robot(ARM)
    true = realise(model, (effect,))
    noise = Noise(np.full(model.n, NOISE), np.zeros(model.n), position=1e-5, resolution=0.0)
    rng = np.random.default_rng([seed, 9])

    def one(name: str, signals: Signals, start: float) -> Recording:
        said = publish(name, true, signals, noise, rng, start)
        return Recording(name, said.t, said.q, said.v, said.tau)

    return [one(f"run {i}", moved, 100.0 * (i + 1)) for i in range(count)], [one("judge", other, 1000.0)]


def found(id_: str, scale: float, count: int, seed: int) -> Finding | None:
    """The finding of a cause that is hidden, None where it is not named."""
    fitted, judged = recordings(id_, scale, count, seed)
    return next((f for f in diagnose(robot(ARM), fitted, judged).findings if f.id == id_), None)


@cache
def trial_of(id_: str, seed: int) -> Trial | None:
    """The three findings of a cause, the small one only where it is named; None where it is not named when it is large."""
    small = None if id_ in WITHOUT_SIZE else found(id_, SMALL, LITTLE, seed)
    large, much = found(id_, LARGE, LITTLE, seed), found(id_, LARGE, MUCH, seed)
    if large is None or much is None:
        return None
    return Trial(small, large, much, hidden(id_, LARGE, seed)[0])


def findings_of_signals(id_: str, scale: float, count: int, seed: int) -> Finding:
    (finding,) = [f for f in signal_findings(recordings(id_, scale, count, seed)[0], robot(ARM).joint_names) if f.id == id_]
    return finding


def trial_of_signals(id_: str, seed: int = 1) -> Trial:
    sizes = ((SMALL, LITTLE), (LARGE, LITTLE), (LARGE, MUCH))
    small, large, much = (findings_of_signals(id_, *size, seed) for size in sizes)
    return Trial(small, large, much, hidden(id_, LARGE, seed)[0])


@pytest.mark.parametrize("id_", ["velocity_lag", "torque_quantisation"])
def test_a_fault_that_needs_no_dynamics_is_measured(id_: str) -> None:
    trial = trial_of_signals(id_)
    check_evidence(trial)
    assert all(inside(trial.much, trial.truth))


@pytest.mark.slow
@pytest.mark.parametrize("id_", ["torque_unit", "torque_sign", "joint_order"])
def test_a_fault_of_units_signs_or_order_is_measured(id_: str) -> None:
    model = robot(ARM)

    def evidence(scale: float, count: int) -> Evidence | None:
        published = recordings(id_, scale, count, 1)[0]
        found = judge(model, published)
        assert found is not None
        faults = found.faults
        assert [f.effect.id for f in faults] in ([id_], [])
        return fault_evidence(model, published, faults)[0] if faults else None

    large, much, small = evidence(LARGE, LITTLE), evidence(LARGE, MUCH), evidence(SMALL, LITTLE)
    assert large is not None
    assert much is not None
    assert 10.0 < large.delta_bic < much.delta_bic
    assert much.log10_p < large.log10_p < -3.0
    assert large.gain is None
    if id_ not in WITHOUT_SIZE:
        # 0.74 N m for one: the masses and a payload may make as much, and it is not sure enough to be undone
        assert small is None or 10.0 < small.delta_bic < large.delta_bic


@pytest.mark.slow
def test_a_cause_of_torque_is_measured() -> None:
    trial = trial_of("viscous_friction", 1)
    assert trial is not None
    check_evidence(trial)
    assert all(inside(trial.much, trial.truth))


@pytest.mark.slow
def test_faults_of_the_data_stand_after_the_causes_and_have_no_share() -> None:
    fitted, judged = ([replace(r, tau=1000.0 * r.tau) for r in part] for part in recordings("viscous_friction", SMALL, LITTLE, 1))
    document = json.loads(json.dumps(diagnose(robot(ARM), fitted, judged).as_dict(), allow_nan=False))
    cause, fault = document["effects"]
    assert (cause["name"], fault["name"]) == ("viscous_friction", "torque_unit")
    assert document["data_faults"] == [fault]
    assert fault["evidence"]["heldout_gain"] is None
    assert cause["evidence"]["heldout_gain"] > 0.5
    (factor,) = fault["parameters"]
    assert factor["ci95"][0] < factor["value"] == 1000.0 < factor["ci95"][1]


def test_a_contact_is_measured_on_each_joint_by_what_the_others_tell() -> None:
    model = robot(ARM)
    motions = prepare(model, recordings("torque_quantisation", SMALL, 1, 2)[0], []).motions
    (motion,) = motions
    rng = np.random.default_rng(0)
    quiet = 0.1 * rng.normal(size=motion.tau.shape)
    jacobian = model.frame_jacobian_along(motion.q, model.frame_id(model.body_names[-1]))[:, :3]
    moves = [np.ones(motion.q.shape, dtype=np.bool_)]

    def contact(size: float, seconds: float) -> tuple[Evidence, np.ndarray[Any, Any]]:
        window = np.clip(1.0 - np.abs(motion.t - 4.0) / seconds, 0.0, 1.0)
        pushed = -np.einsum("kxj,x->kj", jacobian, np.array([1.0, 0.5, 0.2])) * (size * window)[:, None]
        nominal = [motion.tau - quiet - pushed]
        (found,) = find_contacts(model, ["run"], motions, [quiet + pushed], nominal, moves)
        return found.evidence, found.std

    weak, strong, long = contact(20.0, 0.3), contact(60.0, 0.3), contact(60.0, 0.9)
    for a, b in ((weak, strong), (strong, long)):
        assert a[0].delta_bic < b[0].delta_bic
        assert b[0].log10_p < a[0].log10_p
        assert a[0].gain is not None
        assert b[0].gain is not None
        assert 0.0 < a[0].gain < b[0].gain <= 1.0
    assert np.all(long[1] < strong[1])


def test_counts_of_messages_have_the_intervals_of_counts() -> None:
    (run,) = recordings("torque_quantisation", SMALL, 1, 1)[0]
    for share in (0.02, 0.06):
        rng = np.random.default_rng(3)
        keep = np.sort(np.concatenate([np.arange(len(run.t)), np.flatnonzero(rng.random(len(run.t)) < share)]))
        faults = find_message_faults(run.t[keep], run.q[keep], run.tau[keep])
        (finding,) = message_finding([faults], robot(ARM).joint_names)
        assert (finding.heldout_gain, finding.delta_bic, finding.p_value) == (None, None, None)
        (repeated,) = [p for p in finding.parameters if p.name == "repeated"]
        assert repeated.low < share < repeated.high
        assert repeated.std == pytest.approx(np.sqrt(repeated.value / faults.count))


def run_again(id_: str, seed: int) -> tuple[HiddenEffect, Recording]:
    """The same motion with other noise."""
    effect, moved, _ = hidden(id_, LARGE, 1)
    model = robot(ARM)
    noise = Noise(np.full(model.n, NOISE), np.zeros(model.n), position=1e-5, resolution=0.0)
    said = publish("run", realise(model, (effect,)), moved, noise, np.random.default_rng([seed, 11]))
    return effect, Recording("run", said.t, said.q, said.v, said.tau)


def lag_inside(seed: int) -> bool:
    """Is the true cutoff inside its interval."""
    effect, run = run_again("velocity_lag", seed)
    lag = velocity_lag([run])
    assert lag is not None
    low, high = interval(lag.cutoff, lag.std)
    return bool(low <= effect.vector("cutoff")[0] <= high)


def gains_of(seed: int, inexact: bool) -> tuple[Prepared, Gains]:
    """Of efforts with which nothing is wrong, as if they could be in any unit."""
    model = robot(ARM)
    train = prepare(model, [run_again("velocity_lag", seed)[1]], [], gains=range(model.n))
    return train, with_knobs(train.problem, Library(model, train.band), train.problem.fit([], inexact=inexact)).gains


def factor_inside(seed: int) -> bool:
    """Is a factor of 1 on all efforts inside its interval, where nothing is wrong with them."""
    measured = gains_of(seed, inexact=False)[1].common()
    assert measured is not None
    low, high = interval(*measured)
    return low <= 1.0 <= high


def test_what_factors_have_in_common_is_as_uncertain_as_the_links() -> None:
    """With a factor of its own on each joint none says for another how much torque the links make."""
    train, gains = gains_of(0, inexact=True)
    assert gains.joints == tuple(int(j) for j in train.problem.active)
    each = np.sqrt(np.diag(gains.covariance))
    alone = 1.0 / np.sqrt(np.diag(np.linalg.inv(gains.covariance)))  # with the others known
    assert each[1] > 1.5 * alone[1]
    # what is left is the prior of the links: masses that are all off by one part
    assert each[1] < 3.0 / np.sqrt(np.min(train.problem.prior[: train.motions[0].robot.n]))


@pytest.mark.slow
def test_intervals_of_a_factor_on_the_efforts_hold_the_truth() -> None:
    check_coverage([factor_inside(seed) for seed in range(24)])


@pytest.mark.slow
def test_intervals_of_a_filtered_velocity_hold_the_truth() -> None:
    check_coverage([lag_inside(seed) for seed in range(40)])


def test_intervals_of_a_step_hold_the_truth_where_the_values_scatter_about_their_lattice() -> None:
    held, widths = [], []
    for count in (500, 8000):
        for seed in range(60):
            rng = np.random.default_rng(seed)
            torque = 3.0 * np.sin(np.arange(count) / 40.0) + 0.1 * rng.normal(size=count)
            effort = np.round(torque / 0.25) * 0.25 + 1e-4 * rng.normal(size=count)
            lattice = lattice_of(0, [effort], 0.2501, 1)
            low, high = interval(lattice.step, lattice.std)
            held.append(low <= 0.25 <= high)
        widths.append(lattice.std)
    check_coverage(held)
    assert widths[1] / widths[0] == pytest.approx(0.25, rel=0.2)


def test_a_value_that_is_fixed_by_hand_does_not_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    trial = trial_of_signals("velocity_lag")
    check_evidence(trial)
    for fixed, words in (
        ({"delta_bic": 1000.0}, "delta_bic of velocity_lag is 1000.0 whatever"),
        ({"heldout_gain": 0.5}, "has a gain of 0.5"),
        ({"log10_p": -3.0, "p_value": 1e-3}, "log10_p of velocity_lag is -3.0 whatever"),
    ):
        made = fault_findings._finding
        monkeypatch.setattr(fault_findings, "_finding", lambda *args, made=made, fixed=fixed: replace(made(*args), **fixed))
        with pytest.raises(AssertionError, match=words):
            check_evidence(trial_of_signals("velocity_lag"))
        monkeypatch.undo()
    for part in (1e-3, 0.0):

        def by_hand(name: str, joint: str | None, value: float, unit: str, *_: float, part: float = part) -> Parameter:
            return Parameter(name, joint, value, unit, part * value, (1.0 - 2.0 * part) * value, (1.0 + 2.0 * part) * value)

        monkeypatch.setattr(fault_findings, "Parameter", by_hand)
        with pytest.raises(AssertionError, match="narrow by" if part else "has a std of"):
            check_evidence(trial_of_signals("velocity_lag"))
        monkeypatch.undo()
    with pytest.raises(AssertionError, match="30 of 40"):
        check_coverage([True] * 30 + [False] * 10)


@pytest.mark.parametrize("parameters", [1, 2, 7, 40])
def test_a_p_value_is_that_of_the_chi_squared_distribution_however_small(parameters: int) -> None:
    for rise in (0.0, 3.0, 60.0, 900.0):
        expected = min(0.0, float(stats.chi2.logsf(rise, parameters)) + np.log(5.0))
        assert log_p_value(rise, parameters, 5) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    tail = [log_p_value(x, parameters) for x in np.geomspace(1200.0, 1e6, 60)]
    assert np.all(np.diff(tail) < 0.0)
    # far out the density falls as exp(-x / 2)
    assert log_p_value(1e5 + 2.0, parameters) - log_p_value(1e5, parameters) == pytest.approx(-1.0, rel=1e-3)
    assert log_p_value(50.0, 0) == pytest.approx(-25.0)


def test_the_other_numbers_are_what_they_say() -> None:
    assert bic_difference(30.0, 3, 100.0) == pytest.approx(30.0 - 3.0 * np.log(100.0))
    assert interval(2.0, 0.5) == pytest.approx((2.0 - 0.98, 2.0 + 0.98), abs=1e-4)
    std, low, high = count_interval(20, 1000)
    assert (std, low, high) == pytest.approx(
        (np.sqrt(20) / 1000, stats.chi2.ppf(0.025, 40) / 2000, stats.chi2.ppf(0.975, 42) / 2000)
    )
    assert count_interval(0, 1000)[:2] == (0.0, 0.0)
    assert set(INSIDE) <= set(EFFECTS) | set(CHANNEL_EFFECTS)


def test_efforts_without_steps_have_no_lattice() -> None:
    assert not lattices(recordings("velocity_lag", SMALL, 1, 1)[0])


UNSEEN = "of the first joint, about a vertical axis, it shows nothing on this motion"
DO_NOT_HOLD = {
    ("asymmetric_coulomb_friction", "evidence"): "it is told as the Coulomb friction and the offset that it equals",
    ("asymmetric_coulomb_friction", "intervals"): "it is told as the Coulomb friction and the offset that it equals",
    (
        "payload_change",
        "evidence",
    ): "an elastic joint is told beside it (p .6, with more data 1.0) and has 6 % of the error: the noise is "
    "so small that 4e-4 of the torque, which the filters leave, is above it",
    ("torque_saturation", "evidence"): UNSEEN,
    ("torque_saturation", "intervals"): UNSEEN,
    ("joint_offset", "evidence"): UNSEEN,
    ("joint_offset", "intervals"): UNSEEN,
    ("joint_sign", "evidence"): UNSEEN,
}
"""What does not hold of a cause that is hidden here, with the reason."""


EACH = 3
"""One of so many causes is tried in every run, all of them with `make test-long`."""


def each_cause() -> list[Any]:
    out = []
    for (i, id_), what in product(enumerate(INSIDE), ("evidence", "intervals")):
        marks = [pytest.mark.xfail(reason=DO_NOT_HOLD[id_, what])] if (id_, what) in DO_NOT_HOLD else []
        if what == "evidence" or id_ not in WITHOUT_SIZE:
            out.append(pytest.param(id_, what, marks=[*marks, *([pytest.mark.long] if i % EACH else [])]))
    return out


@pytest.mark.slow
@pytest.mark.parametrize(("id_", "what"), each_cause())
def test_a_cause_that_can_be_named_was_measured(id_: str, what: str) -> None:
    """Of the intervals 95 % should; of large causes in little noise fewer do, for what the equations leave out shows there."""
    trial = trial_of(id_, 1)
    assert trial is not None, "it was not found where it is large"
    if what == "evidence":
        check_evidence(trial)
    else:
        held = [x for f in (trial.small, trial.large, trial.much) if f is not None for x in inside(f, trial.truth)]
        assert np.mean(held) >= 0.5, f"{sum(held)} of {len(held)}"
