"""Physical consistency: bodies that exist are returned, what can't exist is not, and nothing depends on units."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from arm_recordings import require_physical
from robots import ROBOTS, random_body, random_sample, robot, urdf

from sysid_ros.effects import LinkInertia
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.identification import free_model
from sysid_ros.identification.physical_consistency import PhysicalProblem, reference_bodies
from sysid_ros.identification.prior_weight import WEIGHTS, choose_weights
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel


def truth_of(model: TorqueModel, rng: np.random.Generator) -> FloatArray:
    """Random bodies, friction and rotors that exist, and offsets."""
    n = model.robot.n
    links = [inertial_parameters.from_com(*random_body(rng)) for _ in range(n)]
    return np.concatenate(
        [*links, rng.uniform(0.1, 3.0, n), rng.uniform(0.1, 3.0, n), rng.uniform(0.01, 0.3, n), rng.normal(size=n)]
    )


def information_of(model: TorqueModel, rng: np.random.Generator, count: int = 100, noise: float = 0.1) -> FloatArray:
    out = np.zeros((model.p, model.p))
    for _ in range(count):
        Y, _ = model.split(random_sample(model.robot, rng))
        out += Y.T @ Y / noise**2
    return out


def noise_of(A: FloatArray, rng: np.random.Generator, size: float = 1.0) -> FloatArray:
    """What white noise in the rows does to the score: its covariance is A."""
    values, vectors = np.linalg.eigh(A)
    return np.asarray(size * vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=len(A))))


def torque_error(model: TorqueModel, difference: FloatArray, seed: int = 99) -> float:
    """Largest torque that a difference of parameters makes in random states [N m]."""
    rng = np.random.default_rng(seed)
    return max(float(np.abs(model.split(random_sample(model.robot, rng))[0] @ difference).max()) for _ in range(20))


@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(1, 12), marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ROBOTS)
def test_random_bodies_come_back_from_data_without_noise(name: str, seeds: range) -> None:
    """As far as motion tells them apart: the same torque everywhere, though the prior is another robot's."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        model = free_model(robot(name))
        truth, A = truth_of(model, rng), information_of(model, rng)
        found = PhysicalProblem(model, A, A @ truth).solve(1e-3)
        require_physical(model, found.theta)
        assert torque_error(model, found.theta - truth) < 1e-2
        assert found.loss < 0.1
        assert np.all(found.divergence > 0.0)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_urdfs_own_links_come_back_in_full(name: str) -> None:
    """With the truth as the prior, data and prior agree and all ten parameters of every link are found.

    Not where the first joint slides upwards: nothing tells its offset from weight, nor its rotor from mass.
    """
    rng = np.random.default_rng(0)
    model = free_model(robot(name))
    (links,) = (e for e in model.free if isinstance(e, LinkInertia))
    truth = truth_of(model, rng)
    references, _ = reference_bodies(model.robot, links.joints)
    truth[: links.p] = np.concatenate([inertial_parameters.from_pseudo_inertia(m) for m in references])
    A = information_of(model, rng)
    for weight in (1e-2, 1e2, math.inf):
        found = PhysicalProblem(model, A, A @ truth).solve(weight)
        told = np.ones(model.p, dtype=bool)
        if name == "tree_robot":
            told[[0, 1, 2, 3, *range(10 * model.robot.n, model.p, model.robot.n)]] = False
        np.testing.assert_allclose(found.theta[told], truth[told], rtol=1e-3, atol=1e-4)
        np.testing.assert_allclose(found.divergence, 0.0, atol=1e-3)
        assert found.at_bound == ()


@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(k, marks=pytest.mark.slow) for k in range(3, 30))])
def test_what_cannot_exist_is_never_returned(seed: int) -> None:
    """Data of a robot with negative masses and friction, with noise: the nearest that exists, at any weight."""
    rng = np.random.default_rng(seed)
    model = free_model(robot(ROBOTS[seed % 3]))
    A = information_of(model, rng, 60) * 10.0 ** rng.uniform(-2, 2)
    truth = truth_of(model, rng) * rng.choice([-1.0, 1.0], model.p)
    problem = PhysicalProblem(model, A, A @ truth)
    losses = []
    for weight in (1.0, 1e3, math.inf):
        found = problem.solve(weight)
        require_physical(model, found.theta)
        losses.append(found.loss)
        assert found.at_bound
        for name in found.at_bound:
            assert found.theta[model.parameter_names.index(name)] == 0.0
    assert losses == sorted(losses)


