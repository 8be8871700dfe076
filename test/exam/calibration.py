"""``python -m exam.calibration``: of the causes that are told with 0.9, are nine in ten right?

Every claim of every level of the exam (but ``claims`` of rows without a probability) falls into a bin of its probability. A bin
holds where the part of its claims that is true lies inside the binomial 95 % region of the mean probability told: what that many
claims would give if each were as likely as it says. (With probabilities that differ inside a bin the number of true claims is
spread a little less than a binomial of their mean: the region is never too narrow for it.)

Examples:
    make calibration
    cd test && ../.venv/bin/python -m exam.calibration --json single.json hard.json pairs.json healthy.json outside.json real.json

Exit code 0 where every bin holds, 1 where one does not, or where nothing is told with a probability.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binom

from exam.__main__ import EXAMINATION, sit_all
from exam.case import LEVELS
from sysid_ros.pages import palette
from sysid_ros.pages.figure import Axis, Band, Curve, Figure, Item, Panel, Stack
from sysid_ros.pages.page import write_plot

EDGES = (0.5, 0.8, 0.95, 1.0)
PICTURE = Path(__file__).resolve().parents[2] / "docs" / "images" / "calibration.png"
_REGION = 0.95
# 620 robots
_CASES = {"single": 150, "hard": 100, "pairs": 60, "healthy": 90, "outside": 20, "real": 200}
_FEWEST = 600
_ROUNDING = 1e-12
_HALF = 0.007


@dataclass(frozen=True)
class Bin:
    """Claims whose probability lies between ``low`` and ``high``, the last bin's upper end included.

    Attributes:
        count, right: claims, and those of them that are true. mean: probability told.
    """

    low: float
    high: float
    count: int
    right: int
    mean: float

    @property
    def observed(self) -> float:
        """Part that is true; NaN without claims."""
        return self.right / self.count if self.count else float("nan")

    @property
    def region(self) -> tuple[float, float]:
        """Where the observed rate lies in 95 % of the cases if the mean probability is right; all without claims."""
        if not self.count:
            return 0.0, 1.0
        low, high = binom.interval(_REGION, self.count, min(self.mean, 1.0))
        return float(low) / self.count, float(high) / self.count

    @property
    def holds(self) -> bool:
        """The observed rate lies in the region; so it does without claims."""
        low, high = self.region
        return not self.count or low - _ROUNDING <= self.observed <= high + _ROUNDING


def told(rows: Iterable[dict[str, Any]]) -> list[tuple[float, bool]]:
    """Probability and truth of every claim that has a probability, of rows as the exam writes them."""
    claims = (claim for row in rows for claim in row.get("claims", ()))
    return [(float(c["probability"]), bool(c["true"])) for c in claims if c["probability"] is not None]


def reliability(pairs: Sequence[tuple[float, bool]], edges: Sequence[float] = EDGES) -> list[Bin]:
    """The bins between edges of claims of probability and truth."""
    out = []
    for low, high in pairwise(edges):
        inside = [(p, right) for p, right in pairs if low <= p < high or p == high == edges[-1]]
        mean = float(np.mean([p for p, _ in inside])) if inside else float("nan")
        out.append(Bin(low, high, len(inside), sum(right for _, right in inside), mean))
    return out


def table(bins: Sequence[Bin]) -> str:
    """A line a bin."""
    lines = [f"{'told with':14s} {'claims':>6s} {'mean':>6s} {'true':>6s}   95 % region"]
    for b in bins:
        end = "]" if b is bins[-1] else ")"
        name = f"[{b.low:.2f}, {b.high:.2f}{end}"
        if not b.count:
            lines.append(f"{name:14s} {0:6d}")
            continue
        low, high = b.region
        lines.append(
            f"{name:14s} {b.count:6d} {b.mean:6.3f} {b.observed:6.3f}   {low:.3f} to {high:.3f}{'' if b.holds else '  OUTSIDE'}"
        )
    return "\n".join(lines)


def diagram(bins: Sequence[Bin], robots: int) -> Figure:
    """Observed rate over mean probability, each with the region that it must lie in."""
    seen = [b for b in bins if b.count]
    items: list[Item] = [Curve(np.array([0.5, 1.0]), np.array([0.5, 1.0]), "told = true", palette.SOFT, 1.0, "dashed")]
    for k, b in enumerate(seen):
        label = "95 % region of the probability told" if k == 0 else ""
        low, high = (np.full(2, x) for x in b.region)
        items.append(Band(b.mean + np.array([-_HALF, _HALF]), low, high, label, palette.SKY, 0.6))
    x, y = np.array([b.mean for b in seen]), np.array([b.observed for b in seen])
    items.append(Curve(x, y, "claims that are true", palette.BLUE, 0.0, marker="dot", size=7.0))
    least = min([0.45, *(min(b.observed, b.region[0]) - 0.05 for b in seen)])
    ticks = tuple((t, f"{t:g}") for t in (0.5, 0.6, 0.7, 0.8, 0.9, 1.0))
    panel = Panel(
        tuple(items),
        "part that is true",
        x=Axis("probability told", (0.48, 1.02), ticks=ticks),
        y=Axis(limits=(max(least, -0.02), 1.02)),
        height=330.0,
    )
    said = "; ".join(f"[{b.low:g}, {b.high:g}]: {b.right} of {b.count} true, told with {b.mean:.3f}" for b in seen)
    return Figure(
        (Stack((panel,)),), "Of the causes told with a probability, how many are true", f"{robots} robots. {said}", width=560.0
    )


def main() -> int:
    """Parse, sit or read, show."""
    parser = argparse.ArgumentParser(
        prog="calibration", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, nargs="+", help="rows that the exam wrote; without: cases of all levels")
    parser.add_argument("--cases", type=int, default=sum(_CASES.values()), help="of all levels together")
    parser.add_argument("--seed-base", type=int, default=EXAMINATION, help="first seed; below 10000 while developing")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=PICTURE, help="the diagram")
    arguments = parser.parse_args()
    if arguments.json:
        rows = [row for path in arguments.json for row in json.loads(path.read_text())]
    else:
        rows = list(_sit(arguments.cases, arguments.seed_base, arguments.jobs))
    pairs = told(rows)
    if not any(p >= EDGES[0] for p, _ in pairs):
        print(f"none of the {len(rows)} robots has a cause that is told with a probability.")
        return 1
    bins = reliability(pairs)
    print(f"{len(rows)} robots{'' if len(rows) >= _FEWEST else f', of {_FEWEST} that are wanted'}")
    print(table(bins))
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    write_plot(arguments.out, diagram(bins, len(rows)))
    print(arguments.out)
    return 0 if all(b.holds for b in bins) else 1


def _sit(cases: int, first: int, jobs: int) -> Iterable[dict[str, Any]]:
    """Rows of all levels, in the proportions of ``_CASES``."""
    for level in LEVELS:
        count = max(1, round(cases * _CASES[level] / sum(_CASES.values())))
        for done, row in enumerate(sit_all(range(first, first + count), level, None, jobs), start=1):
            print(f"{level} {done}/{count} seed {row['seed']} {row.get('error', '')}", file=sys.stderr, flush=True)
            yield row


if __name__ == "__main__":
    sys.exit(main())
