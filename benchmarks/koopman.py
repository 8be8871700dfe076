"""Koopman models beside pykoopman: the forced Van der Pol oscillator and an arm with a flexible joint.

    python benchmarks/koopman.py [--seeds 10] [--pykoopman-python PYTHON] [--json FILE]

Both get the same trajectories and are judged on others: root mean square error of predictions over 1 s, outputs over their
spread. pykoopman (EDMDc with polynomials of degree 3 and with 100 thin plates, the better one counts) needs an old numpy and
scikit-learn, so it runs in an interpreter of its own; where none is given it is left out and said so. Then the horizon: what is
stated from half of the test trajectories is held against the other half.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

# in place of this folder, in which another benchmark has the name of a peer
sys.path[0] = str(Path(__file__).resolve().parent)

from verdict import Target, conclude  # noqa: E402

from sysid_ros.blackbox import Series  # noqa: E402
from sysid_ros.blackbox.dictionary import Dictionary, linear, polynomial, robot, thin_plates  # noqa: E402
from sysid_ros.blackbox.koopman import Koopman, horizon  # noqa: E402
from sysid_ros.sample import FloatArray  # noqa: E402

PERIOD, ROWS, RUNS, TESTS = 0.02, 300, 16, 60
_STEPS, _LONG = 50, 220
"""Of predictions that are compared, and of those that the horizon is looked for in."""
_BAND = 0.05
"""Of the spread of each output: the band of the horizon."""
Rate = Callable[[FloatArray, float], FloatArray]
_PEER = """
import json, sys, warnings
import numpy as np
warnings.simplefilter("ignore")
import pykoopman as pk
data, out, steps = np.load(sys.argv[1]), {}, int(sys.argv[3])
for name in sorted({k.rsplit("|", 1)[0] for k in data.files}):
    X, Y, U = (data[f"{name}|{k}"] for k in ("now", "then", "input"))
    starts, inputs, truth, spread = (data[f"{name}|{k}"] for k in ("starts", "inputs", "truth", "spread"))
    kinds = {"polynomials": pk.observables.Polynomial(degree=3),
             "thin plates": pk.observables.RadialBasisFunction(rbf_type="thinplate", n_centers=100,
                            centers=X[:: max(1, len(X) // 100)][:100].T)}
    for kind, observables in kinds.items():
        try:
            model = pk.Koopman(observables=observables, regressor=pk.regression.EDMDc(), quiet=True)
            model.fit(X, Y, u=U)
            total = 0.0
            for x0, u, y in zip(starts, inputs, truth):
                made = np.real(model.simulate(x0[:, None].T if x0.ndim > 1 else x0, u, n_steps=steps))
                total += np.mean(np.minimum(((made - y) / spread) ** 2, 1e6))
            out[f"{name}|{kind}"] = float(np.sqrt(total / len(starts)))
        except Exception as error:
            out[f"{name}|{kind}"] = f"{type(error).__name__}: {error}"
json.dump(out, open(sys.argv[2], "w"))
"""


def van_der_pol(x: FloatArray, u: float) -> FloatArray:
    """Of Korda, Mezic 2018."""
    return np.array([2.0 * x[1], -0.8 * x[0] + 2.0 * x[1] - 10.0 * x[0] ** 2 * x[1] + u])


def flexible_arm(x: FloatArray, u: float) -> FloatArray:
    """A link on a flexible joint (Spong 1987): angles of link and motor, their speeds."""
    twist = 60.0 * (x[0] - x[1])
    return np.array([x[2], x[3], -9.81 * np.sin(x[0]) - twist - 0.3 * x[2], 5.0 * (twist * 0.2 + u - 0.2 * x[3])])


def trajectory(rate: Rate, size: FloatArray, force: float, rng: np.random.Generator) -> Series:
    """From a random state, with an input that changes every 0.1 s."""
    x, u, Y, U = size * rng.uniform(-1.0, 1.0, len(size)), 0.0, [], []
    for k in range(ROWS):
        if k % 5 == 0:
            u = force * float(rng.uniform(-1.0, 1.0))
        Y.append(x)
        U.append([u])
        for _ in range(4):
            h = PERIOD / 4.0
            a = rate(x, u)
            b = rate(x + 0.5 * h * a, u)
            c = rate(x + 0.5 * h * b, u)
            x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(x + h * c, u))
    return Series(np.array(U), np.array(Y), PERIOD)


SYSTEMS: dict[str, tuple[Rate, FloatArray, float, Callable[[FloatArray], list[Dictionary]]]] = {
    "Van der Pol": (van_der_pol, np.ones(2), 1.0, lambda c: [linear(), polynomial(3), polynomial(5), thin_plates(c)]),
    "flexible joint": (
        flexible_arm,
        np.array([1.5, 1.5, 2.0, 2.0]),
        6.0,
        lambda c: [linear(), robot(2), polynomial(3), thin_plates(c)],
    ),
}


def starts_of(s: Series, steps: int) -> np.ndarray:
    return np.arange(1, len(s) - steps, 60)


def rms(model: Koopman, tests: list[Series], spread: FloatArray, steps: int = _STEPS) -> tuple[float, FloatArray]:
    parts = [np.subtract(*model.predictions(s, starts_of(s, steps), steps)) for s in tests]
    errors = np.concatenate(parts)
    return float(np.sqrt(np.mean(np.minimum((errors / spread) ** 2, 1e6)))), errors


def of_peer(python: str | None, data: dict[str, Any]) -> dict[str, Any]:
    """pykoopman's errors by "case|kind"; empty where its interpreter is missing."""
    if not python or not Path(python).exists():
        return {}
    with tempfile.TemporaryDirectory() as folder:
        source, out = Path(folder) / "data.npz", Path(folder) / "out.json"
        np.savez(source, **data)
        done = subprocess.run([python, "-c", _PEER, str(source), str(out), str(_STEPS)], capture_output=True, text=True)
        if done.returncode:
            Console().print(f"pykoopman does not run: {done.stderr.strip().splitlines()[-1]}")
            return {}
        return dict(json.loads(out.read_text()))


@click.command()
@click.option("--seeds", default=10, show_default=True)
@click.option("--seed-base", default=500, show_default=True)
@click.option("--pykoopman-python", help="Interpreter of an environment with pykoopman.")
@click.option("--json", "json_path", type=click.Path(path_type=Path))
def main(seeds: int, seed_base: int, pykoopman_python: str | None, json_path: Path | None) -> None:
    """Errors of all dictionaries and of the peer; how true the stated horizons are."""
    results: dict[str, dict[str, list[float]]] = {}
    stated: dict[str, list[float]] = {name: [] for name in SYSTEMS}
    kept: dict[str, list[float]] = {name: [] for name in SYSTEMS}
    data: dict[str, Any] = {}
    for name, (rate, size, force, kinds) in SYSTEMS.items():
        for seed in range(seed_base, seed_base + seeds):
            rng = np.random.default_rng(seed)
            fitted = [trajectory(rate, size, force, rng) for _ in range(RUNS)]
            tests = [trajectory(rate, size, force, rng) for _ in range(TESTS)]
            every = np.concatenate([s.y for s in fitted])
            spread = np.std(every, axis=0)
            models = [Koopman(d).fit(fitted) for d in kinds(every[:: max(1, len(every) // 100)][:100])]
            for model in models:
                results.setdefault(name, {}).setdefault(model.dictionary.name, []).append(rms(model, tests, spread)[0])
            # chosen by what it left out of the fitted runs, never by the test runs
            best = min(models, key=lambda m: m.heldout)
            results[name].setdefault("ours, chosen by left-out runs", []).append(rms(best, tests, spread)[0])
            half, band = TESTS // 2, _BAND * spread
            told = horizon(rms(best, tests[:half], spread, _LONG)[1], band, PERIOD)
            later = horizon(rms(best, tests[half:], spread, _LONG)[1], band, PERIOD)
            stated[name].append(told.seconds)
            kept[name].append(float(later.within[told.steps - 1]) if told.steps else 1.0)
            data |= _for_peer(f"{name}|{seed}", fitted, tests, spread)
    for key, value in of_peer(pykoopman_python, data).items():
        name, _, kind = key.split("|")
        results[name].setdefault(f"pykoopman, {kind}", []).append(value if isinstance(value, float) else float("inf"))
    targets = []
    for name, rows in results.items():
        peer = [float(np.median(v)) for k, v in rows.items() if k.startswith("pykoopman")]
        if peer:
            own = float(np.median(rows["ours, chosen by left-out runs"]))
            targets.append(Target(f"{name}: median error over pykoopman's best", own / min(peer), high=1.0))
        targets.append(
            Target(f"{name}: starts within the band over the stated horizon [%]", 100 * float(np.mean(kept[name])), 90)
        )
    _show(results, stated, bool(pykoopman_python))
    document = {"errors": results, "stated_horizon_s": stated, "kept": kept}
    raise SystemExit(conclude("koopman", targets, document, json_path))


def _for_peer(key: str, fitted: list[Series], tests: list[Series], spread: FloatArray) -> dict[str, Any]:
    at = [(s, int(k)) for s in tests for k in starts_of(s, _STEPS)]
    return {
        f"{key}|now": np.concatenate([s.y[:-1] for s in fitted]),
        f"{key}|then": np.concatenate([s.y[1:] for s in fitted]),
        f"{key}|input": np.concatenate([s.u[:-1] for s in fitted]),
        f"{key}|starts": np.array([s.y[k - 1] for s, k in at]),
        f"{key}|inputs": np.array([s.u[k - 1 : k - 1 + _STEPS] for s, k in at]),
        f"{key}|truth": np.array([s.y[k : k + _STEPS] for s, k in at]),
        f"{key}|spread": spread,
    }


def _show(results: dict[str, dict[str, list[float]]], stated: dict[str, list[float]], peer: bool) -> None:
    console = Console(width=130)
    for name, rows in results.items():
        table = Table(title=f"{name}: error of predictions over 1 s, of the outputs' spread [%]", title_justify="left")
        for column in ("model", "median", "worst seed"):
            table.add_column(column)
        for kind, values in rows.items():
            table.add_row(kind, f"{100 * np.median(values):.2f}", f"{100 * np.max(values):.2f}")
        console.print(table)
        median = float(np.median(stated[name]))
        console.print(f"Stated horizon, {100 * _BAND:.0f} % of the spread: median {median:.2f} s, {_LONG * PERIOD:.1f} s tried.")
    if not peer:
        console.print("pykoopman is not installed here; give --pykoopman-python.")


if __name__ == "__main__":
    main()
