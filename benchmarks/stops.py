"""Nodes stopped at random moments, while they start and while they run: does any print a stack, or not end?

    python benchmarks/stops.py [--stops 100] [--seed 0] [--latest 12] [--json FILE]

Each of the three nodes in turn is started as its entry point starts it, and gets SIGINT or SIGTERM after a time that is drawn
evenly from 0 to ``--latest`` seconds: while Python starts, while libraries load, while functions compile, while it runs. Before
the first line of the package runs the interpreter alone answers: those moments are counted apart.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.simulation.description import arm_description

NODES = ("online_payload_estimator", "adaptive_controller", "simulated_robot")
_NODE = "import sys; from sysid_ros.nodes.start import {0}; print('begun', flush=True); sys.exit({0}())"
_PATIENCE = 15.0


def stop(node: str, number: int, after: float, urdf: Path, domain: int) -> dict[str, Any]:
    """Start, wait, stop: what was printed, how it ended and how long that took."""
    arguments = ["--ros-args", "-p", f"urdf_path:={urdf}"] if node != "simulated_robot" else []
    command = ["env", f"ROS_DOMAIN_ID={domain}", sys.executable, "-c", _NODE.format(node), *arguments]
    with tempfile.TemporaryFile("w+") as output, subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT) as process:
        time.sleep(after)
        early = process.poll()
        process.send_signal(number)
        began = time.monotonic()
        try:
            process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
        took = time.monotonic() - began
        output.seek(0)
        text = output.read()
    return {
        "node": node,
        "signal": signal.Signals(number).name,
        "after": after,
        "begun": "begun" in text,
        "ended_before": early is not None,
        "took": took,
        "code": process.returncode,
        "stack": "Traceback" in text,
        "text": text if "Traceback" in text or early is not None else "",
    }


@click.command()
@click.option("--stops", default=100, show_default=True, help="All nodes together.")
@click.option("--seed", default=0, show_default=True, help="Of the moments and signals.")
@click.option("--latest", default=12.0, show_default=True, help="Moment after which none is stopped [s].")
@click.option("--domain", default=77, show_default=True, help="ROS_DOMAIN_ID of the nodes.")
@click.option("--json", "json_path", type=click.Path(path_type=Path))
def main(stops: int, seed: int, latest: float, domain: int, json_path: Path | None) -> None:
    """Stop each node at random moments, and count the stacks that are printed."""
    rng = np.random.default_rng(seed)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder, "arm.urdf")
        urdf.write_text(arm_description())
        for k in range(stops):
            number = int(rng.choice([signal.SIGINT, signal.SIGTERM]))
            row = stop(NODES[k % len(NODES)], number, float(rng.uniform(0.0, latest)), urdf, domain)
            rows.append(row)
            told = "stack" if row["stack"] else f"code {row['code']}"
            print(
                f"{k + 1}/{stops} {row['node']} {row['signal']} after {row['after']:.2f} s: {told}", file=sys.stderr, flush=True
            )
    table = Table(title="Nodes stopped at random moments", title_justify="left")
    for column in ("node", "stops", "before the package ran", "stacks", "stacks before", "longest to end [s]"):
        table.add_column(column, justify="left" if column == "node" else "right")
    for node in NODES:
        own = [r for r in rows if r["node"] == node]
        late = [r for r in own if r["begun"]]
        counts = (len(own), len(own) - len(late), sum(r["stack"] for r in late), sum(r["stack"] and not r["begun"] for r in own))
        table.add_row(node, *map(str, counts), f"{max((r['took'] for r in own), default=0.0):.2f}")
    Console(width=110).print(table)
    begun = [r for r in rows if r["begun"]]
    targets = [
        Target("stacks of stops after the package began", sum(r["stack"] for r in begun), high=0),
        Target("nodes that ended by themselves", sum(r["ended_before"] for r in rows), high=0),
        Target("longest time to end [s]", max(r["took"] for r in rows), high=10.0),
    ]
    raise SystemExit(conclude("stops", targets, {"rows": rows, "seed": seed, "latest": latest}, json_path))


if __name__ == "__main__":
    main()
