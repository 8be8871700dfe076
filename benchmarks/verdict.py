"""What a benchmark must hold: the last table, the JSON file and the exit code of every benchmark."""

from __future__ import annotations

import json
import os
import platform
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from sysid_ros.files import plain


@dataclass(frozen=True, slots=True)
class Target:
    """One number that must hold.

    Attributes:
        what: in words, with the unit.
        value: what was measured.
        low, high: what is allowed.
    """

    what: str
    value: float
    low: float = -np.inf
    high: float = np.inf

    @property
    def held(self) -> bool:
        return bool(self.low <= self.value <= self.high)

    @property
    def allowed(self) -> str:
        if np.isinf(self.low):
            return f"<= {self.high:g}"
        return f">= {self.low:g}" if np.isinf(self.high) else f"{self.low:g} to {self.high:g}"


def conclude(name: str, targets: list[Target], results: dict[str, Any], json_path: Path | None) -> int:
    """Show the targets, write the JSON file; the exit code: 0, or 1 where a target is missed."""
    console = Console(width=130)
    table = Table(title=f"{name}: targets", title_justify="left")
    for column in ("", "measured", "target", "held"):
        table.add_column(column, justify="right" if column == "measured" else "left")
    for t in targets:
        table.add_row(t.what, f"{t.value:.4g}", t.allowed, "yes" if t.held else "[bold red]NO[/]")
    load = os.getloadavg()[0]
    console.print(table)
    console.print(f"Load of the machine at the end: {load:.1f} on {os.cpu_count()} cores.", highlight=False)
    if json_path:
        document = {
            "benchmark": name,
            "date": datetime.now().isoformat(timespec="seconds"),
            "machine": {
                "processor": platform.processor(),
                "cores": os.cpu_count(),
                "load": load,
                "python": platform.python_version(),
            },
            "targets": [{**asdict(t), "held": t.held} for t in targets],
            "results": results,
        }
        json_path.write_text(json.dumps(plain(document), indent=2, allow_nan=False) + "\n")
    return 0 if all(t.held for t in targets) else 1
