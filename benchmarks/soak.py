"""Hours of every fault in turn, and ten million updates: does memory stay flat, and is the estimate right at the end?

The streams of ``bad_streams.py``, drawn at random, one after the other on one clock, go through the same code as the node's
callbacks (gate, estimation, commit gate), with faults inside the estimation among them. The arm is set down where each stream
ends and stands elsewhere when the next begins. At the end comes a sound stream. Then an estimator takes in rows that excite all
parameters, some, or none, with outliers and values that are not finite among them.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import gc
import sys
import time
from pathlib import Path

import click
import numpy as np
from bad_streams import END, ROWS, Arm, Message
from rich.progress import Progress
from verdict import Target, conclude

from sysid_ros.estimators import JumpRule, Problem, VariableForgetting
from sysid_ros.online.live_estimation import CommitGate, LiveEstimation
from sysid_ros.online_settings import CommitSettings, OnlineSettings
from sysid_ros.sample import JointStateRecord

ARMS = 4
WARM = 40
"""Streams after which all caches are filled."""
SETTLES = 0.5
"""Time after a change of the payload during which an estimate need not be right [s]."""


def resident() -> float:
    """Memory of this process [MB]."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class Soak:
    """The estimation of a live node, and streams that are sent to it.

    Attributes:
        ok, wrong: estimates given out as ok or no_payload, and those of them beyond three standard deviations.
        committed, wrong_commits: as many of those committed. raised: exceptions that came out; none may.
        memory: of the process after each stream [MB].
    """

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng([seed, 77])
        self._drops = Arm(seed, drops=True)
        self._more = [Arm(seed + k + 1) for k in range(ARMS)]
        arm = self._more[0]
        settings = OnlineSettings(joint_names=tuple(arm.names), link_mass_error=0.0, link_com_error=0.0, effort_gain_error=0.0)
        self.live = LiveEstimation(arm.urdf, settings, CommitGate(CommitSettings()))
        self._clock = 1e6
        self.ok = self.wrong = self.committed = self.wrong_commits = self.raised = 0
        self.memory: list[float] = []

    def stream(self, number: int | None) -> tuple[str, float]:
        """Send a stream of :data:`ROWS`, or a sound one; the last status, and the error of the mass over its own std."""
        row = ROWS[number] if number is not None else None
        arm = self._drops if row and row.drops else self._more[int(self._rng.integers(ARMS))]
        arm.rng = np.random.default_rng(int(self._rng.integers(1 << 31)))
        messages = arm.messages() if row is None else sorted(row.change(arm.messages(), arm), key=lambda m: m.at)
        wrong, report, breaks = np.nan, 0.0, bool(row and row.inside)
        for m in messages:
            if breaks and m.at >= 7.0 and self.live.estimation.estimator is not None:
                breaks = False
                self.live.estimation.estimator.shift(slice(0, 1), np.array([np.nan]))
            wrong = self._send(m, arm, wrong)
            if m.at >= report:
                report += 1.0
                self.live.health(self._clock + m.at)
        self._clock += END + 0.5
        self.memory.append(resident() if len(self.memory) % 20 == 0 else self.memory[-1])
        return self.live.status(0.0)[0], wrong

    def _send(self, m: Message, arm: Arm, wrong: float) -> float:
        stamp = 0.0 if -50.0 < m.stamp < 0.0 else self._clock + m.stamp
        record = JointStateRecord(stamp, self._clock + m.at, tuple(m.name), m.position, m.velocity, m.effort)
        try:
            estimate = self.live.take(record)
        except Exception:  # noqa: BLE001 - that none comes out is what is measured
            self.raised += 1
            return wrong
        if estimate is None:
            return wrong
        k = min(int(m.at * 250.0), len(arm.t) - 1)
        before = arm.carried[max(k - round(SETTLES * 250.0), 0) : k + 1]
        wrong = abs(estimate.mass - before[-1]) / estimate.mass_std if np.ptp(before) == 0.0 else 0.0
        if estimate.status in ("ok", "no_payload"):
            self.ok += 1
            self.wrong += wrong > 3.0
        if self.live.commit.offer(estimate) is not None:
            self.committed += 1
            self.wrong_commits += wrong > 3.0
        return float(wrong)


