"""The ten inertial parameters: every conversion against its definition by integrals over point masses, and back."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from robots import random_body
from scipy.spatial.transform import Rotation

from sysid_ros.robot import inertial_parameters as ip
from sysid_ros.sample import FloatArray


def cloud(seed: int) -> tuple[FloatArray, FloatArray]:
    """Point masses and where they are."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.1, 0.5, 12), rng.normal(size=(12, 3)) * [0.1, 0.2, 0.3] + rng.normal(size=3)


def theta_of(masses: FloatArray, points: FloatArray) -> FloatArray:
    """By definition: sums over the points."""
    inertia = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, points, strict=True))
    return np.array(
        [masses.sum(), *(masses @ points), *(inertia[i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))]
    )


seeds = pytest.mark.parametrize("seed", range(5))


@seeds
def test_com_form_is_the_definition_and_comes_back(seed: int) -> None:
    masses, points = cloud(seed)
    theta = theta_of(masses, points)
    mass, com, inertia = ip.to_com(theta)
    assert mass == pytest.approx(masses.sum())
    np.testing.assert_allclose(com, masses @ points / mass)
    np.testing.assert_allclose(inertia, ip.inertia_matrix(theta_of(masses, points - com)), atol=1e-12)
    np.testing.assert_allclose(ip.from_com(mass, com, inertia), theta, atol=1e-12)


@seeds
def test_the_order_is_pinocchios(seed: int) -> None:
    mass, com, inertia = random_body(np.random.default_rng(seed))
    expected = pin.Inertia(mass, com, inertia).toDynamicParameters()
    np.testing.assert_allclose(ip.from_com(mass, com, inertia), expected, atol=1e-14)


@seeds
def test_the_order_of_messages(seed: int) -> None:
    theta = theta_of(*cloud(seed))
    by_name = dict(zip(ip.NAMES, theta, strict=True))
    message = dict(zip(ip.MESSAGE_NAMES, theta[ip.TO_MESSAGE_ORDER], strict=True))
    renamed = {"m": "m", "mx": "mc_x", "my": "mc_y", "mz": "mc_z"} | {
        f"I{a}": f"I_{a}" for a in ("xx", "xy", "xz", "yy", "yz", "zz")
    }
    assert {renamed[name]: value for name, value in message.items()} == by_name
    np.testing.assert_array_equal(theta[ip.TO_MESSAGE_ORDER][ip.TO_MESSAGE_ORDER], theta)


@seeds
def test_pseudo_inertia_is_the_second_moment_of_density(seed: int) -> None:
    masses, points = cloud(seed)
    homogeneous = np.column_stack((points, np.ones(len(points))))
    theta = theta_of(masses, points)
    pseudo = ip.pseudo_inertia(theta)
    np.testing.assert_allclose(pseudo, homogeneous.T @ (masses[:, None] * homogeneous), atol=1e-12)
    np.testing.assert_allclose(ip.from_pseudo_inertia(pseudo), theta, atol=1e-12)


@seeds
def test_moving_the_frame(seed: int) -> None:
    masses, points = cloud(seed)
    rotation = Rotation.random(random_state=seed).as_matrix()
    translation = np.array([0.3, -0.2, 0.5])
    moved = ip.move(theta_of(masses, points), rotation, translation)
    np.testing.assert_allclose(moved, theta_of(masses, points @ rotation.T + translation), atol=1e-12)
    back = ip.move(moved, rotation.T, -rotation.T @ translation)
    np.testing.assert_allclose(back, theta_of(masses, points), atol=1e-12)


@seeds
def test_com_jacobian_is_the_derivative(seed: int) -> None:
    theta = theta_of(*cloud(seed))
    jacobian, step = ip.com_jacobian(theta), 1e-6
    for i in range(10):
        shift = step * np.eye(10)[i]
        numeric = (ip.to_com(theta + shift)[1] - ip.to_com(theta - shift)[1]) / (2 * step)
        np.testing.assert_allclose(jacobian[:, i], numeric, atol=1e-8)


@seeds
def test_real_bodies_are_physical_and_impossible_ones_are_not(seed: int) -> None:
    mass, com, inertia = random_body(np.random.default_rng(seed))
    assert ip.is_physical(ip.from_com(mass, com, inertia))
    assert not ip.is_physical(ip.from_com(-mass, com, inertia))
    assert not ip.is_physical(ip.from_com(mass, com, inertia - np.linalg.eigvalsh(inertia)[-1] * np.eye(3)))
    assert not ip.is_physical(ip.from_com(mass, com, np.diag([1.0, 1.0, 2.1])))  # violates the triangle inequality alone
    assert not ip.is_physical(np.zeros(10))


def test_no_mass_has_no_centre() -> None:
    mass, com, inertia = ip.to_com(np.zeros(10))
    assert mass == 0.0
    assert np.isnan(com).all()
    assert np.isnan(inertia).all()
