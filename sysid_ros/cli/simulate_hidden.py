"""``sysid simulate arm --hide``: record a bag of an arm that hides something its URDF lacks."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from sysid_ros.cli.output import warn
from sysid_ros.cli.progress import progress_bar
from sysid_ros.cli.simulate_output import Rows, conclude, named_option, parameter_rows, recorder_of
from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import JointStateRecord
from sysid_ros.simulation.arm_record import START_TIME
from sysid_ros.simulation.description import arm_description

_SHARED = {"seed", "duration", "rate", "encoder_noise", "torque_noise", "velocity_noise"}
_OWN = {"hide", "hide_value", "hide_seed", "velocity"}
_DURATION = 25.0
_SEEN = 4.0


def parse_effect(text: str) -> tuple[str, str | None]:
    """``EFFECT`` or ``EFFECT@JOINT``."""
    id_, _, joint = text.partition("@")
    return id_, joint or None


def parse_values(texts: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """``NAME=X[,X...]`` or ``EFFECT.NAME=X[,X...]``, each.

    Raises:
        SettingsError: it is neither.
    """
    out = {}
    for text in texts:
        name, _, numbers = text.partition("=")
        try:
            out[name] = tuple(float(x) for x in numbers.split(","))
        except ValueError:
            raise SettingsError(
                f"--hide-value is '{text}'; it must be NAME=NUMBER, or NAME=X,Y,Z for a vector, such as Fc=2.5 or com=0,0.02,0.1."
            ) from None
    return out


def record_hidden(bag: Path, storage: str, json_file: Path | None, options: dict[str, Any]) -> None:
    """Simulate, write the bag and its truth, and show what is hidden.

    Raises:
        SettingsError: an option does not go with ``--hide``, or what is asked for can't be hidden.
    """
    from sysid_ros.simulation.hidden_effects import cause_of
    from sysid_ros.simulation.hidden_effects.hide import HiddenScenario, hide_in_arm

    context = click.get_current_context()
    given = {name for name in options if context.get_parameter_source(name) is ParameterSource.COMMANDLINE}
    if foreign := sorted(given - _SHARED - _OWN):
        name = next(p.opts[0] for p in context.command.params if p.name == foreign[0])
        raise SettingsError(f"{name} is given beside --hide; with --hide everything is hidden by --hide. Leave {name} out.")
    settings = {name: options[name] for name in _SHARED}
    settings["duration"] = options["duration"] if "duration" in given else _DURATION
    began = time.perf_counter()
    urdf = arm_description()
    try:
        scenario = HiddenScenario(
            hide=[parse_effect(text) for text in options["hide"]],
            values=parse_values(options["hide_value"]),
            hide_seed=options["hide_seed"],
            **settings,
        )
        with progress_bar("Simulating", round(scenario.duration * scenario.rate)) as advance:
            recording, truth = hide_in_arm(scenario, urdf, START_TIME, advance)
    except SettingsError as error:
        raise named_option(error, {*_SHARED, *_OWN}) from None
    records = recording.records()
    if not options["velocity"]:
        records = [JointStateRecord(r.stamp, r.receive_time, r.names, r.position, (), r.effort) for r in records]
    with recorder_of(bag, storage, truth) as recorder:
        recorder.write_robot_description(urdf, START_TIME)
        recorder.write_joint_states(records)
    conclude(bag, json_file, len(records), time.perf_counter() - began, truth, _rows(truth))
    seen = truth["residual_over_noise"]
    if seen is not None and max(seen) < _SEEN and any(cause_of(id_).in_torque for id_, _ in scenario.hide):
        warn(
            f"what is hidden is at most {max(seen):.2g} times the noise floor of any joint, and hardly anyone can find it. Hide "
            "it on another joint (EFFECT@JOINT), make it larger (--hide-value), or choose another --hide-seed."
        )


def _rows(truth: dict[str, Any]) -> Rows:
    """What is hidden, with its parameters."""
    rows: Rows = [("simulator", truth["simulator"])]
    for effect in truth["effects"]:
        where = "the whole arm" if effect["joints"] == truth["joint_names"] else ", ".join(effect["joints"])
        kind = f" ({effect['kind']})" if effect["kind"] else ""
        rows.append(("hidden", f"{effect['name']}{kind} on {where}"))
        rows += parameter_rows(effect)
    return rows