def updates(count: int, seed: int) -> tuple[float, float, float]:
    """So many updates: largest asymmetry of the covariance, its least eigenvalue and its largest, over those of the prior."""
    rng = np.random.default_rng([seed, 5])
    prior = np.array([2.0] + [0.3] * 3 + [0.1] * 6)
    least = np.array([0.03] + [5e-3] * 3 + [np.inf] * 6)
    estimator = VariableForgetting(Problem(prior, np.full(7, 0.03**2), 0.01, 60.0, JumpRule(slice(0, 10), least, 0.0)))
    pool = rng.normal(size=(4096, 7, 10)) * rng.choice([0.0, 0.01, 1.0], size=(4096, 1, 10))
    noise = 0.03 * rng.normal(size=(4096, 7))
    noise[rng.uniform(size=noise.shape) < 1e-3] = 1e6
    noise[rng.uniform(size=noise.shape) < 1e-4] = np.nan
    truth = prior * rng.normal(size=10)
    asymmetry, low, high = 0.0, np.inf, 0.0
    for k in range(count):
        i = k % 4096
        if k % 200_000 == 0:
            truth = prior * rng.normal(size=10)
        estimator.update(pool[i], pool[i] @ truth + noise[i], hold=(k // 1000) % 7 == 0)
        if k % 10_000 == 0:
            P = estimator.covariance()
            eigenvalues = np.linalg.eigvalsh(P / np.outer(prior, prior))
            asymmetry = max(asymmetry, float(np.abs(P - P.T).max()))
            low, high = min(low, float(eigenvalues[0])), max(high, float(eigenvalues[-1]))
    return asymmetry, low, high


@click.command(help=__doc__)
@click.option("--hours", default=8.0, show_default=True, help="Simulated time of the streams.")
@click.option("--updates", "count", default=10_000_000, show_default=True, help="Updates of one estimator.")
@click.option("--seed", default=0, show_default=True, help="Of all that is random.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write everything to this file.")
def main(hours: float, count: int, seed: int, json_path: Path | None) -> None:
    soak, rng = Soak(seed), np.random.default_rng([seed, 78])
    usual = [k for k, row in enumerate(ROWS) if not (row.rail or row.description or row.parameters)]
    began = time.monotonic()
    with Progress(transient=True, disable=not sys.stderr.isatty()) as bar:
        for _ in bar.track(range(max(round(hours * 3600.0 / END), WARM + 2))):
            soak.stream(int(rng.choice(usual)))
    for _ in range(3):
        status, wrong = soak.stream(None)
    seconds = time.monotonic() - began
    asymmetry, low, high = updates(count, seed)
    troubles = dict(soak.live.troubles)
    targets = [
        Target("exceptions that came out", float(soak.raised), high=0.0),
        Target("memory, growth after the first streams [MB]", soak.memory[-1] - soak.memory[WARM], high=5.0),
        Target("error at the end [its std]", wrong if status == "ok" else np.inf, high=3.0),
        Target("ok and beyond 3 std [% of ok]", 100.0 * soak.wrong / max(soak.ok, 1), high=1.0),
        Target("wrong commits", float(soak.wrong_commits), high=0.0),
        Target("asymmetry of the covariance", asymmetry, high=0.0),
        Target("least eigenvalue, over the prior's", low, low=1e-12),
        Target("largest eigenvalue, over the prior's", high, high=1.0 + 1e-6),
    ]
    results = {
        "streams": len(soak.memory), "seconds": seconds, "ok": soak.ok, "wrong": soak.wrong, "committed": soak.committed,
        "troubles": troubles, "memory_mb": soak.memory[::20], "rejected": dict(soak.live.gate.counts) if soak.live.gate else {},
        "status": status, "updates": count,
    }  # fmt: skip
    print({k: v for k, v in results.items() if k != "memory_mb"})
    sys.exit(conclude("soak", targets, results, json_path))


if __name__ == "__main__":
    main()
