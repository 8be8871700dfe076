"""What a change costs: levers of a bag's motion are those of finite differences, and an alarm says them in mm and N m."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fleet_bags import ARM, Hidden, recording
from robots import robot

pytest.importorskip("pyarrow", reason="the extra fleet is not installed")

from test_fleet_changes import small_fleet, stored

from sysid_ros.fleet.changes.alarms import alarms
from sysid_ros.fleet.changes.fleet_changes import fleet_changes
from sysid_ros.fleet.changes.quantities import CARRIED, QUANTITIES, Costs
from sysid_ros.fleet.known_robot import KnownRobot
from sysid_ros.fleet.track import track


def test_levers_are_those_of_small_steps() -> None:
    model, of = robot(ARM), recording(Hidden(), 3)
    found = track(KnownRobot(model, None, model.default_frame, np.zeros(10)), of).levers
    step, q = 1e-6, of.q[::20]
    v = np.gradient(of.q, of.t, axis=0)
    a, v = np.gradient(v, of.t, axis=0)[::20], v[::20]
    for k in range(model.n):
        moved = q + step * np.eye(model.n)[k]
        way = [model.frame_placement(x, model.default_frame)[1] - model.frame_placement(y, model.default_frame)[1]
               for x, y in zip(moved, q, strict=True)]  # fmt: skip
        reach = np.sqrt(np.mean(np.sum(np.square(way), axis=1))) / step
        assert found.reach[k] == pytest.approx(reach, rel=0.02)
        by_zero = (model.rnea_along(moved, v, a) - model.rnea_along(q, v, a)) / step
        assert found.by_zero[k] == pytest.approx(np.sqrt(np.mean(by_zero**2, axis=0)).max(), rel=0.05)
    frame = model.frame_id(model.default_frame)
    mass = np.array([model.payload_regressor(*x, frame)[:, 0] for x in zip(q, v, a, strict=True)])
    np.testing.assert_allclose(found.by_mass, np.sqrt(np.mean(mass**2, axis=0)), rtol=0.05, atol=0.02)


def test_an_alarm_says_what_it_costs_on_this_arm(tmp_path: Path) -> None:
    on = Costs("elbow", torque=30.0, lever=0.8, per_zero=40.0, per_mass=7.0)
    assert QUANTITIES["joint_offset"].cost(0.01, on) == "8 mm at the tip, 0.4 N m in the usual motion"
    assert QUANTITIES["joint_offset"].cost(0.01, Costs("elbow")) == "10 mm at the tip for each metre from this joint"
    assert QUANTITIES["torque_gain"].cost(-0.05, on) == "5 % of every torque that is read: 1.5 N m in the usual motion"
    assert QUANTITIES[CARRIED].cost(-0.3, on) == "2.1 N m less on elbow in the usual motion"
    changes = fleet_changes(stored(small_fleet(), tmp_path / "store"))
    tool = next(a for a in alarms(changes) if a.change.quantity == CARRIED)
    joints = next(r for r in changes.series.robots if r.name == tool.change.robot).joints
    costliest = max(joints, key=lambda s: s.costs.per_mass or 0.0)
    assert tool.cost.endswith(f"on {costliest.joint} in the usual motion")
