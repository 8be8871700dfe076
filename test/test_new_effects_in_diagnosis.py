"""Two effects that the package does not have are registered here, and the diagnosis finds them: nothing else knows of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np
import pytest
from robots import robot
from test_diagnosis import ARM, Cause, record
from unsimulated import unsimulated as unsimulated

from sysid_ros import effects
from sysid_ros.diagnosis import diagnose
from sysid_ros.effects import EFFECTS, Acts, Depends, Effect, JointCurves, Knob, Motion
from sysid_ros.effects.effect import positive
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample


class GearRipple(JointCurves):
    """``tau_j = |tau_link| (s sin(n q) + c cos(n q))`` [1]: teeth that transmit more and less of the load over a turn."""

    id: ClassVar[str] = "gear_ripple"
    label: ClassVar[str] = "gear ripple under load"
    depends_on: ClassVar[frozenset[Depends]] = frozenset({Depends.LOAD})
    symbols: ClassVar[tuple[str, ...]] = ("s", "c")
    symbol_units: ClassVar[tuple[str, ...]] = ("1", "1")
    slide_units: ClassVar[tuple[str, ...]] = ("1", "1")
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("teeth", 3.0, 40.0, "1/rev", False, tried=38, bumpy=True),)
    signature: ClassVar[str] = "a line over the position whose height follows the load"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), teeth: float = 12.0) -> None:
        super().__init__(robot, joints)
        self.teeth = positive(teeth, "teeth", self.id)

    @property
    def settings(self) -> dict[str, Any]:
        return {"teeth": self.teeth}

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        angle = self.teeth * state.q
        ripple: FloatArray = np.abs(load) * np.stack([np.sin(angle), np.cos(angle)])
        return ripple


class TipDrag(Effect):
    """``tau = c J' J v``: drag of the tip's velocity, as of a hose that is pulled along [N s/m]."""

    id: ClassVar[str] = "tip_drag"
    label: ClassVar[str] = "drag of the tip"
    acts: ClassVar[Acts] = Acts.LINK
    nonnegative: ClassVar[bool] = True
    signature: ClassVar[str] = "friction of several joints at once that changes with the posture"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self._frame = robot.frame_id(robot.default_frame)
        self.parameter_names, self.units = ("c",), ("N s/m",)

    def fill(self, sample: Sample, out: FloatArray) -> None:
        J = self.robot.frame_jacobian_along(sample.q[None], self._frame)[0]
        out[:, 0] = J.T @ J @ sample.v


def ripple(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    out = tau.copy()
    out[:, 1] *= 1.0 + 0.1 * np.sign(tau[:, 1]) * np.sin(7.0 * q[:, 1] + 0.5)
    return out


def drag(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    J = model.frame_jacobian_along(q, model.frame_id(model.default_frame))
    dragged: FloatArray = tau + 4.0 * np.einsum("tij,tik,tk->tj", J, J, v)
    return dragged


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    for effect in (GearRipple, TipDrag):
        effects.register(effect)
    yield
    for effect in (GearRipple, TipDrag):
        del EFFECTS[effect.id]


CAUSES: dict[str, tuple[Cause, tuple[str, ...], dict[str, float]]] = {
    "gear_ripple": (ripple, ("lift",), {"s": 0.1 * np.cos(0.5), "c": 0.1 * np.sin(0.5), "teeth": 7.0}),
    "tip_drag": (drag, robot(ARM).joint_names, {"c": 4.0}),
}


@pytest.mark.parametrize("name", ["gear_ripple", pytest.param("tip_drag", marks=pytest.mark.slow)])
def test_an_effect_that_is_registered_at_run_time_is_named_with_its_joints_and_size(name: str) -> None:
    cause, joints, values = CAUSES[name]
    result = diagnose(robot(ARM), [record(cause, 1)], [record(cause, 2, 10.0)])
    assert [f.id for f in result.findings] == [name]
    (found,) = result.findings
    assert found.joints == joints
    assert {p.name for p in found.parameters} == set(values)
    for p in found.parameters:
        assert p.value == pytest.approx(values[p.name], rel=0.06)
        assert p.low < values[p.name] < p.high
    assert result.verdict == "explained"
    assert result.model is not None
    (block,) = [b for b in result.model.effects if b.effect == name]
    assert block.names == EFFECTS[name](robot(ARM), block.joints, **block.settings).parameter_names


def test_what_an_effect_does_not_say_has_a_sound_answer() -> None:
    effect = TipDrag(robot(ARM))
    assert effect.possible(np.ones(1), np.zeros(1))
    assert not effect.possible(-np.ones(1), np.zeros(1))
    assert np.isinf(effect.prior_std()).all()
    assert [dict(c.settings) for c in TipDrag.candidates([], None)] == [{}]
    assert effect.excludes(TipDrag(robot(ARM)))
    assert not effect.excludes(GearRipple(robot(ARM)))
    (p,) = effect.as_parameters(np.array([4.0]), np.array([[0.01]]))
    assert (p.name, p.joint, p.unit) == ("c", None, "N s/m")
    assert p.std == pytest.approx(0.1, rel=1e-2)
    assert [c.settings["teeth"] for c in GearRipple.candidates([], 0)] == [float(x) for x in range(3, 41)]
    one = GearRipple(robot(ARM), ["lift"], teeth=7.0)
    names = [(p.name, p.joint, p.unit) for p in one.as_parameters(np.array([0.1, 0.0, 7.0]), np.eye(3))]
    assert names == [("s", "lift", "1"), ("c", "lift", "1"), ("teeth", "lift", "1/rev")]
