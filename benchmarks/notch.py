"""Multisine, frequency response and notch on a two-mass joint: is the resonance found, and what does the notch buy?

    python benchmarks/notch.py [--seeds 20] [--json FILE]

The joint follows a multisine of odd harmonics (Schroeder phases) in closed loop with noise of torque and encoder; the response
from torque to the link's velocity is the ratio of the means of all periods, its peak gives the resonance. A PD loop on the
link's encoder, which swings there, is then simulated at 1 kHz with a delay of 1 ms, with the notch that was designed and
without; its response from reference to link is measured with another multisine.
"""

from __future__ import annotations

import sys
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy import linalg, signal

# in place of this folder, in which another benchmark has the name of a peer
sys.path[0] = str(Path(__file__).resolve().parents[1] / "test")
sys.path.append(str(Path(__file__).resolve().parent))

from two_mass import FINE, TwoMass, published  # noqa: E402
from verdict import Target, conclude  # noqa: E402

from sysid_ros.control.notch import Notch, benefit, notch_for, resonance_of  # noqa: E402
from sysid_ros.excitation.multisine import Multisine, crest_factor, schroeder  # noqa: E402
from sysid_ros.sample import FloatArray  # noqa: E402

PERIOD, PERIODS, RATE = 8.0, 5, 500.0
STEP = 1e-3
KP, KD = 30.0, 5.0


def reference(top: float, size: float) -> Multisine:
    harmonics = np.arange(1, int(top * PERIOD) + 1, 2).astype(float)
    amplitude = size / (1.0 + (harmonics / PERIOD / 2.0) ** 1.5)
    return Multisine(np.zeros(1), amplitude[:, None], schroeder(amplitude**2)[:, None], harmonics, PERIOD, PERIODS, PERIOD)


def lines(x: FloatArray, rate: float, motion: Multisine) -> np.ndarray:
    """Mean of all whole periods at the motion's harmonics, shape (H,)."""
    count = round(PERIOD * rate)
    start = round(motion.ramp * rate)
    cut = x[start : start + PERIODS * count].reshape(PERIODS, count).mean(axis=0)
    return np.asarray(np.fft.rfft(cut)[motion.harmonics.astype(int)] / count)


def response(joint: TwoMass, seed: int) -> tuple[FloatArray, np.ndarray]:
    """From torque to the link's velocity."""
    motion = reference(30.0, 0.02)
    r = motion.sample(FINE * np.arange(round(motion.duration / FINE), dtype=np.float64))[0][:, 0]
    found = published(joint, r, seed, RATE, torque_noise=0.3, disturbance=0.2, on_link=True)
    q, tau = (lines(x, RATE, motion) for x in (found.q[:, 0], found.tau[:, 0]))
    return motion.frequencies, 2j * np.pi * motion.frequencies * q / tau


def closed_peak(joint: TwoMass, notch: Notch | None, around: float) -> float:
    """Largest response from reference to link of the simulated loop within 30 % of a frequency."""
    A, B = joint.plant()
    discrete = linalg.expm(np.block([[A, B[:, :1]], [np.zeros((1, 5))]]) * STEP)
    Ad, Bd = discrete[:4, :4], discrete[:4, 4]
    motion = reference(30.0, 0.01)
    r = motion.sample(STEP * np.arange(round(motion.duration / STEP), dtype=np.float64))[0][:, 0]
    b, a = notch.discrete(STEP) if notch else (np.array([1.0]), np.array([1.0]))
    x, late, memory, before, out = np.zeros(4), 0.0, np.zeros(len(b) - 1), 0.0, np.empty(len(r))
    for k in range(len(r)):
        out[k] = x[1]
        error = r[k] - x[1]
        u = KP * error + KD * (error - before) / STEP
        before = error
        filtered, memory = signal.lfilter(b, a, [u], zi=memory) if notch else (np.array([u]), memory)
        x = Ad @ x + Bd * late
        late = float(filtered[0])
    near = np.abs(motion.frequencies / around - 1.0) < 0.3
    return float(np.max(np.abs(lines(out, 1.0 / STEP, motion) / lines(r, 1.0 / STEP, motion))[near]))


@click.command()
@click.option("--seeds", default=20, show_default=True)
@click.option("--seed-base", default=300, show_default=True)
@click.option("--json", "json_path", type=click.Path(path_type=Path))
def main(seeds: int, seed_base: int, json_path: Path | None) -> None:
    """Resonance and notch over joints drawn from seeds."""
    rows = []
    for seed in range(seed_base, seed_base + seeds):
        rng = np.random.default_rng(seed)
        joint = TwoMass(
            link=float(rng.uniform(0.8, 1.5)),
            motor=float(rng.uniform(0.3, 0.7)),
            stiffness=float(rng.uniform(2500.0, 6000.0)),
            spring_damping=float(rng.uniform(1.0, 3.0)),
            damping=float(rng.uniform(0.5, 2.0)),
        )
        true = max(joint.poles, key=lambda p: p.imag)
        f, H = response(joint, seed)
        found = resonance_of(f, H, 5.0, 28.0)
        notch = notch_for(found)
        told = benefit(f, H, notch, (KP, KD), 1.5 * STEP)
        peaks = [closed_peak(joint, x, found.frequency) for x in (None, notch)]
        rows.append(
            {
                "true_hz": abs(true) / (2 * np.pi),
                "found_hz": found.frequency,
                "damping": -true.real / abs(true),
                "found_damping": found.damping,
                "told_db": told.decibel,
                "db": 20.0 * np.log10(peaks[0] / peaks[1]),
                "phase_lost": told.phase_lost,
            }
        )
    off = [100.0 * abs(r["found_hz"] / r["true_hz"] - 1.0) for r in rows]
    table = Table(title="Resonances and notches", title_justify="left")
    for column in ("true Hz", "found Hz", "damping", "found", "peak falls, told dB", "simulated dB", "phase lost, deg"):
        table.add_column(column)
    for r in rows:
        table.add_row(*(f"{x:.3g}" for x in r.values()))
    Console(width=130).print(table)
    x = reference(30.0, 0.02)
    inside = x.sample(x.ramp + np.arange(0.0, PERIOD, 1e-3))[0][:, 0]
    targets = [
        Target("resonance, largest error [%]", max(off), high=1.0),
        Target("peak of the simulated closed loop falls, least [dB]", min(r["db"] for r in rows), low=10.0),
        Target("what is told less what is simulated, largest [dB]", max(abs(r["db"] - r["told_db"]) for r in rows), high=3.0),
        Target("crest factor of the multisine", crest_factor(inside), high=3.0),
    ]
    raise SystemExit(conclude("notch", targets, {"joints": rows}, json_path))


if __name__ == "__main__":
    main()
