"""packaged: robots by name, from example-robot-data."""

from __future__ import annotations

from pathlib import Path

import pinocchio


def packaged(name: str) -> Path | None:
    """The URDF of a robot of example-robot-data, None where there is no such one or the package is not installed."""
    for parent in Path(pinocchio.__file__).parents:
        folder = parent / "share" / "example-robot-data" / "robots"
        if folder.is_dir():
            files = sorted(folder.rglob("*.urdf"))
            named = [file for file in files if file.stem == name] + [file for file in files if file.stem.startswith(f"{name}_")]
            return named[0] if named else None
    return None
