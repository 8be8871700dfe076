"""An estimator that is registered at run time is as good as those of the package, without another file that knows of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from sysid_ros.cli.main import sysid
from sysid_ros.estimators import ESTIMATORS, Estimate, Estimator, register
from sysid_ros.online.payload_estimate import STATUSES
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.sample import FloatArray

BAG = Path(__file__).resolve().parents[1] / "bags" / "arm_pick_and_drop"
NAME = "random_walk_in_numpy"


class RandomWalk(Estimator):
    """A Kalman filter whose parameters walk at random; only what an estimator must have, by the textbook."""

    def __init__(self, prior_std: FloatArray, variance: FloatArray, period: float, forgetting_time: float) -> None:
        super().__init__(len(prior_std), len(variance))
        self.prior, self.R = np.diag(np.square(prior_std)), np.diag(variance)
        self.Q = self.prior * period / forgetting_time
        self.reset()

    def reset(self) -> None:
        self.x, self.C = np.zeros(self.p), self.prior.copy()

    @property
    def theta(self) -> FloatArray:
        return self.x.copy()

    def covariance(self) -> FloatArray:
        return self.C.copy()

    def update(
        self,
        Y: FloatArray,
        tau: FloatArray,
        hold: bool = False,
        extra_variance: FloatArray | None = None,
        considered: FloatArray | None = None,
    ) -> Estimate:
        innovation = tau - Y @ self.x
        if not (np.isfinite(Y).all() and np.isfinite(tau).all()):
            return Estimate(self.theta, innovation, "not_finite", "the rows are not finite")
        if hold:
            return Estimate(self.theta, innovation, "not_excited", "nothing excites the parameters")
        R = self.R if extra_variance is None else self.R + np.diag(extra_variance)
        C = self.C + self.Q
        K = np.linalg.solve(Y @ C @ Y.T + R, Y @ C).T
        rest = np.eye(self.p) - K @ Y
        self.x, self.C = self.x + K @ innovation, rest @ C @ rest.T + K @ R @ K.T
        return Estimate(self.theta, innovation, "ok", "")


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    register(NAME, RandomWalk)
    yield
    del ESTIMATORS[NAME]


def test_it_reports_a_pick_and_a_drop_in_the_replay(tmp_path: Path) -> None:
    config, answer, series = tmp_path / "node.yaml", tmp_path / "replay.json", tmp_path / "series.csv"
    lines = ["/**:", "  ros__parameters:", f"    estimator: {NAME}", "    forgetting_time: 600.0", "    estimate_friction: false"]
    config.write_text("\n".join(lines) + "\n", encoding="utf-8")
    result = CliRunner().invoke(
        sysid,
        ["replay", str(BAG), "--config", str(config), "--json", str(answer), "--series", str(series)],
        catch_exceptions=False,
    )
    assert result.exit_code == 0, result.output
    truth = json.loads(BAG.with_name(f"{BAG.name}.truth.json").read_text(encoding="utf-8"))
    found = json.loads(answer.read_text(encoding="utf-8"))
    pick, drop = found["events"]
    assert (pick["kind"], drop["kind"]) == ("pick", "drop")
    assert abs(pick["mass_after"] - 1.8) < 0.03
    assert abs(drop["mass_after"]) < 0.03
    assert 5.5 < drop["t"] - pick["t"] < 6.5
    assert found["status"] == "no_payload"
    rows = np.genfromtxt(series, delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert set(rows["status"]) <= set(STATUSES)
    assert {"warming_up", "ok", "no_payload"} <= set(rows["status"])
    carried = rows[(rows["t"] < drop["t"] - 0.1) & (rows["status"] == "ok")]
    assert len(carried) > 100
    error = np.abs(carried["m"] - 1.8)
    assert np.mean(error < 1.96 * carried["m_std"]) > 0.9
    assert float(carried["m_std"][-1]) < 0.05
    assert truth["payload"]["mass"] == 1.8


def test_the_settings_and_the_node_know_its_name() -> None:
    assert OnlineSettings(estimator=NAME).estimator == NAME
    pytest.importorskip("rclpy", reason="rclpy is not installed (extra ros)")
    from sysid_ros.nodes.parameters import ESTIMATOR_GROUPS

    found = {f.name: f for group in ESTIMATOR_GROUPS for f in fields(group)}
    assert NAME in found["estimator"].metadata["choices"]


def test_the_package_keeps_no_list_of_estimators() -> None:
    """Nobody outside the folder asks for the class of an estimator."""
    root = BAG.parents[1] / "sysid_ros"
    names = [*(getattr(make, "__name__", "") for make in ESTIMATORS.values()), Estimator.__name__]
    asking = [
        f"{path.relative_to(root)}:{k}"
        for path in root.rglob("*.py")
        if path.parent.name != "estimators"
        for k, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if "isinstance" in line and any(name in line for name in names)
    ]
    assert not asking
