"""Where bags lie: found by glob, folder or URL, known by their content, and at hand as files while they are read."""

from __future__ import annotations

import glob
import hashlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sysid_ros.exceptions import BagError, SettingsError, in_a_line
from sysid_ros.sources.table import SUFFIXES as TABLES

SUFFIXES = (".mcap", ".db3")
_METADATA = "metadata.yaml"
_BLOCK = 1 << 20


def find(patterns: Sequence[str]) -> Iterator[str]:
    """Absolute paths or URLs of bags, those of each pattern in order, without keeping more than a folder's names.

    Args:
        patterns: a bag, a folder (searched with all below it for rosbag2 folders, .mcap and .db3 files), a glob of these, or the
            same as a URL of fsspec (``s3://bucket/run_*/``).

    Raises:
        SettingsError: nothing is there, or the file system of a URL is not installed.
    """
    for pattern in patterns:
        found = False
        for bag in _remote(pattern) if is_url(pattern) else _local(os.path.abspath(pattern.removeprefix("file://"))):
            found = True
            yield bag
        if not found:
            raise SettingsError(
                f"'{pattern}' matches no bag. Give a rosbag2 folder, an .mcap or .db3 file, a folder that holds some, a glob in "
                "quotes such as 'bags/**/*.mcap', or a URL such as s3://bucket/bags."
            )


def is_url(path: str) -> bool:
    """Whether a file system of fsspec other than the local one has it."""
    return "://" in path and not path.startswith("file://")


def stamp_of(bag: str) -> str:
    """Sizes and times of change of a bag's files, by which it is known again without being read; empty where it can't be seen."""
    try:
        if not is_url(bag):
            return " ".join(f"{s.st_size}:{s.st_mtime_ns}" for s in (file.stat() for file in _files(Path(bag))))
        fs, path = _file_system(bag)
        files = sorted(fs.find(path)) or [path]
        return " ".join(_remote_stamp(fs.info(file)) for file in files)
    except OSError:
        return ""


def content_hash(path: Path) -> str:
    """SHA-256 over the names and the content of a bag's files, hexadecimal.

    Raises:
        BagError: they can't be read.
    """
    digest = hashlib.sha256()
    try:
        for file in _files(path):
            digest.update(f"{file.name if file != path else file.suffix}:{file.stat().st_size}:".encode())
            with open(file, "rb") as stream:
                while block := stream.read(_BLOCK):
                    digest.update(block)
    except OSError as error:
        raise BagError(f"'{path}' can't be read: {error.strerror or error}.") from error
    return digest.hexdigest()


@contextmanager
def at_hand(bag: str) -> Iterator[Path]:
    """A path of the bag on this machine: itself where it lies here, else a copy for as long as the block lasts.

    Raises:
        BagError: it can't be fetched. SettingsError: its file system is not installed.
    """
    if not is_url(bag):
        yield Path(bag.removeprefix("file://"))
        return
    fs, path = _file_system(bag)
    with tempfile.TemporaryDirectory(prefix="sysid_bag_") as folder:
        target = Path(folder) / Path(path).name
        try:
            fs.get(path, str(target), recursive=bool(fs.isdir(path)))
        except Exception as error:
            raise BagError(f"bag '{bag}' can't be fetched: {in_a_line(error)}.") from error
        yield target


def _local(pattern: str) -> Iterator[str]:
    if glob.has_magic(pattern):
        names = sorted(glob.iglob(pattern, recursive=True))
        folders = {name.rstrip("/") for name in names if os.path.isdir(name)}
        for name in names:
            if not any(str(above) in folders for above in Path(name).parents):  # else it is found below that one
                yield from _below(name)
    elif os.path.exists(pattern):
        yield from _below(pattern, given=True)


def _below(name: str, given: bool = False) -> Iterator[str]:
    """The bags at or below a path. A file that is given may be of any kind: what it is not is said when it is read."""
    if not os.path.isdir(name):
        if given or name.endswith((*SUFFIXES, *TABLES)):
            yield name
        return
    if _is_bag_folder(name):
        yield name.rstrip("/") or name
        return
    with os.scandir(name) as entries:
        inside = sorted((e.name, e.is_dir()) for e in entries if not e.name.startswith("."))
    for child, is_folder in inside:
        if is_folder or child.endswith(SUFFIXES):
            yield from _below(os.path.join(name, child))


def _is_bag_folder(name: str) -> bool:
    return os.path.exists(os.path.join(name, _METADATA))


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.iterdir() if file.name == _METADATA or file.suffix in SUFFIXES)


def _file_system(url: str) -> tuple[Any, str]:
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise SettingsError(
            "bags at a URL need fsspec, which is not installed. Install it: pip install 'sysid_ros[fleet]'"
        ) from None
    try:
        fs, path = url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise SettingsError(f"'{url}' can't be opened: {in_a_line(error)}.") from None
    return fs, str(path)


def _remote(pattern: str) -> Iterator[str]:
    fs, path = _file_system(pattern)
    roots = sorted(fs.glob(path)) if glob.has_magic(path) else [path] if fs.exists(path) else []
    for root in roots:
        files = sorted(fs.find(root)) or [root]
        bags = {os.path.dirname(file) for file in files if os.path.basename(file) == _METADATA}
        single = [file for file in files if os.path.dirname(file) not in bags and (file == root or file.endswith(SUFFIXES))]
        for bag in sorted([*bags, *single]):
            yield str(fs.unstrip_protocol(bag))


def _remote_stamp(info: dict[str, Any]) -> str:
    changed = next((info[key] for key in ("ETag", "etag", "mtime", "LastModified", "updated", "created") if info.get(key)), "")
    return f"{info.get('size')}:{changed}"
