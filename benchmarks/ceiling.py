"""The ceiling on robots that hide what the library is denied, and on healthy ones: does it name the joint and the size?

    python benchmarks/ceiling.py [--model diagnosis] [--hidden 60] [--healthy 60] [--seed-base 20000] [--keep DIR] [--json FILE]

A robot of the exam (compiled physics or MuJoCo) hides one effect that follows its motion, which the library is denied: with
``--model plain``, some seconds a robot, it has nothing but the URDF's links, offset, viscous and Coulomb friction; with ``--model
diagnosis`` the robot is diagnosed with all else that the library has. The truth is what that model leaves less the noise that the
sensors added, which the simulation knows: rms of the residual less rms of that noise, below the ceiling's cut-off and while the
joint moves. Robots on which the rest of the library explains the effect are counted apart: nothing is missing there. ``--keep``
keeps the residuals of all robots, so that the ceiling alone can be judged again.
"""

from __future__ import annotations

import importlib
import os
import pickle
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

os.environ.setdefault("OMP_NUM_THREADS", "1")

import click
import numpy as np
from rich.console import Console
from rich.table import Table

# in place of this folder, in which another benchmark has the name of a peer
sys.path[0] = str(Path(__file__).resolve().parents[1] / "test")
sys.path.append(str(Path(__file__).resolve().parent))

from exam.candidate import recording_of  # noqa: E402
from verdict import Target, conclude  # noqa: E402

from sysid_ros.blackbox.ceiling import ceiling  # noqa: E402
from sysid_ros.blackbox.rest_inputs import RestInputs, cutoff_of  # noqa: E402
from sysid_ros.effects import EFFECTS  # noqa: E402
from sysid_ros.robot.robot_model import RobotModel  # noqa: E402
from sysid_ros.robot.smoothed_sign import smoothed_sign  # noqa: E402
from sysid_ros.sample import FloatArray  # noqa: E402
from sysid_ros.signals.conditioning import as_measured  # noqa: E402
from sysid_ros.signals.conditioning import motions as motions_of  # noqa: E402
from sysid_ros.signals.motion import Motion  # noqa: E402
from sysid_ros.signals.recording import Recording  # noqa: E402

FOLLOWING = (
    "cogging",
    "spring",
    "stribeck_friction",
    "asymmetric_coulomb_friction",
    "load_dependent_friction",
    "quadratic_friction",
    "presliding_hysteresis",
    "backlash",
    "joint_coupling",
    "joint_elasticity",
    "outside_neighbour_damping",
    "outside_neighbour_friction",
)
"""Effects that are functions of the motion: what follows the clock alone (a hum, a drift, a push) no black box of a motion can
tell from noise."""
_MISSING = 0.2
"""Part of the noise (rms) that what is missing on a joint must be to count as missing."""
Kept = dict[str, Any]


@contextmanager
def denied(effect: str | None) -> Iterator[None]:
    """The library without an effect."""
    order = list(EFFECTS)
    taken = EFFECTS.pop(effect, None) if effect else None
    try:
        yield
    finally:
        if taken is not None:
            EFFECTS[taken.id] = taken
            for name in order:
                EFFECTS[name] = EFFECTS.pop(name)


def plain(robot: RobotModel, train: list[Recording], judged: list[Recording]) -> Kept:
    """What the plainest library leaves: the URDF's links, and offset, viscous and dry friction of each joint by least squares."""
    motions = [m for r in (*train, *judged) for m in motions_of(robot, r)]
    names = {r.name for r in train}
    rest = plain_rest(robot, motions, [m.recording in names for m in motions])
    return {"names": robot.joint_names, "motions": motions, "rest": rest, "only": None}


def plain_rest(robot: RobotModel, motions: list[Motion], fitted: list[bool]) -> list[FloatArray]:
    """What is left of motions, shape (N, n) each [N m], by a fit to some of them, to the rows in which each joint moves: where it
    stands the torque of dry friction may be anything up to its level, and is no function of the motion."""
    cutoff, X = cutoff_of(motions), [_friction(m) for m in motions]
    inputs = [RestInputs.of(m, cutoff) for m in motions]
    rest = [np.empty_like(m.tau) for m in motions]
    for j in range(robot.n):
        parts = [(m, x[j], i) for m, x, i, fit in zip(motions, X, inputs, fitted, strict=True) if fit]
        moving = [np.arange(0, len(m.t), i.every)[i.moving[:, j]] for m, _, i in parts]
        rows = np.concatenate([x[k] for (_, x, _), k in zip(parts, moving, strict=True)])
        target = np.concatenate([(m.tau - m.link_torque)[k, j] for (m, _, _), k in zip(parts, moving, strict=True)])
        theta = np.linalg.lstsq(rows, target, rcond=None)[0]
        for m, x, out in zip(motions, X, rest, strict=True):
            out[:, j] = m.tau[:, j] - m.link_torque[:, j] - x[j] @ theta
    return rest


def _friction(m: Motion) -> list[FloatArray]:
    return [
        np.column_stack([np.ones(len(m.t)), m.v[:, j], as_measured(smoothed_sign(m.v[:, j]), m.period)])
        for j in range(m.q.shape[1])
    ]


