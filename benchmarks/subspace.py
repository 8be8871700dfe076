"""Subspace identification beside peers: linear benchmark systems of the literature, open and closed loop, over seeds.

    python benchmarks/subspace.py [--seeds 50] [--sippy-python PYTHON] [--json FILE]

Every method gets the same series, its true order, and gives back poles; what is compared is their relative error (median over
seeds and pairs of poles; a pair that is missed has an error of 1), and, of ours, how often the bootstrap interval of frequency
and of damping holds the truth. Peers: nfoursid (N4SID), control (Markov parameters by least squares, then ERA), and sippy
(package sippy-unipi: N4SID, MOESP, CVA, PARSIM-K), which is called in an interpreter of its own where one is given. Those that
are not installed are left out and said so. slycot wraps no identification routine of SLICOT (ib01ad, ib01bd), so there is none
of its own here.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

# in place of this folder, in which another benchmark has the name of a peer
sys.path[0] = str(Path(__file__).resolve().parent)

from linear_systems import System, systems  # noqa: E402
from verdict import Target, conclude  # noqa: E402

from sysid_ros.blackbox import Series, Subspace, mode_estimates  # noqa: E402
from sysid_ros.blackbox.moments import WEIGHTS  # noqa: E402
from sysid_ros.blackbox.state_space import continuous  # noqa: E402

_SIPPY = ("N4SID", "MOESP", "CVA", "PARSIM-K")
_ROWS = 25
_IN_SIPPY = """
import json, sys, warnings
import numpy as np
warnings.simplefilter("ignore")
from sippy_unipi import system_identification
data, out = np.load(sys.argv[1]), {}
for key in data.files:
    if key.endswith("_u"):
        name = key[:-2]
        for method in sys.argv[2].split(","):
            try:
                m = system_identification(data[name + "_y"].T, data[key].T, method, SS_fixed_order=int(data[name + "_n"]),
                                          SS_f=25, SS_p=25)
                values = np.linalg.eigvals(m.A)
                out[f"{name}|{method}"] = [values.real.tolist(), values.imag.tolist()]
            except Exception as error:
                out[f"{name}|{method}"] = str(error)
json.dump(out, open(sys.argv[3], "w"))
"""


def nfoursid(s: Series, order: int) -> np.ndarray:
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    frame = pd.DataFrame({"u": s.u[:, 0], "y": s.y[:, 0]})
    found = NFourSID(frame, output_columns=["y"], input_columns=["u"], num_block_rows=_ROWS)
    found.subspace_identification()
    model, _ = found.system_identification(rank=order)
    return np.linalg.eigvals(model.a)


def era(s: Series, order: int) -> np.ndarray:
    import control

    response = control.markov(s.y[:, 0], s.u[:, 0], 4 * _ROWS, dt=s.period, truncate=True)
    model, _ = control.eigensys_realization(np.ravel(response) * s.period, r=order, dt=s.period)
    return np.linalg.eigvals(model.A)


def weighted(weights: str) -> Callable[[Series, int], np.ndarray]:
    return lambda s, order: np.linalg.eigvals(Subspace(order, weights=weights, feedthrough=False).fit([s]).as_state_space().A)


def errors(values: np.ndarray, system: System) -> list[float]:
    """Relative error of each true pair; 1 where there is none near."""
    found = continuous(values, system.period)
    found = found[found.imag > 1e-9]
    return [min([1.0, *(abs(x - p) / abs(p) for x in found)]) for p in system.poles]


def covered(s: Series, system: System) -> list[bool]:
    """Whether the interval of each true frequency and damping holds it; a mode that is missed does not."""
    modes = mode_estimates(Subspace(len(system.A), feedthrough=False).fit([s]))
    out = []
    for p in system.poles:
        f, damping = abs(p) / (2.0 * np.pi), -p.real / abs(p)
        best = min(modes, key=lambda m: abs(m.frequency - f), default=None)
        for interval, true in ((best.frequency_ci95, f), (best.damping_ci95, damping)) if best else ((None, f), (None, damping)):
            out.append(interval is not None and interval[0] <= true <= interval[1])
    return out


def of_sippy(python: str | None, recorded: dict[str, tuple[System, Series]]) -> dict[str, Any]:
    """Eigenvalues of sippy's models, by "case|method"; empty where its interpreter is missing."""
    if not python or not Path(python).exists():
        return {}
    with tempfile.TemporaryDirectory() as folder:
        data, out = Path(folder) / "data.npz", Path(folder) / "out.json"
        arrays: dict[str, Any] = {}
        for name, (system, s) in recorded.items():
            arrays |= {f"{name}_u": s.u, f"{name}_y": s.y, f"{name}_n": len(system.A)}
        np.savez(data, **arrays)
        done = subprocess.run([python, "-c", _IN_SIPPY, str(data), ",".join(_SIPPY), str(out)], capture_output=True, text=True)
        return dict(json.loads(out.read_text())) if done.returncode == 0 else {}