@pytest.mark.parametrize("weight", [0.1, 1e3])
def test_the_minimum_is_one(weight: float) -> None:
    """Gradient of data and prior balance: ``A theta - b + w (U^-1 - P^-1) = 0``, with pressure on bounds only inwards."""
    rng = np.random.default_rng(5)
    model = free_model(robot("small_arm"))
    A, truth = information_of(model, rng), truth_of(model, rng)
    truth[-2 * model.robot.n] = -0.2
    found = PhysicalProblem(model, A, A @ truth).solve(weight)
    references, _ = reference_bodies(model.robot, np.arange(model.robot.n))
    gradient = A @ (found.theta - truth)
    for k, reference in enumerate(references):
        block = slice(10 * k, 10 * k + 10)
        theta = found.theta[block]
        pull = weight * (np.linalg.inv(reference) - np.linalg.inv(inertial_parameters.pseudo_inertia(theta)))
        gradient[block] += [
            np.sum(pull * (inertial_parameters.pseudo_inertia(theta + e) - inertial_parameters.pseudo_inertia(theta)))
            for e in np.eye(10)
        ]
    size = np.sqrt(np.maximum(np.diag(A), 1e-6))
    held = [model.parameter_names.index(name) for name in found.at_bound]
    assert held
    assert np.all(gradient[held] > 0.0)
    rest = np.setdiff1d(np.arange(model.p), held)
    np.testing.assert_allclose(gradient[rest] / size[rest], 0.0, atol=1e-4 * weight**0.5)


@pytest.mark.parametrize("name", ["small_arm", "iiwa"])
def test_units_do_not_matter(name: str) -> None:
    """Torque in other units, and robots a thousand times heavier: the same robot comes out, scaled."""
    rng = np.random.default_rng(3)
    model = free_model(robot(name))
    A, truth = information_of(model, rng), truth_of(model, rng)
    b = A @ truth + noise_of(A, rng)
    plain = PhysicalProblem(model, A, b).solve(10.0)
    heavy_model = free_model(scaled_masses(name, 1000.0))
    heavy = PhysicalProblem(heavy_model, A / 1000.0**2, b / 1000.0).solve(10.0)
    np.testing.assert_allclose(heavy.theta / 1000.0, plain.theta, rtol=1e-5, atol=1e-5 * np.abs(plain.theta).max())
    np.testing.assert_allclose(heavy.divergence, plain.divergence, rtol=1e-4, atol=1e-7)
    assert heavy.loss == pytest.approx(plain.loss, rel=1e-4)


def scaled_masses(name: str, factor: float) -> RobotModel:
    import re

    text = re.sub(r'<mass value="([^"]+)"', lambda m: f'<mass value="{float(m[1]) * factor!r}"', urdf(name))
    return RobotModel.from_urdf(re.sub(r'(i[xyz]{2})="([^"]+)"', lambda m: f'{m[1]}="{float(m[2]) * factor!r}"', text))


def test_curvature_is_the_second_derivative_of_the_prior() -> None:
    rng = np.random.default_rng(1)
    model = free_model(robot("small_arm"))
    A, truth = information_of(model, rng), truth_of(model, rng)
    found = PhysicalProblem(model, A, A @ truth).solve(5.0)
    assert found.curvature.shape == (model.p, model.p)
    assert not found.curvature[10 * model.robot.n :].any()
    block, theta = slice(0, 10), found.theta[:10]
    inverse = np.linalg.inv(inertial_parameters.pseudo_inertia(theta))
    for _ in range(5):
        d = rng.normal(size=10) * np.abs(theta).mean()
        step = inertial_parameters.pseudo_inertia(theta + d) - inertial_parameters.pseudo_inertia(theta)
        expected = 5.0 * np.trace(inverse @ step @ inverse @ step)
        assert d @ found.curvature[block, block] @ d == pytest.approx(expected, rel=1e-6)


def test_links_of_the_urdf_that_are_no_bodies_are_named_and_replaced() -> None:
    flat = (
        '<robot name="r"><link name="a"/>'
        + "".join(
            f'<link name="{name}"><inertial><origin xyz="0.1 0 0"/><mass value="{mass}"/>'
            f'<inertia ixx="{xx}" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>'
            for name, mass, xx in (("good", 2.0, 0.001), ("impossible", 1.0, 0.5), ("point", 1.0, 0.002), ("none", 0.0, 0.0))
        )
        + "".join(
            f'<joint name="j{k}" type="revolute"><parent link="{p}"/><child link="{c}"/><origin xyz="0.2 0 0"/>'
            '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
            for k, (p, c) in enumerate([("a", "good"), ("good", "impossible"), ("impossible", "point"), ("point", "none")])
        )
        + "</robot>"
    )
    model = RobotModel.from_urdf(flat)
    references, notes = reference_bodies(model, np.arange(4))
    assert references.shape == (4, 4, 4)
    assert all(np.linalg.eigvalsh(m)[0] > 0.0 for m in references)
    assert [[name for name in ("good", "impossible", "point", "none") if f"'{name}'" in note] for note in notes] == [
        ["impossible"], ["point"], ["none"],
    ]  # fmt: skip
    np.testing.assert_allclose(inertial_parameters.from_pseudo_inertia(references[0]), model.pi[:10])
    for k in (1, 2):
        np.testing.assert_allclose(references[k][:, 3], model.pi[10 * k + np.array([1, 2, 3, 0])])
    found = PhysicalProblem(free_model(model), np.eye(56), np.ones(56)).solve(1.0)
    assert found.notes == notes


