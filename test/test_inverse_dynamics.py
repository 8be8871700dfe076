"""Compiled inverse dynamics of whole motions, and many springs side by side, against what they stand in for."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from robots import robot
from test_diagnosis import ARM, coulomb, record

from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.effects import EFFECTS
from sysid_ros.robot.inverse_dynamics import inverse_dynamics_along


@pytest.mark.parametrize("seed", range(6))
def test_a_motion_needs_the_torques_of_its_samples(seed: int) -> None:
    """On trees of hinges and slides about any axis, with rotors."""
    rng = np.random.default_rng(seed)
    model, n = pin.Model(), 6
    for j in range(n):
        axis = rng.normal(size=3)
        kind = pin.JointModelPrismaticUnaligned if rng.uniform() < 0.3 else pin.JointModelRevoluteUnaligned
        joint = model.addJoint(int(rng.integers(j + 1)), kind(axis / np.linalg.norm(axis)), pin.SE3.Random(), f"joint {j}")
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Random())
    model.armature = rng.uniform(0.0, 1.0, n)
    q, v, a = (rng.normal(size=(20, n)) for _ in range(3))
    data = model.createData()
    expected = [pin.rnea(model, data, *state) for state in zip(q, v, a, strict=True)]
    np.testing.assert_allclose(inverse_dynamics_along(model, q, v, a, model.gravity.linear), expected, rtol=1e-10, atol=1e-10)


def test_springs_side_by_side_do_what_each_does_alone() -> None:
    model = robot(ARM)
    (motion,) = prepare(model, [record(coulomb, 1, 8.0)], []).motions
    kind = EFFECTS["joint_elasticity"]
    effects = [kind.from_settings(model, [model.joint_names[1]], dict(c.settings)) for c in kind.candidates([motion], 1)]
    alone = np.stack([effect.own_curve(motion) for effect in effects])
    np.testing.assert_allclose(kind.own_curves(motion, effects), alone, rtol=1e-7, atol=1e-9 * np.abs(alone).max())