def diagnosed(seed: int, effect: str | None, fast: bool) -> Kept | None:
    """What the diagnosis of a robot leaves, and the noise of its sensors on the same grids; None where it can't be drawn."""
    modules = ("sysid_ros.diagnosis.diagnose", "sysid_ros.diagnosis.reporting", "exam.case")
    diagnose, reporting, drawn = (cast("Any", importlib.import_module(x)) for x in modules)
    exact: list[FloatArray] = []
    publish, asked = drawn.publish, reporting.ceiling
    seen: Kept = {}

    def spied(name: str, true: Any, signals: Any, noise: Any, rng: Any) -> Any:
        silent = type(noise)(
            0.0 * noise.torque, 0.0 * noise.coloured, noise.memory, noise.position, noise.resolution, noise.velocity
        )
        exact.append(publish(name, true, signals, silent, np.random.default_rng(0)).tau)
        return publish(name, true, signals, noise, rng)

    def kept(names: Any, motions: Any, rest: Any, only: Any = None) -> Any:
        seen.update(names=names, motions=motions, rest=rest, only=only)
        return asked(names, motions, rest, only)

    drawn.publish, reporting.ceiling = spied, kept
    try:
        level = "healthy" if effect is None else "outside" if effect.startswith("outside") else "single"
        case = drawn.draw_case(seed, level, effect)
        robot = case.nominal.model()
        train, judged = ([recording_of(r) for r in x] for x in (case.train, case.validate))
        if fast:
            seen.update(plain(robot, train, judged))
        else:
            with denied(effect):
                diagnose.diagnose(robot, train, judged)
    finally:
        drawn.publish, reporting.ceiling = publish, asked
    if not seen:
        return None
    both = zip([*train, *judged], exact[-2:], strict=True)
    silent = [Recording(r.name, r.t, r.q, r.v, r.tau - e) for r, e in both]
    seen["noise"] = [m.tau for r in silent for m in motions_of(robot, r)]
    hidden = [j for e in case.truth["effects"] for j in e["joints"]] if effect else []
    seen.update(seed=seed, effect=effect, arm=case.arm, hidden=hidden, urdf=robot.urdf)
    seen["motions"] = [(m.t, m.q, m.v, m.a, m.tau, m.link_torque, m.clear) for m in seen["motions"]]
    return seen


def judged(kept: Kept) -> dict[str, Any]:
    """The ceiling of what was kept, beside the truth."""
    robot = RobotModel.from_urdf(kept["urdf"], kept["names"])
    motions = []
    for t, q, v, a, tau, load, clear in kept["motions"]:
        motions.append(Motion(robot, t, q, v, a, tau, load))
        motions[-1].clear = clear
    began = time.process_time()
    found = ceiling(kept["names"], motions, kept["rest"], kept["only"])
    seconds = time.process_time() - began
    each = [_rms(motions, x) for x in (kept["rest"], kept["noise"], [m.tau for m in motions])]
    left, noise, torque = (x for x, _ in each)
    left_of_all, noise_of_all, torque_of_all = (x for _, x in each)
    seen = np.array([j.left is not None for j in found.joints])
    missing = np.where(seen, left - noise, 0.0)
    true = int(np.argmax(np.where(seen, missing / torque, -np.inf)))
    share = np.array([j.missing or 0.0 for j in found.joints])
    there = found.joints[true]
    told = int(np.argmax(share)) if share.any() else -1
    names = list(kept["names"])
    return {
        "seed": kept["seed"],
        "effect": kept["effect"],
        "arm": kept["arm"],
        "hidden": kept["hidden"],
        "told": names[told] if told >= 0 else None,
        "truly": names[true],
        "missing": bool(missing[true] > _MISSING * noise[true]),
        "true_points": 100.0 * float(missing[true] / torque[true]),
        "points": 100.0 * float(share[told]) if told >= 0 else 0.0,
        "points_there": 100.0 * float(there.missing or 0.0),
        "between": [100.0 * x for x in there.missing_interval or (0.0, 0.0)],
        "predicted_there": 100.0 * float(there.gain or 0.0),
        "points_of_all": 100.0 * found.missing,
        "true_points_of_all": 100.0 * (left_of_all - noise_of_all) / torque_of_all,
        "worst_joint_points": 100.0 * float(share.max()),
        "seconds": seconds,
        "sentence": found.sentence,
    }


def _rms(motions: list[Motion], values: list[FloatArray]) -> tuple[FloatArray, float]:
    """While each joint moves, below the ceiling's cut-off, shape (n,); and of all joints together."""
    inputs = [RestInputs.of(m, cutoff_of(motions)) for m in motions]
    rows = np.concatenate([i.seen(x) for x, i in zip(values, inputs, strict=True)])
    moving = np.concatenate([i.moving for i in inputs])
    power = np.where(moving, rows, 0.0) ** 2
    own = np.sqrt(np.sum(power, axis=0) / np.maximum(moving.sum(axis=0), 1))
    return np.asarray(own), float(np.sqrt(np.mean(np.sum(power, axis=1))))


