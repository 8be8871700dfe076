"""How sure a diagnosis is: scatter from block to block, rivals that nothing tells apart, limits of a motor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from motions import Motion as Path_
from robots import robot
from test_diagnosis import ARM, RATE, record
from unsimulated import unsimulated as unsimulated

from sysid_ros.diagnosis import diagnose
from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.covariance import with_knobs
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.sets.block_scatter import BlockScatter, scatter_ratios
from sysid_ros.diagnosis.sets.posterior import Posterior, rivals
from sysid_ros.effects import Motion, TorqueOffset, TorqueSaturation
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.whittle import Noise
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel


@pytest.fixture(scope="module")
def band() -> Band:
    return Band(motions(robot(ARM), record(None, 7, 21.0)))


def fitted(band: Band, noise: FloatArray, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Parameters of a least squares fit to noise, shape (K,), by columns, shape (K, p), over their std, and the ratios."""
    theta = np.linalg.lstsq(columns, noise, rcond=None)[0]
    residual = noise - columns @ theta
    level = float(np.sqrt(residual @ residual / (len(noise) - columns.shape[1])))
    scatter = BlockScatter(band, columns.shape[1])
    scatter.add(columns, residual / level, np.arange(columns.shape[1]))
    information = np.asarray(columns.T @ columns, dtype=np.float64)
    return theta / level / np.sqrt(np.diag(np.linalg.inv(information))), scatter.ratios(information)


def ratios(band: Band, noise: FloatArray, columns: FloatArray) -> FloatArray:
    """Of such a fit."""
    return fitted(band, noise, columns)[1]


def held(band: Band, noise: Callable[[np.random.Generator], FloatArray], columns: int) -> tuple[float, float]:
    """Part of the parameters, which are zero, that lie inside of their 95 % intervals, without the ratios and with them."""
    rng = np.random.default_rng(0)
    found = [fitted(band, noise(rng), slowly(band, rng, columns)) for _ in range(40)]
    z, more = (np.concatenate(x) for x in zip(*found, strict=True))
    return float(np.mean(np.abs(z) < 1.96)), float(np.mean(np.abs(z) < 1.96 * np.sqrt(more)))


def slowly(band: Band, rng: np.random.Generator, count: int, hertz: float = 1.0) -> FloatArray:
    """Rows of random motions below a frequency, shape (K, count)."""
    return np.asarray(rng.normal(size=(len(band.f), count)) * (band.f < hertz)[:, None])


def test_a_block_that_alone_tells_of_a_parameter_says_nothing_of_its_scatter() -> None:
    """A recording of one block: without it nothing is known of the first parameter, and of the second what its prior says."""
    one = np.array([[[9.0e3, 6.0e5], [6.0e5, 4.5e7]]])
    scores, prior = np.array([[-2.7, 3.1e3]]), np.diag([0.0, 5.0e5])
    found = scatter_ratios(scores, one, one[0] + prior)
    assert 1.0 <= found[0] <= 1.5 + 1e-9  # the mean of what is known of such a ratio before any data
    assert np.isfinite(found).all()


def test_intervals_hold_the_truth_where_noise_is_what_its_weights_say(band: Band) -> None:
    white = held(band, lambda rng: rng.normal(size=len(band.f)), 4)
    assert 0.93 < white[0] < 0.97
    assert white[0] <= white[1] < 0.985


def test_intervals_hold_the_truth_where_noise_is_slower_than_its_weights_say(band: Band) -> None:
    """Also where the fit has so many parameters that it follows much of the noise of every block."""
    for columns in (3, 8):
        plain, wider = held(band, lambda rng: rng.normal(size=len(band.f)) * np.where(band.f < 1.0, 1.5, 1.0), columns)
        assert plain < 0.9
        assert 0.9 < wider < 0.985


def test_what_one_block_alone_tells_scatters_no_more_than_that_block_can_know(band: Band) -> None:
    """As a motor at its limit once: rounding in the blocks that tell nothing of it made ratios of 1e262."""
    rng = np.random.default_rng(2)
    t = np.arange(len(band.motions[0].t)) * band.motions[0].period
    once = np.repeat(np.exp(-(((t - 5.0) / 0.2) ** 2))[:, None], robot(ARM).n, axis=1)
    columns = np.column_stack([band.rows([once])[:, 0], slowly(band, rng, 3)])
    found = [ratios(band, rng.normal(size=len(band.f)), columns)[0] for _ in range(40)]
    assert np.median(found) < 3.0
    assert max(found) < 10.0