@click.command()
@click.option("--seeds", default=50, show_default=True)
@click.option("--seed-base", default=1000, show_default=True)
@click.option("--sippy-python", help="Interpreter of an environment with sippy-unipi.")
@click.option("--json", "json_path", type=click.Path(path_type=Path))
def main(seeds: int, seed_base: int, sippy_python: str | None, json_path: Path | None) -> None:
    """Errors of poles of all methods, and coverage of our intervals."""
    warnings.simplefilter("ignore")
    methods: dict[str, Callable[[Series, int], np.ndarray]] = {w: weighted(w) for w in WEIGHTS}
    methods |= {"nfoursid": nfoursid, "control ERA": era}
    cases: dict[str, Any] = {}
    missing: set[str] = set()
    coverage: list[bool] = []
    for system in systems():
        for closed in (False, True):
            case = f"{system.name}, {'closed' if closed else 'open'}"
            recorded = {f"s{k}": (system, system.record(np.random.default_rng(seed_base + k), closed)) for k in range(seeds)}
            found: dict[str, list[float]] = {}
            times: dict[str, float] = {}
            for name, method in methods.items():
                began = time.perf_counter()
                try:
                    found[name] = [e for _, s in recorded.values() for e in errors(method(s, len(system.A)), system)]
                except ImportError:
                    missing.add(name)
                times[name] = (time.perf_counter() - began) / seeds
            for key, values in of_sippy(sippy_python, recorded).items():
                name = f"sippy {key.split('|')[1]}"
                bad = isinstance(values, str)
                own = [1.0] * len(system.poles) if bad else errors(np.array(values[0]) + 1j * np.array(values[1]), system)
                found.setdefault(name, []).extend(own)
            held = [x for _, s in recorded.values() for x in covered(s, system)]
            coverage += held
            medians = {name: float(np.median(values)) for name, values in found.items()}
            cases[case] = {"median_error": medians, "coverage": float(np.mean(held)), "seconds": times}
    _show(cases, missing if sippy_python else missing | {"sippy"})
    worst = [
        (c["median_error"]["pbsid"] / min(v for k, v in c["median_error"].items() if k not in WEIGHTS)) for c in cases.values()
    ]
    targets = [
        Target("poles within their interval, all systems [%]", 100.0 * float(np.mean(coverage)), 90.0, 98.0),
        Target("the same, worst system [%]", 100.0 * min(c["coverage"] for c in cases.values()), 90.0, 98.0),
        Target("median error over that of the best peer, worst case (pbsid)", float(max(worst)), high=1.0),
    ]
    raise SystemExit(conclude("subspace", targets, {"seeds": seeds, "seed_base": seed_base, "cases": cases}, json_path))


def _show(cases: dict[str, Any], missing: set[str]) -> None:
    names = list(dict.fromkeys(n for c in cases.values() for n in c["median_error"]))
    table = Table(title="Relative error of poles, median over seeds and pairs [%]", title_justify="left")
    for column in ("method", *cases):
        table.add_column(column)
    for name in names:
        table.add_row(name, *(f"{100 * c['median_error'].get(name, np.nan):.2f}" for c in cases.values()))
    table.add_row("interval holds [%] (pbsid)", *(f"{100 * c['coverage']:.0f}" for c in cases.values()))
    console = Console(width=150)
    console.print(table)
    if missing:
        console.print(f"Not installed, left out: {', '.join(sorted(missing))}.")


if __name__ == "__main__":
    main()