def test_a_parameter_that_nothing_shows_is_left_alone() -> None:
    rng = np.random.default_rng(0)
    model = free_model(robot("small_arm"))
    A, truth = information_of(model, rng), truth_of(model, rng)
    A[-1], A[:, -1] = 0.0, 0.0
    found = PhysicalProblem(model, A, A @ truth).solve(1.0)
    assert abs(found.theta[-1]) < 1e-6
    blind = PhysicalProblem(model, np.zeros_like(A), np.zeros(model.p)).solve(1.0)
    np.testing.assert_allclose(blind.theta[: 10 * model.robot.n], model.robot.pi, rtol=1e-6, atol=1e-9)


def test_bad_input_is_named() -> None:
    model = free_model(robot("small_arm"))
    A, b = np.eye(model.p), np.zeros(model.p)
    with pytest.raises(DataError, match=r"\(3, 3\)"):
        PhysicalProblem(model, np.eye(3), np.zeros(3))
    with pytest.raises(DataError, match="not finite"):
        PhysicalProblem(model, A * np.nan, b)
    with pytest.raises(DataError, match="eigenvalue"):
        PhysicalProblem(model, -A, b)
    for weight in (0.0, -1.0, math.nan):
        with pytest.raises(SettingsError, match="weight"):
            PhysicalProblem(model, A, b).solve(weight)
    theta = np.ones(model.p)
    with pytest.raises(DataError, match=model.robot.body_names[0]):
        require_physical(model, theta)


def errors_of(
    per_link: list[dict[float, float]], joints: list[list[int]], risk: float = 1.0
) -> Callable[[FloatArray], tuple[FloatArray, FloatArray]]:
    """Expected errors of joints, each the product of what its links' weights leave, and what bad luck may make of a change."""

    def compare(weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        left = [per_link[k].get(float(w), 1.0) for k, w in enumerate(weights)]
        expected = np.array([math.prod(left[k] for k in links) for links in joints])
        return expected, np.where(expected == 1.0, 1.0, risk * expected)

    return compare


def test_the_weights_are_the_largest_that_are_as_good_as_the_best() -> None:
    """The first link gains from data, most at ten and nearly as much at a hundred; the second does not."""
    compare = errors_of([{1.0: 0.5, 10.0: 0.2, 30.0: 0.2003, 100.0: 0.2005, 1e4: 0.5}, {}], [[0], [1]])
    np.testing.assert_array_equal(choose_weights(compare, 2), [100.0, math.inf])


def test_a_link_that_would_spoil_a_joint_keeps_the_urdfs_inertials() -> None:
    finite = WEIGHTS[:-1]
    spoils, gains = dict.fromkeys(finite, 1.3), dict.fromkeys(finite, 0.3)
    np.testing.assert_array_equal(choose_weights(errors_of([gains, spoils], [[0], [1]]), 2), [1e5, math.inf])
    # where every link spoils a joint, all of them keep theirs
    assert np.isinf(choose_weights(errors_of([spoils, spoils], [[0, 1], [1]]), 2)).all()


def test_a_gain_that_is_as_likely_a_loss_is_not_taken_but_a_great_one_is() -> None:
    small, great = dict.fromkeys(WEIGHTS[:-1], 0.9), dict.fromkeys(WEIGHTS[:-1], 0.01)
    assert np.isinf(choose_weights(errors_of([small], [[0]], risk=1.3), 1)).all()
    assert np.isfinite(choose_weights(errors_of([great], [[0]], risk=1.3), 1)).all()
    with pytest.raises(DataError, match="not finite"):
        choose_weights(lambda weights: (np.array([np.nan]), np.array([np.nan])), 1)


@pytest.mark.parametrize("seeds", [range(3), pytest.param(range(3, 40), marks=pytest.mark.slow)])
def test_the_solver_survives_what_a_bad_log_brings(seeds: range) -> None:
    """Twelve decades between the best and the least known, and data that contradict every body by many deviations."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        model = free_model(robot(ROBOTS[seed % 3]))
        A = information_of(model, rng, 20, noise=1e-4)
        b = A @ truth_of(model, rng) + noise_of(A, rng, 100.0)
        found = PhysicalProblem(model, A, b).solve(1.0)
        require_physical(model, found.theta)
        assert found.weight == 1.0 or any("raised" in note for note in found.notes)
