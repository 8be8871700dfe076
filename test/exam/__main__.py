"""``python -m exam``: the exam of the diagnosis on hidden causes drawn from seeds.

Examples:
    make exam
    make exam LEVEL=hard
    make exam LEVEL=real
    cd test && ../.venv/bin/python -m exam --level single --cases 64 --seed-base 0 --only payload

Exit code 0 where every target of the level holds, 1 where one does not.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from exam.baseline import baseline_error
from exam.candidate import diagnosis_of
from exam.case import LEVELS, SIMULATORS, draw_case
from exam.claims import claims
from exam.real import draw_real
from exam.real_scoring import score_real
from exam.scoring import score
from exam.table import failed_targets, render

EXAMINATION = 10000
"""Seeds from here on are not used while developing."""
_CASES = {"single": 200, "hard": 100, "pairs": 60, "healthy": 100, "outside": 20, "real": 200}


def sit(seed: int, level: str, effect: str | None, simulator: str | None = None) -> dict[str, Any]:
    """One case: drawn, diagnosed, scored."""
    began = time.perf_counter()
    case = draw_real(seed, effect, simulator) if level == "real" else draw_case(seed, level, effect, simulator)
    drawn = time.perf_counter()
    document = diagnosis_of(case)
    diagnosed = time.perf_counter()
    row = score_real(case.truth, document, baseline_error(case)) if level == "real" else score(case.truth, document)
    row |= {"seed": seed, "level": level, "hidden": case.truth["hidden"], "arm": case.arm, "simulator": case.truth["simulator"]}
    row |= {
        "draw_s": drawn - began,
        "diagnose_s": diagnosed - drawn,
        "claims": claims(case.truth, document),
        "truth": case.truth["effects"],
        "effects": document["effects"],
    }
    return row


def sit_all(seeds: range, level: str, effect: str | None, jobs: int, simulator: str | None = None) -> Iterator[dict[str, Any]]:
    """Every case, as they end. A case that breaks the diagnosis is a row that is wrong, with its error."""
    with ProcessPoolExecutor(jobs) as pool:
        futures = {pool.submit(sit, seed, level, effect, simulator): seed for seed in seeds}
        for future in as_completed(futures):
            error = future.exception()
            if error is None:
                yield future.result()
            else:
                words = f"{type(error).__name__}: {error}"
                wrong = {"verdict": "error", "named": [], "right": False, "exact": False, "all_found": False}
                yield {"seed": futures[future], "level": level, "hidden": ["(error)"], "error": words, **wrong}


def main() -> int:
    """Parse, sit, show."""
    parser = argparse.ArgumentParser(prog="exam", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--level", choices=LEVELS, default="single")
    parser.add_argument("--cases", type=int, help="how many; each level has its own default")
    parser.add_argument("--seed-base", type=int, default=EXAMINATION, help="first seed; below 10000 while developing")
    parser.add_argument("--only", metavar="ID", help="hide this effect alone")
    parser.add_argument("--simulator", choices=SIMULATORS, help="this one alone; else both in turn")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--json", type=Path, help="write every case")
    arguments = parser.parse_args()
    count = arguments.cases or _CASES[arguments.level]
    seeds = range(arguments.seed_base, arguments.seed_base + count)
    rows = []
    for row in sit_all(seeds, arguments.level, arguments.only, arguments.jobs, arguments.simulator):
        rows.append(row)
        mark = "right" if row["right"] and row.get("exact", True) else "part " if row["right"] else "WRONG"
        print(
            f"{len(rows):4d}/{count} seed {row['seed']} {mark} {' + '.join(row['hidden']) or 'nothing'} -> "
            f"{' + '.join(row['named']) or row['verdict']} {row.get('error', '')}",
            file=sys.stderr,
            flush=True,
        )
    rows.sort(key=lambda r: r["seed"])
    print(render(arguments.level, rows))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=1, default=float) + "\n")
    failed = failed_targets(arguments.level, rows)
    for sentence in failed:
        print(f"target missed: {sentence}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
