"""Where the mesh files of a URDF are on this machine."""

from __future__ import annotations

import os
import sysconfig
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import unquote, urlparse


class MeshFiles:
    """Finds the files that a URDF names as ``package://``, ``file://``, absolute, or relative to itself.

    A package is looked for in the given folders, in the folders above the URDF, in ``ROS_PACKAGE_PATH``, in the ``share`` folders
    of ``AMENT_PREFIX_PATH`` and among the robots of ``example-robot-data`` where that is installed, in this order.

    Args:
        urdf_folder: of the URDF file; None where it is no file.
        package_paths: folders that hold packages, or are one.
    """

    def __init__(self, urdf_folder: Path | None = None, package_paths: Sequence[Path] = ()) -> None:
        self._folder = urdf_folder.resolve() if urdf_folder else None
        above = [self._folder, *self._folder.parents] if self._folder else []
        ros = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
        ament = [Path(p) / "share" for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
        wheels = Path(sysconfig.get_path("purelib")) / "cmeel.prefix" / "share"
        self._roots = [*(p.resolve() for p in package_paths), *above, *ros, *ament, wheels]

    def find(self, name: str) -> Path | None:
        """The file, or None where it is not on this machine."""
        address = urlparse(name)
        if address.scheme == "package":
            package, rest = unquote(address.netloc), unquote(address.path).lstrip("/")
            candidates = [root / package / rest for root in self._roots]
            candidates += [root / rest for root in self._roots if root.name == package]
        elif address.scheme == "file":
            candidates = [Path(unquote(address.path))]
        elif address.scheme:
            candidates = []
        else:
            candidates = [Path(name)] if Path(name).is_absolute() else [self._folder / name] if self._folder else []
        return next((path for path in candidates if path.is_file()), None)
