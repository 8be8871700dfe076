"""Where results may be written."""

from __future__ import annotations

from pathlib import Path

from sysid_ros.exceptions import SettingsError


def with_suffix(path: str | Path, allowed: tuple[str, ...]) -> Path:
    """The path, where its suffix is allowed and its folder is there.

    Raises:
        SettingsError: it is not so.
    """
    path = Path(path)
    if path.suffix not in allowed:
        words = ", ".join(suffix or "none, for a folder" for suffix in allowed)
        raise SettingsError(f"'{path}' ends in '{path.suffix}'; the suffix must be one of: {words}.")
    if not path.parent.is_dir():
        raise SettingsError(f"The folder '{path.parent}' does not exist. Create it first.")
    return path