def sit(seed: int, effect: str | None, keep: Path | None, fast: bool) -> dict[str, Any]:
    """One robot, from the folder where it was kept."""
    file = keep / f"{effect or 'healthy'}_{seed}.pkl" if keep else None
    if file is not None and file.exists():
        kept = pickle.loads(file.read_bytes())
    else:
        try:
            kept = diagnosed(seed, effect, fast)
        except Exception as error:  # noqa: BLE001 - a robot that breaks is a row that says so
            return {"seed": seed, "effect": effect, "error": f"{type(error).__name__}: {error}"}
        if file is not None:
            file.write_bytes(pickle.dumps(kept))
    if kept is None:
        return {"seed": seed, "effect": effect, "error": "refused"}
    return judged(kept)


@click.command()
@click.option("--hidden", default=60, show_default=True)
@click.option("--healthy", default=60, show_default=True)
@click.option("--seed-base", default=20000, show_default=True)
@click.option("--model", type=click.Choice(("plain", "diagnosis")), default="plain", show_default=True, help="That leaves it.")
@click.option("--keep", type=click.Path(path_type=Path, file_okay=False))
@click.option("--jobs", default=1, show_default=True)
@click.option("--json", "json_path", type=click.Path(path_type=Path))
def main(hidden: int, healthy: int, seed_base: int, model: str, keep: Path | None, jobs: int, json_path: Path | None) -> None:
    """Draw, diagnose without the effect, ask the ceiling."""
    fast = model == "plain"
    if keep:
        keep.mkdir(parents=True, exist_ok=True)
    work: list[tuple[int, str | None]] = [(seed_base + k, FOLLOWING[k % len(FOLLOWING)]) for k in range(hidden)]
    work += [(seed_base + 1000 + k, None) for k in range(healthy)]
    rows = []
    with ProcessPoolExecutor(jobs) as pool:
        for row in pool.map(sit, *zip(*work, strict=True), [keep] * len(work), [fast] * len(work)):
            rows.append(row)
            told = row.get("error") or f"told {row['told']}, truly {row['truly']} {row['points']:.2f} of {row['true_points']:.2f}"
            print(f"{len(rows)}/{len(work)} {row['seed']} {row['effect'] or 'healthy'}: {told}", file=sys.stderr, flush=True)
    raise SystemExit(conclude("ceiling", _scored(rows), {"rows": rows, "seed_base": seed_base, "model": model}, json_path))


def _scored(rows: list[dict[str, Any]]) -> list[Target]:
    good = [r for r in rows if "error" not in r]
    sick, well = [r for r in good if r["effect"]], [r for r in good if not r["effect"]]
    missing = [r for r in sick if r["missing"]]
    table = Table(title="Robots that hide an effect which the library lacks", title_justify="left")
    for column in ("effect", "robots", "missing", "joint right", "size within 30 %", "true points, median", "size there, median"):
        table.add_column(column)
    for effect in FOLLOWING:
        own = [r for r in missing if r["effect"] == effect]
        right = [r for r in own if r["told"] == r["truly"]]
        sized = [r for r in own if abs(r["points_there"] - r["true_points"]) <= 0.3 * r["true_points"]]
        medians = [f"{np.median([r[k] for r in own]):.2f}" if own else "" for k in ("true_points", "points_there")]
        count = sum(r["effect"] == effect for r in sick)
        table.add_row(effect, str(count), str(len(own)), str(len(right)), str(len(sized)), *medians)
    Console(width=130).print(table)
    apart = len(sick) - len(missing)
    Console().print(
        f"{apart} more robots: the rest of the library explains the effect, nothing is missing. {len(rows) - len(good)} failed."
    )
    part = 100.0 / max(len(missing), 1)
    quiet = 100.0 / max(len(well), 1)
    sized = [r for r in missing if r["points_there"] > 0.0]
    inside = 100.0 / max(len(sized), 1) * sum(r["between"][0] <= r["true_points"] <= r["between"][1] for r in sized)
    ratio = [r["points_there"] / r["true_points"] for r in missing]
    return [
        Target(
            "the joint is named [% of robots on which something is missing]",
            part * sum(r["told"] == r["truly"] for r in missing),
            90,
        ),
        Target("its size within 30 % [% of them]", part * sum(abs(x - 1.0) <= 0.3 for x in ratio), 90),
        Target("of those with a size, true size in its 95 % interval [%]", inside, 90),
        Target("size claimed over true, median", float(np.median(ratio)) if ratio else float("nan"), 0.7, 1.3),
        Target("healthy: less than 0.5 points of all torque [%]", quiet * sum(r["points_of_all"] < 0.5 for r in well), 95),
        Target(
            "healthy: less than 0.5 points of all torque more than what the model truly lacks [%]",
            quiet * sum(r["points_of_all"] - max(r["true_points_of_all"], 0.0) < 0.5 for r in well),
            95,
        ),
        Target("healthy: nothing claimed on any joint [%]", quiet * sum(r["worst_joint_points"] == 0.0 for r in well), 95),
        Target("time of the ceiling, worst [s]", max(r["seconds"] for r in good), high=3.0),
    ]


if __name__ == "__main__":
    main()
