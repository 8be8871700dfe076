"""Options of ``sysid simulate quadruped`` that MuJoCo alone has, and the recording that it makes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from sysid_ros.cli import options as opt
from sysid_ros.cli.simulate_output import Rows, conclude, named_option, parameter_rows, payload_rows, recorder_of, simulated
from sysid_ros.exceptions import SettingsError
from sysid_ros.simulation.legged_scenario import OWN, LeggedScenario
from sysid_ros.simulation.quadruped_record import write_quadruped

if TYPE_CHECKING:  # it needs MuJoCo
    from sysid_ros.simulation.hidden_on_legs import Recorded

_ABSENT = ("controller_knows_payload", "lifted_foot", "hoist_time", "hoist_duration")
_OPTIONS = (
    click.option("--robot", default="a1", metavar="NAME", help="Of example-robot-data, or a URDF's path; MuJoCo, as all below."),
    opt.number("--leg-friction", default=0.0, help="Dry, of the joints on the mean. [N m]"),
    opt.number("--leg-damping", default=0.0, help="Viscous friction. [N m s/rad]"),
    opt.number("--rotor-inertia", default=0.0, help="Of the motors, at the joints. [kg m^2]"),
    opt.number("--mass-error", default=0.0, help="Standard deviation of the links' masses, as a part."),
    click.option("--foot-spheres/--no-foot-spheres", default=True, show_default=True, help="The URDF tells the feet's spheres."),
    opt.number("--encoder-step", default=0.0, help="Of the positions. [rad]"),
    opt.number("--imu-rate", default=0, help="A divisor of 1000; 0: that of the joints. [Hz]"),
    opt.number("--imu-delay", default=0.0, help="Of the IMU's stamps. [s]"),
    click.option("--imu-low-pass/--no-imu-low-pass", default=True, show_default=True, help="The IMU shows means, not moments."),
    opt.vector("--imu-tilt", metavar="R P Y", default=(0.0, 0.0, 0.0), help="Of the IMU beside what the URDF tells. [rad]"),
    opt.vector("--imu-lever", default=(0.0, 0.0, 0.0), help="Place of the IMU beside what the URDF tells. [m]"),
    opt.number("--contact-delay", default=0.0, help="Of the feet's messages. [s]"),
    click.option(
        "--motion", default="", metavar="FILE", help="A joint trajectory to follow in place of a gait: what 'sysid excite' wrote."
    ),
    opt.number("--stairs", default=0.0, help="Rise of steps that go up and down; 0: even ground. [m]"),
    click.option("--shift", "shift_time", type=float, metavar="T", help="The payload slips by 5 cm after T s."),
    click.option("--push", "push_time", type=float, metavar="T", help="A push to the side after T s."),
)


def legged_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options to a command."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def without_own(options: dict[str, Any]) -> dict[str, Any]:
    """The options of a simulation in PyBullet.

    Raises:
        SettingsError: one was given that MuJoCo alone has.
    """
    _refuse([name for name in OWN if _given(name)], "--simulator is pybullet, which has no {}; take --simulator mujoco")
    return {name: value for name, value in options.items() if name not in OWN}


def with_hidden(record: Recorded, hide: Sequence[str], seed: int) -> Recorded:
    """The recording with what ``--hide`` asks for in it.

    Raises:
        SettingsError: it can't be hidden.
    """
    from sysid_ros.simulation.hidden_on_legs import Wish, hide_on_legs

    try:
        return hide_on_legs(record, [Wish.parse(text) for text in hide], seed) if hide else record
    except SettingsError as error:
        raise named_option(error, {"hide"}) from None


def hidden_rows(truth: dict[str, Any]) -> Rows:
    """What is hidden, with its parameters."""
    rows: Rows = []
    for effect in truth.get("effects", []):
        where = "the whole robot" if len(effect["joints"]) == len(truth["joint_names"]) else ", ".join(effect["joints"])
        rows.append(("hidden", f"{effect['name']} ({where})"))
        rows += parameter_rows(effect)
    return rows


def record_legged(
    bag: Path, storage: str, json_path: Path | None, imu: bool, contacts: bool, options: dict[str, Any],
    hidden: tuple[Sequence[str], int] = ((), 0),
) -> None:  # fmt: skip
    """Simulate in MuJoCo, write the bag and its truth, and show what was simulated.

    Args:
        hidden: what ``--hide`` asks for, and its seed.

    Raises:
        SettingsError: an option is not allowed, MuJoCo does not have it, or is not installed.
    """
    from sysid_ros.simulation.legged_record import simulate_legged
    from sysid_ros.simulation.simulators import installed

    installed("mujoco")
    _refuse([name for name in _ABSENT if _given(name)], "--simulator is mujoco, which has no {}; leave it out")
    began = time.perf_counter()
    chosen = {name: value for name, value in options.items() if name not in _ABSENT}
    record = with_hidden(simulated(LeggedScenario, simulate_legged, chosen), *hidden)
    truth = record.truth
    with recorder_of(bag, storage, truth) as recorder:
        write_quadruped(record, recorder, imu, contacts)
    settings = truth["settings"]
    more = [
        *payload_rows(truth),
        *hidden_rows(truth),
        ("motion", f"{settings['motion'] or truth['gait']}, joints hold their positions"),
        ("hidden", f"dry friction {settings['leg_friction']:g} N m, rotors {settings['rotor_inertia']:g} kg m^2 on the mean"),
        ("noise", f"effort {truth['noise']['torque']:g} N m, position {truth['noise']['encoder']:g} rad"),
    ]
    conclude(bag, json_path, len(record.measured), time.perf_counter() - began, truth, more)


def _given(name: str) -> bool:
    return click.get_current_context().get_parameter_source(name) is ParameterSource.COMMANDLINE


def _refuse(names: list[str], sentence: str) -> None:
    if names:
        option = next(p.opts[0] for p in click.get_current_context().command.params if p.name == names[0])
        raise SettingsError(f"{sentence.format(option)}.")
