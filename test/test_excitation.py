"""The search: what it finds keeps every limit, tells more than random motions, and is the same again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from robots import robot
from test_collision_model import chain, kuka

from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.excite import Excitation, excite, steps
from sysid_ros.identification import free_model
from sysid_ros.pages import write_plot
from sysid_ros.pages.excitation_figure import excitation_figure
from sysid_ros.robot.collision_model import CollisionModel
from sysid_ros.robot.mesh_files import MeshFiles
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.torque.torque_model import TorqueModel

QUICK = ExcitationSettings(duration=4.0, harmonics=3, starts=1, comparison=3, floor=-0.4, clearance=0.01, seed=3)


def search(arm: RobotModel, settings: ExcitationSettings, start: FloatArray | None = None) -> tuple[Excitation, CollisionModel]:
    collision = CollisionModel(arm, clearance=settings.clearance, floor=settings.floor)
    return excite(free_model(arm), settings, collision=collision, start=start), collision


@pytest.fixture(scope="module")
def found() -> tuple[Excitation, CollisionModel]:
    return search(RobotModel.from_urdf(chain()), QUICK)


def require_feasible(result: Excitation, settings: ExcitationSettings, collision: CollisionModel, step: float) -> None:
    """Every limit, by the definitions, from the URDF's numbers."""
    arm = result.limits.robot
    t = np.arange(0.0, result.trajectory.duration + 0.5 * step, step)
    q, v, a = result.trajectory.sample(t)
    assert v[[0, -1]] == pytest.approx(0.0, abs=1e-9)
    assert a[[0, -1]] == pytest.approx(0.0, abs=1e-9)
    middle, room = 0.5 * (arm.position_lower + arm.position_upper), 0.5 * (arm.position_upper - arm.position_lower)
    assert np.all(np.abs(q - middle) <= settings.position_scale * room)
    assert np.all(np.abs(v) <= settings.velocity_scale * arm.velocity_limit)
    assert np.all(np.abs(a) <= np.where(arm.is_prismatic, settings.slide_acceleration_limit, settings.acceleration_limit))
    known, zero = TorqueModel(arm, ()), np.zeros(arm.n)
    torque = np.array([known.known_torque(Sample(0.0, *state, zero)) for state in zip(q, v, a, strict=True)])
    assert np.all(np.abs(torque) <= settings.effort_scale * arm.effort_limit)
    assert min(collision.room(x).min() for x in q) >= 0.0


def test_all_limits_are_kept_at_a_millisecond(found: tuple[Excitation, CollisionModel]) -> None:
    require_feasible(found[0], QUICK, found[1], 1e-3)
    assert found[0].use.feasible


def test_it_tells_more_than_every_random_motion(found: tuple[Excitation, CollisionModel]) -> None:
    result, _ = found
    assert len(result.random) == QUICK.comparison
    assert [c.d for c in result.random] == sorted((c.d for c in result.random), reverse=True)
    assert result.criteria.d > result.random[0].d + len(result.parameters) * 0.1
    assert result.criteria.d == max(result.start_d)


def test_the_same_seed_gives_the_same_motion(found: tuple[Excitation, CollisionModel]) -> None:
    again, _ = search(RobotModel.from_urdf(chain()), QUICK)
    assert np.array_equal(again.trajectory.coefficients, found[0].trajectory.coefficients)


def test_progress_adds_up() -> None:
    total: list[int] = []
    settings = ExcitationSettings(duration=2.0, harmonics=2, starts=2, comparison=2)
    excite(free_model(RobotModel.from_urdf(chain())), settings, progress=total.append)
    assert sum(total) == steps(settings)


def test_it_starts_and_ends_where_it_is_told() -> None:
    start = np.array([-0.3, 0.2, 0.4])
    result, collision = search(RobotModel.from_urdf(chain()), QUICK, start)
    for t in (0.0, QUICK.duration):
        assert result.trajectory.sample(np.array([t]))[0][0] == pytest.approx(start, abs=1e-12)
    require_feasible(result, QUICK, collision, 2e-3)
    assert result.criteria.d > result.random[0].d


def test_joints_without_end_and_slides() -> None:
    arm = robot("small_arm")
    settings = ExcitationSettings(duration=6.0, period=3.0, harmonics=3, starts=1, comparison=2)
    result, _ = search(arm, settings)
    q, v, a = result.trajectory.sample(result.trajectory.grid())
    tau = arm.rnea_along(q, v, a)
    assert np.all((q >= result.limits.lower) & (q <= result.limits.upper))
    assert np.abs(q[:, 0]).max() < np.pi
    assert np.all(np.abs(tau) <= 0.8 * arm.effort_limit)
    assert np.all(np.abs(v) <= 0.8 * arm.velocity_limit)
    half = len(q) // 2
    assert q[: half + 1] == pytest.approx(q[half:], abs=1e-9)
    assert result.criteria.unweighted_condition_number < 100.0


def test_what_can_not_be_done_is_said() -> None:
    arm = RobotModel.from_urdf(chain())
    with pytest.raises(DataError, match="no motion is feasible"):
        search(arm, ExcitationSettings(duration=4.0, floor=2.0))
    with pytest.raises(SettingsError, match="whole number of periods"):
        search(arm, ExcitationSettings(duration=10.0, period=3.0))


@pytest.mark.slow
def test_a_poor_motion_is_warned_of() -> None:
    settings = ExcitationSettings(duration=2.0, harmonics=2, starts=1, comparison=1, position_scale=0.001, velocity_scale=0.001)
    result = excite(free_model(RobotModel.from_urdf(chain())), settings)
    assert result.criteria.condition_number > 100.0
    assert any("condition number" in sentence for sentence in result.warnings)


@pytest.mark.parametrize("suffix", ["png", "html"])
def test_the_figure_is_written(tmp_path: Path, found: tuple[Excitation, CollisionModel], suffix: str) -> None:
    path = tmp_path / f"motion.{suffix}"
    write_plot(path, excitation_figure(found[0], "A <motion> of a chain"))
    content = path.read_bytes()
    if suffix == "png":
        assert content.startswith(b"\x89PNG")
    else:
        text = content.decode()
        assert "joint2" in text
        assert "&lt;motion&gt;" in text or "\\u003cmotion" in text
        assert 'src="http' not in text


def test_a_start_in_a_corner_does_not_throw_the_search_off() -> None:
    text = chain().replace('lower="-3" upper="3"', 'lower="-3" upper="0.02"')
    settings = ExcitationSettings(duration=3.0, harmonics=3, starts=1, comparison=2, acceleration_limit=20.0, velocity_scale=1.0)
    result, collision = search(RobotModel.from_urdf(text), settings)
    require_feasible(result, settings, collision, 2e-3)
    assert min(result.start_d) > max(c.d for c in result.random)


@pytest.mark.slow
def test_a_seven_joint_arm_in_ten_seconds_of_five_harmonics() -> None:
    path = kuka()
    arm, settings = RobotModel.from_urdf(path.read_text()), ExcitationSettings(floor=0.0)
    collision = CollisionModel(arm, MeshFiles(path.parent), settings.clearance, settings.floor)
    result = excite(free_model(arm), settings, collision=collision)
    require_feasible(result, settings, collision, 1e-3)
    assert len(result.random) == 20
    assert result.criteria.d > max(c.d for c in result.random)
    assert result.criteria.condition_number < 100.0
    assert result.criteria.unweighted_condition_number < 100.0