def test_a_model_that_is_wrong_for_a_while_scatters_more(band: Band) -> None:
    rng = np.random.default_rng(1)
    t = np.arange(len(band.motions[0].t)) * band.motions[0].period
    n = robot(ARM).n
    column = np.sin(2.0 * np.pi * 3.0 * t)
    # the column's own size comes and goes: no noise that is the same all the time
    wrong = column * np.where(t % 6.0 < 3.0, 1.0, -1.0)
    rows = [band.rows([np.repeat(x[:, None], n, axis=1)])[:, 0] for x in (column, wrong)]
    noise = 0.1 * rng.normal(size=len(band.f)) + rows[1]
    assert ratios(band, noise, rows[0][:, None])[0] > 5.0


def asymmetric(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    out = tau.copy()
    out[:, 1] += np.where(v[:, 1] > 0.0, 2.0, -1.0)
    return out


@pytest.mark.slow
def test_two_levels_of_friction_are_not_told_from_their_mean_and_a_constant() -> None:
    result = diagnose(robot(ARM), [record(asymmetric, 1, 14.0)], [record(asymmetric, 2, 7.0)])
    by_name = {f.id: f for f in result.findings}
    if "asymmetric_coulomb_friction" in by_name:
        assert set(by_name) == {"asymmetric_coulomb_friction"}
        rivals = by_name["asymmetric_coulomb_friction"].cannot_be_told_from
        assert {"coulomb_friction", "torque_offset"} <= set(rivals)
        assert any("Coulomb friction that differs with the direction" in sentence for sentence in result.record_next)
    else:
        assert set(by_name) == {"coulomb_friction", "torque_offset"}
        assert all("asymmetric_coulomb_friction" in f.cannot_be_told_from for f in result.findings)
    assert all(f.p_value is not None and 0.0 <= f.p_value < 1e-6 for f in result.findings)


def test_a_motor_that_can_do_no_more_is_told_by_what_was_asked_of_it() -> None:
    model = robot(ARM)
    q, v, a = Path_(model, 1, speed=1.2)(np.arange(round(14.0 * RATE)) / RATE)
    limit = float(np.quantile(np.abs(model.rnea_along(q, v, a)[:, 0]), 0.96))
    motor = TorqueSaturation(model, (model.joint_names[0],), limit=limit, kind="motor")
    asked = np.zeros((3, model.n))
    asked[:, 0] = 0.5 * limit, 1.5 * limit, -2.0 * limit
    still = np.zeros((3, model.n))
    motion = Motion(model, np.arange(3.0), still, still, still, asked)
    np.testing.assert_allclose(motor.torque_along(motion, np.ones(1))[:, 0], [0.0, 0.5 * limit, -limit])
    # it was not asked for an offset of the sensor, and a sensor that ends somewhere ends there with its offset
    with_offset = motion.with_torques(still, asked, sensor_torque=np.full_like(still, 0.1 * limit))
    np.testing.assert_allclose(motor.torque_along(with_offset, np.ones(1))[:, 0], [0.0, 0.4 * limit, -1.1 * limit])
    sensor = TorqueSaturation(model, (model.joint_names[0],), limit=limit, kind="sensor")
    np.testing.assert_allclose(sensor.torque_along(with_offset, np.ones(1))[:, 0], [0.0, -0.6 * limit, 0.9 * limit])
    offset = TorqueOffset(model, (model.joint_names[0],))
    known = KnownEffect(sensor, np.ones(1)), KnownEffect(offset, np.array([0.1 * limit]))
    t = np.arange(len(q)) / RATE
    shown = TorqueModel(model, [], known).torque_along(Motion(model, t, q, v, a, np.zeros_like(q)))
    np.testing.assert_allclose(shown[:, 0], np.clip(model.rnea_along(q, v, a)[:, 0] + 0.1 * limit, -limit, limit))
    with pytest.raises(ModelFileError, match=r"'brake'.*'sensor' or 'motor'"):
        TorqueSaturation(model, kind="brake")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gains", "named"),
    [
        pytest.param((0.0, 0.0, 0.4, 0.0), 1, id="one link"),
        pytest.param(
            (0.12,) * 4,
            2,
            id="all links",
            marks=pytest.mark.xfail(reason="masses all off by as much are an inexact URDF; one of four is told", strict=True),
        ),
    ],
)
def test_masses_that_are_far_off_are_no_inexactness(gains: tuple[float, ...], named: int) -> None:
    """In 40 s every link's mass is known far better than to the 2 % that are granted to every URDF."""
    model = robot(ARM)
    error = model.pi * np.repeat(gains, 10)

    def heavier(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
        return np.asarray(tau + model.regressor_along(q, v, a) @ error)

    result = diagnose(model, [record(heavier, 1, 40.0)], [record(heavier, 2, 10.0)])
    assert [f.id for f in result.findings] == ["link_inertia"]
    joints = result.findings[0].joints
    assert len(joints) >= named
    if named == 1:
        assert joints == (model.joint_names[2],)
    torque = result.torque
    assert torque is not None
    assert np.all(torque.after < 1.3 * torque.noise_floor)
    for p in result.findings[0].parameters:
        if p.name == "dm":
            k = model.joint_names.index(str(p.joint))
            assert abs(float(p.value) - gains[k] * model.pi[10 * k]) < 3.0 * float(p.std)


@pytest.mark.slow
def test_masses_off_by_what_any_urdf_is_are_told_but_no_cause() -> None:
    model = robot(ARM)
    error = model.pi * np.repeat([0.02, -0.02, 0.02, -0.02], 10)

    def inexact(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
        return np.asarray(tau + model.regressor_along(q, v, a) @ error)

    result = diagnose(model, [record(inexact, 1, 30.0)], [record(inexact, 2, 10.0)])
    assert result.verdict == "nothing_wrong"
    assert any("inexact" in note for note in result.notes)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_wrong_zero_by_half_a_gap_is_not_told_from_a_play_under_a_load_of_one_sign(sign: float) -> None:
    """The motor is ahead of the link under the load: measured less true position has the sign of the torque."""
    model = robot(ARM)
    train = prepare(model, [record(None, 1, 12.0)], [])
    selection = Selection(train.problem, Library(model, train.band), train.nominal)
    term = selection.library.whole("joint_offset", (1,), around=sign * 0.02)
    load = [np.abs(m.link_torque) + 0.1 for m in selection.library.motions]
    for torque, same in ((load, sign > 0.0), ([-x for x in load], sign < 0.0), ([x - x.mean(axis=0) for x in load], False)):
        selection.library.update(torque, torque)
        fit = train.problem.fit([term])
        selection.fit = replace(fit, theta=np.array([sign * 0.02]))
        assert ("backlash" in rivals(selection.problem, selection.library, selection.fit, Posterior(), [term])) == same
    selection.library.update([sign * x for x in load], load)
    selection.fit = replace(selection.fit, theta=np.array([sign * 0.2]))
    assert "backlash" not in rivals(selection.problem, selection.library, selection.fit, Posterior(), [term])


def test_a_time_that_no_row_shows_is_somewhere_in_the_recording() -> None:
    """In noise that hides all, as one that changes while all joints stand: a slope of zero told the time to 1e19 s."""
    train = prepare(robot(ARM), [record(None, 1, 10.0)], [])
    library = Library(robot(ARM), train.band)
    event = next(t for t in library.whole_options() if t.instant is not None)
    fit = train.problem.fit([event], Noise.even(np.full(train.band.n, 1e12)), 0)
    found = with_knobs(train.problem, library, fit).of[event]
    start, end = library.times()
    assert np.sqrt(found.covariance[-1, -1]) == pytest.approx((end - start) / np.sqrt(12.0), rel=1e-3)


def test_what_friction_seems_to_take_lets_a_motor_give_no_more(band: Band) -> None:
    """A fit that has no limit blames friction for what the motor was asked for beyond it."""
    asked = [m.with_torques(m.link_torque, 3.0 * m.tau) for m in band.motions]
    motor = TorqueSaturation(robot(ARM), ["lift"], limit=10.0, kind="motor")
    assert motor.reference_torque(asked) == pytest.approx(motor.reference_torque(band.motions))
    assert motor.reference_torque([m.with_torques(3.0 * m.tau, m.tau) for m in band.motions]) > motor.reference_torque(asked)
