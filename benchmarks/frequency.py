"""State-space checks of an elastic joint: this package beside peers from PyPI, open and closed loop, with noise.

Every method gets torque and velocity of the motor of the same two-mass joint and gives back a model; what is compared is the
unmodelled pair of poles (motor and link against each other) and of zeros (the link with the motor held), against the equations.

    python benchmarks/frequency.py [--seeds 10] [--json FILE]

Peers: nfoursid (N4SID), control (Markov parameters by least squares, then the eigensystem realization), scipy.signal (H1 by
Welch, the peak and the dip of the response). Those that are not installed are left out and said so.
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy import signal

# in place of this folder, in which another benchmark has the name of a peer
sys.path[0] = str(Path(__file__).resolve().parents[1] / "test")

from two_mass import FINE, TwoMass, model_of, published, sweep  # noqa: E402

from sysid_ros.blackbox.moments import Moments  # noqa: E402
from sysid_ros.frequency_domain import check_frequency  # noqa: E402
from sysid_ros.identification import Recording  # noqa: E402

JOINT = TwoMass(stiffness=4000.0, spring_damping=4.0, damping=0.2)
EVERY = 5
ORDER = 4
Found = tuple[float | None, float | None]
CASES: dict[str, dict[str, Any]] = {
    "clean": {"torque_noise": 0.05},
    "torque noise 1 N m": {"torque_noise": 1.0},
    "noise and disturbance": {"torque_noise": 1.0, "disturbance": 0.5},
}


def channels(recording: Recording) -> tuple[np.ndarray, np.ndarray, float]:
    """Torque and velocity at 100 Hz, without means, and the period [s]."""
    tau, q = recording.tau[:, 0], recording.q[:, 0]
    period = float(recording.t[1] - recording.t[0])
    v = np.gradient(q, period)
    both = signal.decimate(np.stack([tau, v], axis=1), EVERY, ftype="fir", axis=0)
    both -= both.mean(axis=0)
    return both[:, 0], both[:, 1], period * EVERY


def nearest(poles: np.ndarray, true: float) -> float | None:
    """Frequency of the lightly damped pair nearest to the true one, within a quarter of it."""
    own = [abs(p) / (2 * np.pi) for p in poles if p.imag > 0.0 and abs(p.real) < 0.5 * abs(p)]
    best = min(own, key=lambda f: abs(f - true), default=None)
    return best if best is not None and abs(best - true) < 0.25 * true else None


def truth() -> tuple[float, float]:
    pole = next(p for p in JOINT.poles if p.imag > 0.0)
    return abs(pole) / (2.0 * np.pi), JOINT.locked[0]


def ours(recording: Recording) -> Found:
    robot, known = model_of(JOINT)
    modes = check_frequency(robot, [recording], known).joints[0].modes
    pick = {m.kind: m.frequency for m in modes.unmodelled} if modes else {}
    return pick.get("pole"), pick.get("zero")


def direct(recording: Recording) -> Found:
    """The same subspace method from torque to velocity, as the peers do it."""
    u, v, period = channels(recording)
    moments = Moments(25)
    model, _ = moments.model(moments.of(u, v), ORDER, period)
    return nearest(model.poles, truth()[0]), nearest(model.zeros, truth()[1])


def n4sid(recording: Recording) -> Found:
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    u, v, period = channels(recording)
    frame = pd.DataFrame({"u": u, "v": v})
    found = NFourSID(frame, output_columns=["v"], input_columns=["u"], num_block_rows=25)
    found.subspace_identification()
    model, _ = found.system_identification(rank=ORDER)
    poles = np.log(np.linalg.eigvals(model.a).astype(complex)) / period
    zeros = np.roots(signal.ss2tf(model.a, model.b, model.c, model.d)[0][0])
    return nearest(poles, truth()[0]), nearest(np.log(zeros.astype(complex)) / period, truth()[1])


def era(recording: Recording) -> Found:
    import control

    u, v, period = channels(recording)
    response = control.markov(v, u, 120, dt=period, truncate=True)
    model, _ = control.eigensys_realization(np.ravel(response) * period, r=ORDER, dt=period)
    poles = np.log(np.linalg.eigvals(model.A).astype(complex)) / period
    zeros = np.log(np.atleast_1d(model.zeros()).astype(complex)) / period
    return nearest(poles, truth()[0]), nearest(zeros, truth()[1])


def welch(recording: Recording) -> Found:
    u, v, period = channels(recording)
    segment = len(u) // 6
    f, across = signal.csd(u, v, 1.0 / period, nperseg=segment)
    _, power = signal.welch(u, 1.0 / period, nperseg=segment)
    size = np.abs(across / power)
    out = []
    for true, find in zip(truth(), (np.argmax, np.argmin), strict=True):
        near = (f > 0.75 * true) & (f < 1.25 * true)
        out.append(float(f[near][find(size[near])]))
    return out[0], out[1]


METHODS: dict[str, Callable[[Recording], Found]] = {
    "sysid frequency": ours,
    "PBSID-opt, torque to velocity": direct,
    "nfoursid (N4SID)": n4sid,
    "control (Markov + ERA)": era,
    "scipy.signal (Welch H1)": welch,
}


@click.command()
@click.option("--seeds", default=10, show_default=True)
@click.option("--json", "json_path", type=click.Path(path_type=Path))
def main(seeds: int, json_path: Path | None) -> None:
    """Error of the unmodelled poles and zeros over seeds."""
    warnings.simplefilter("ignore")
    reference = sweep(30.0, 0.3, 25.0, 0.06)
    pole, zero = truth()
    table = Table(title=f"Poles at {pole:.2f} Hz, zeros at {zero:.2f} Hz; {seeds} seeds, 30 s, closed loop, step {FINE:g} s")
    for heading in ("case", "method", "poles found", "rms error [%]", "zeros found", "rms error [%]", "time [s]"):
        table.add_column(heading)
    rows = []
    for case, settings in CASES.items():
        recordings = [published(JOINT, reference, seed, encoder_noise=5e-6, **settings) for seed in range(seeds)]
        for name, method in METHODS.items():
            began = time.perf_counter()
            try:
                found = [method(r) for r in recordings]
            except ModuleNotFoundError as error:
                table.add_row(case, name, f"not installed: {error.name}")
                continue
            seconds = (time.perf_counter() - began) / seeds
            row = {"case": case, "method": name, "seconds": seconds}
            for key, true, values in (("poles", pole, [f[0] for f in found]), ("zeros", zero, [f[1] for f in found])):
                errors = [100.0 * (v / true - 1.0) for v in values if v is not None]
                row[f"{key}_found"] = len(errors)
                row[f"{key}_rms_percent"] = float(np.sqrt(np.mean(np.square(errors)))) if errors else None
            rows.append(row)
            shown = [
                x
                for key in ("poles", "zeros")
                for x in (
                    f"{row[f'{key}_found']} of {seeds}",
                    "–" if row[f"{key}_rms_percent"] is None else f"{row[f'{key}_rms_percent']:.2f}",
                )
            ]
            table.add_row(case, name, *shown, f"{seconds:.2f}")
    Console(width=130).print(table)
    if json_path:
        json_path.write_text(json.dumps({"pole_hz": pole, "zero_hz": zero, "seeds": seeds, "rows": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
