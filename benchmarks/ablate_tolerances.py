"""What each threshold of the checks in the frequency domain is good for: changed in turn, on joints and arms of known truth.

    python benchmarks/ablate_tolerances.py [--only NAME ...] [--factor 2 ...] [--json FILE]

A case is right where the cause, the friction that is missing, the modes and the verdict are those of the equations. Reported are
the cases that are right and those of which anything at all is told differently.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

# in place of this folder, in which another benchmark has the name of a peer
sys.path[0] = str(Path(__file__).resolve().parents[1] / "test")

from arm_recordings import hidden_parameters, recorded  # noqa: E402
from robots import robot  # noqa: E402
from two_mass import TwoMass, model_of, multisine, published, sweep  # noqa: E402

from sysid_ros.effects import CoulombFriction  # noqa: E402
from sysid_ros.exceptions import SysidError  # noqa: E402
from sysid_ros.frequency_domain import FrequencyCheck, check_frequency, modes  # noqa: E402
from sysid_ros.frequency_domain.tolerances import TOLERANCES  # noqa: E402
from sysid_ros.identification import Recording, free_model  # noqa: E402
from sysid_ros.sample import FloatArray  # noqa: E402
from sysid_ros.torque.known_effect import KnownEffect  # noqa: E402

ELASTIC = TwoMass(stiffness=4000.0, spring_damping=4.0, damping=0.2)
RIGID = TwoMass()
SWEEP = sweep(14.0, 0.3, 25.0, 0.06)
SLOW = sweep(14.0, 0.1, 6.0, 0.4)
PERIODS = multisine(4.0, 4, np.arange(1.0, 90.0, 2.0), 0.008, 0)
NOISE: dict[str, Any] = {"torque_noise": 1.0, "encoder_noise": 5e-6}
LOUD: dict[str, Any] = {"torque_noise": 4.0, "encoder_noise": 2e-5}
RUBS = 4.0
Case = tuple[str, Callable[[], FrequencyCheck], str]


def joint(
    kind: TwoMass, r: FloatArray = SWEEP, seed: int = 0, rub: tuple[float, float, float] | None = None, **channels: Any
) -> FrequencyCheck:
    """One joint; ``rub`` (level, turns, viscous) is friction in its torque, of which the model knows the level ``RUBS`` where it
    turns softly."""
    arm, known = model_of(kind)
    run = published(kind, r, seed, **{**NOISE, **channels})
    if rub is not None:
        level, turns, viscous = rub
        assert run.v is not None
        run = Recording("rough", run.t, run.q, run.v, run.tau + level * np.tanh(run.v / turns) + viscous * run.v)
        if turns > 0.01:
            known = [*known, KnownEffect(CoulombFriction(arm), np.array([RUBS]))]
    return check_frequency(arm, [Recording("run", run.t, run.q, None, run.tau)], known)


def arm() -> FrequencyCheck:
    """An arm of which one joint stands."""
    model = robot("small_arm")
    theta = hidden_parameters(model, 3)
    run = recorded(model, theta, 3, seconds=14.0, torque_noise=0.1, still=("lift",))
    free = free_model(model)
    known = [KnownEffect(e, theta[w]) for e, w in zip(free.free, free.slices, strict=True)]
    return check_frequency(model, [run], known)


CASES: tuple[Case, ...] = (
    ("rigid, coloured noise", lambda: joint(RIGID, seed=1, colour=0.97), "nothing"),
    ("elastic, loud", lambda: joint(ELASTIC, seed=1, **LOUD), "resonance poles"),
    ("encoder on the link", lambda: joint(ELASTIC, on_link=True), "delay+anti_resonance"),
    ("late", lambda: joint(RIGID, seed=1, delay=0.0081), "delay"),
    ("late and elastic", lambda: joint(ELASTIC, seed=2, delay=0.006), "delay+resonance poles"),
    ("periods", lambda: joint(ELASTIC, PERIODS), "resonance poles"),
    ("rubs, model does not", lambda: joint(RIGID, SLOW, rub=(4.0, 1e-3, 3.0)), "friction"),
    ("rubs softly, model sharply", lambda: joint(RIGID, rub=(4.4, 0.06, 0.0)), ""),
    ("arm, one joint rests", arm, "nothing"),
)


def told(check: FrequencyCheck) -> tuple[str, ...]:
    """All sentences, numbers rounded to two digits."""
    return tuple(
        re.sub(r"\d+\.?\d*", lambda m: f"{float(m.group()):.2g}", s)
        for j in check.joints
        for s in (*j.sentences, *check.sentences)
    )


def right(check: FrequencyCheck, expected: str) -> bool:
    """Whether every joint that was checked says what is expected."""
    for j in check.joints:
        if j.torque is None:
            continue
        if expected == "friction":
            if j.friction is None:
                return False
            continue
        cause = j.torque.cause
        named = cause.name if cause is not None and cause.named else "nothing"
        poles = " poles" if j.modes is not None and j.modes.unmodelled else ""
        healthy = named == "nothing" and (j.torque.verdict.fails_from is not None or j.torque.verdict.holds_to is None)
        if j.friction is not None or (expected and named + poles != expected) or (named == "nothing" and healthy and expected):
            return False
    return True


def outcome() -> tuple[list[bool], list[tuple[str, ...]]]:
    """Of all cases: right or not, and what is told; an error counts as wrong."""
    good, words = [], []
    for _, run, expected in CASES:
        try:
            check = run()
            good.append(right(check, expected))
            words.append(told(check))
        except (SysidError, ValueError, IndexError) as error:  # a tolerance far off may leave nothing to check
            good.append(False)
            words.append((str(error),))
    return good, words


def _changed(value: Any, factor: float) -> Any:
    if isinstance(value, tuple):
        return tuple(_changed(v, factor) for v in value)
    return max(round(value * factor), 0) if isinstance(value, int) else value * factor


@click.command()
@click.option("--only", multiple=True, help="Names of tolerances.")
@click.option("--factor", multiple=True, default=(0.5, 2.0), show_default=True, help="What each is multiplied by.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="File for the numbers.")
def main(only: tuple[str, ...], factor: tuple[float, ...], json_path: Path | None) -> None:
    """Change every tolerance in turn."""
    console = Console()
    modes._DRAWS = 30
    base, base_words = outcome()
    console.print(
        f"as they are: {sum(base)} of {len(base)} right; wrong: {[c[0] for c, g in zip(CASES, base, strict=True) if not g]}"
    )
    heads = [head for f in factor for head in (f"right, times {f:g}", "told differently")]
    table = Table("tolerance", "value", *heads)
    rows: dict[str, Any] = {"base": sum(base)}
    for field in fields(TOLERANCES):
        if only and field.name not in only:
            continue
        value, cells = getattr(TOLERANCES, field.name), []
        for f in factor:
            object.__setattr__(TOLERANCES, field.name, _changed(value, f))
            good, words = outcome()
            cells += [sum(good), sum(a != b for a, b in zip(words, base_words, strict=True))]
        object.__setattr__(TOLERANCES, field.name, value)
        rows[field.name] = cells
        table.add_row(field.name, str(value), *map(str, cells))
        print(field.name, value, cells, flush=True)
        if json_path:
            json_path.write_text(json.dumps(rows, indent=1))
    console.print(table)


if __name__ == "__main__":
    main()
