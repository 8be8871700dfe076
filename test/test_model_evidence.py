"""ModelEvidence on rows that are drawn from its own equation, and its compiled parts against dense algebra."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from sysid_ros.online import evidence_kernels
from sysid_ros.online.evidence_words import further_off
from sysid_ros.online.model_evidence import ModelEvidence
from sysid_ros.online.model_hypotheses import Hypotheses
from sysid_ros.online.rows import Rows
from sysid_ros.sample import FloatArray

N, LINKS, PERIOD = 3, 4, 0.01
FRICTION = slice(10, 10 + 3 * N)
COLUMNS = FRICTION.stop + 2
NOTHING: FloatArray = np.zeros(N)
SHARED, OWN = np.concatenate([np.full(10, 2.0), np.full(2, 0.02)]), np.full((evidence_kernels.LOCAL, N), 1.0)


@dataclass
class Arm:
    """What makes rows: the considered errors as they are, the part of the known torque that shows, factors of the efforts."""

    z: FloatArray
    payload: FloatArray
    share: float = 1.0
    gains: FloatArray = field(default_factory=lambda: np.ones(N))
    noise: float = 0.3
    tilt: FloatArray = field(default_factory=lambda: np.zeros(2))

    def rows(self, rng: np.random.Generator) -> Rows:
        Y, Z = np.zeros((N, COLUMNS)), np.zeros((N, LINKS + N))
        Y[:, :10] = rng.normal(size=(N, 10))
        speed = rng.normal(size=N)
        for j in range(N):
            Y[j, FRICTION.start + j : FRICTION.stop : N] = 1.0, np.tanh(50.0 * speed[j]), speed[j]
        Y[:, FRICTION.stop :] = 30.0 * rng.normal(size=(N, 2))
        Z[:, :LINKS] = rng.normal(size=(N, LINKS))
        known = 20.0 * rng.normal(size=N)
        whole = self.share * known + Y[:, :10] @ self.payload + Y[:, FRICTION.stop :] @ self.tilt + Z[:, :LINKS] @ self.z
        tau = (
            self.gains * whole
            + 0.5 * Y[:, FRICTION.start + N : FRICTION.start + 2 * N].sum(axis=1)
            + self.noise * rng.normal(size=N)
        )
        return Rows(Y, tau - known, np.abs(speed), NOTHING, rng.normal(size=N), tau, Z, 0.0, NOTHING, NOTHING)


def evidence() -> ModelEvidence:
    return ModelEvidence(N, PERIOD, SHARED, OWN, 0.01)


def after(arm: Arm, count: int = 300, seed: int = 0, found: ModelEvidence | None = None) -> ModelEvidence:
    rng, found = np.random.default_rng(seed), found or evidence()
    for _ in range(count):
        found.add(arm.rows(rng), FRICTION, N)
    return found


def usual(**changes: object) -> Arm:
    rng = np.random.default_rng(7)
    return Arm(**{"z": rng.normal(size=LINKS), "payload": rng.normal(size=10), **changes})  # type: ignore[arg-type]


def test_a_model_that_is_as_it_is_said_to_be() -> None:
    found = after(usual())
    assert found.ready
    assert 1.0 <= found.links < 1.4
    assert 1.0 <= found.gains < 1.4
    assert found.not_shown == ""
    assert found.times == 1


@pytest.mark.parametrize("times", [4.0, 12.0])
def test_links_that_are_further_off(times: float) -> None:
    found = after(usual(z=times * np.array([1.0, -1.2, 0.8, 1.1])))
    assert times / 2.0 < found.links < 2.0 * times
    assert found.gains < 2.0
    assert f"{found.times:.0f} times" in further_off(found.links, found.gains, found.times)
    assert "links" in further_off(found.links, found.gains, found.times)


def test_gains_that_are_further_off() -> None:
    found = after(usual(gains=1.0 + np.array([0.05, -0.06, 0.055])))
    assert 3.0 < found.gains < 10.0
    assert "gains" in further_off(found.links, found.gains, found.times)
    assert found.not_shown == ""


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_efforts_that_hold_a_part_of_what_the_arm_takes(share: float) -> None:
    found = after(usual(share=share))
    assert found.other > 0.99
    assert abs(found.share[0] - share) < 4.0 * found.share[1]
    assert f"only {100 * found.share[0]:.0f} %" in found.not_shown.replace("only -0 %", "only 0 %")


def test_a_sign_that_is_wrong() -> None:
    found = after(usual(gains=np.array([1.0, -1.0, 1.0])))
    assert found.other > 0.99
    np.testing.assert_allclose(found.factors, [1.0, -1.0, 1.0], atol=0.05)
    assert f"{found.factors[1]:.2f}" in found.not_shown
    assert "sign" in found.not_shown


def test_nothing_is_said_before_there_are_rows() -> None:
    found = after(usual(share=0.0), count=15)
    assert not found.ready
    assert found.not_shown == ""


def test_what_is_known_of_the_arm_outlasts_a_change_of_what_is_carried() -> None:
    links = 8.0 * np.array([1.0, -1.2, 0.8, 1.1])
    found = after(usual(z=links))
    before = found.links
    found.renew()
    after(usual(z=links, payload=np.full(10, -3.0)), 20, 1, found)
    assert found.links == pytest.approx(before, rel=0.3)
    assert found.not_shown == ""


def test_rows_that_wait_when_something_changes_do_not_count() -> None:
    """Rows of another payload, which came before the change was found."""
    found = after(usual(), 300)
    after(usual(payload=np.full(10, 5.0)), 9, 1, found)
    found.drop()
    after(usual(), 100, 2, found)
    assert found.links < 1.4
    assert found.gains < 1.4


def test_a_tilt_that_becomes_known_is_taken_out_of_the_rows_so_far() -> None:
    tilt = np.array([0.03, -0.02])
    told, found = evidence(), evidence()
    for seed in range(40):
        arm = usual(tilt=tilt, noise=0.0)
        found.add(arm.rows(np.random.default_rng(seed)), FRICTION, N)
        rows = arm.rows(np.random.default_rng(seed))
        told.add(rows._replace(y=rows.y - rows.Y[:, FRICTION.stop :] @ tilt), FRICTION, N)
    found.turn(tilt)
    ours, theirs = (np.tril(e._moments.sum(axis=0)) for e in (found, told))
    width = ours.shape[-1]
    keep = [k for k in range(width) if k not in (width - 2, SHARED.size + 5)]  # gains and friction by load stay as they were
    np.testing.assert_allclose(ours[:, keep][:, :, keep], theirs[:, keep][:, :, keep], atol=1e-8)


def test_the_likelihood_is_that_of_the_normal_distribution() -> None:
    rng = np.random.default_rng(3)
    X, noise = rng.normal(size=(12, 4)), 0.4
    priors = np.array([[1.0, 1.0, 1.0, 1.0], [1.0 / 16.0, 1.0, 4.0, 1.0]])
    y = X @ rng.normal(size=4) + noise * rng.normal(size=12)
    ours = evidence_kernels.likelihoods(X.T @ X / noise**2, X.T @ y / noise**2, priors)
    dense = [multivariate_normal.logpdf(y, cov=X @ np.diag(1.0 / p) @ X.T + noise**2 * np.eye(12)) for p in priors]
    assert ours[1] - ours[0] == pytest.approx(dense[1] - dense[0], rel=1e-9)


def test_without_the_payload_the_rest_is_known_as_with_it() -> None:
    rng = np.random.default_rng(4)
    X = rng.normal(size=(60, 15))
    whole = X.T @ X
    left = evidence_kernels.without_payload(whole)
    assert not left[:10].any()
    assert not left[:, :10].any()
    both = np.linalg.inv(whole + np.diag([1.0] * 10 + [0.0] * 5))[10:, 10:]
    np.testing.assert_allclose(np.linalg.inv(left[10:, 10:]), both, rtol=1e-8)


def test_the_widest_hypothesis_stands_last_and_is_rare() -> None:
    all_of_them = Hypotheses.of(LINKS, N, 0.01)
    assert all_of_them.priors.shape[1] == LINKS + 1 + N
    assert (all_of_them.priors[-1] == all_of_them.priors.min(axis=0)).all()
    assert all_of_them.chance[0] == 0.0 == all_of_them.chance.max()
    assert all_of_them.chance[-1] == all_of_them.chance.min()


def changed(before: Arm, since: Arm, count: int = 60, by: float = 1.0) -> float:
    """What is said of a change between two arms, which an estimator takes for one of everything."""
    found, rng = after(before), np.random.default_rng(5)
    found.drop()
    for _ in range(count):
        found.add_since(since.rows(rng), FRICTION, N)
    return found.another(np.full(10, by))


def test_another_payload_is_told_from_the_same() -> None:
    arm = usual()
    assert changed(arm, arm) < -3.0
    assert changed(arm, replace(arm, payload=arm.payload + 0.3)) > 3.0


def test_what_may_be_wrong_with_an_arm_does_not_make_another_payload_of_the_same() -> None:
    arm = usual(z=4.0 * np.random.default_rng(7).normal(size=LINKS), gains=np.array([1.05, 0.97, 1.02]))
    assert changed(arm, arm) < -3.0


def test_nothing_is_said_before_the_model_was_weighed() -> None:
    found = evidence()
    found.add_since(usual().rows(np.random.default_rng(0)), FRICTION, N)
    assert found.another(np.ones(10)) == np.inf


def test_few_rows_do_not_gainsay_a_change_that_they_could_not_tell() -> None:
    assert changed(usual(), usual(), 60, by=0.02) == np.inf
    assert changed(usual(), usual(), 60) < -3.0


def test_another_payload_against_the_likelihood_of_dense_rows() -> None:
    rng = np.random.default_rng(2)
    s, links = 12, 1
    first, width = s + evidence_kernels.LOCAL, s + evidence_kernels.LOCAL + links + evidence_kernels.BEHIND
    old, new = rng.normal(size=(7, width)), rng.normal(size=(5, width))
    noise, prior = np.array([0.5]), np.array([[0.3, 2.0, 1.5]])
    moments = [np.tril(x.T @ x)[None] for x in (old, new)]
    whole = evidence_kernels.together(np.zeros((width, width)), moments[0], noise, s)
    told = evidence_kernels.another_payload(whole, moments[1], noise, s, first, prior, np.zeros(1))
    std = np.concatenate([np.ones(first), prior[0] ** -0.5])
    X, y = np.vstack([old, new])[:, :-1] * std, np.concatenate([old[:, -1], new[:, -1]])
    apart = np.hstack([X.copy(), np.vstack([np.zeros((7, 10)), new[:, :10]])])
    apart[7:, :10] = 0.0
    both = [multivariate_normal.logpdf(y, cov=Z @ Z.T + noise[0] * np.eye(12)) for Z in (apart, X)]
    assert told == pytest.approx(both[0] - both[1], rel=1e-9)
