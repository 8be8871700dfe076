"""The files of a bag, opened by rosbags, whatever form the bag has."""

from __future__ import annotations

import re
import struct
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import Reader

from sysid_ros.exceptions import BagError
from sysid_ros.sources.mcap_repair import RepairedMcap

_SUFFIXES = (".mcap", ".db3")
_ALLOWED = "Give a rosbag2 folder, an .mcap file or a .db3 file."


class BagFiles:
    """What of a bag can be opened: the folder by its metadata.yaml, else its files one by one, a cut mcap file repaired.

    Opening reads the metadata and counts the messages, so the files stay open from the first use to the last.

    Args:
        path: a rosbag2 folder, an .mcap file or a .db3 file.

    Attributes:
        notes: what the user should know of how the bag is read, one sentence each.

    Raises:
        BagError: there is nothing at the path, it is not a bag, or it is damaged beyond reading.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notes: list[str] = []
        if not path.exists():
            raise BagError(f"bag '{path}' does not exist. {_ALLOWED}")
        self._paths: list[Any] = []
        self._idle: list[Any] = []  # open readers, one a path, that nobody reads from now
        weakref.finalize(self, _close, self._idle)
        if path.is_dir():
            self._use_folder()
        elif path.suffix in _SUFFIXES:
            self._use_files([path])
        elif path.suffix == ".bag":
            raise BagError(f"bag '{path}' is a ROS 1 bag. Convert it first: rosbags-convert --src {path.name} --dst {path.stem}")
        else:
            raise BagError(f"'{path}' is not a bag: its name ends in '{path.suffix}'. {_ALLOWED}")

        for log in sorted(path.glob("*-wal") if path.is_dir() else path.parent.glob(f"{path.name}-wal")):
            if log.stat().st_size:
                self.notes.append(f"'{log}' holds messages that the recorder never merged into the bag; they are not read.")

    def use_files_of_folder(self) -> bool:
        """Passes over the metadata.yaml; False where that is what is done already."""
        if self._paths != [self.path] or not self.path.is_dir():
            return False
        _close(self._idle)
        self._use_files(self._files_of_folder())
        return True

    @contextmanager
    def opened(self) -> Iterator[list[Any]]:
        """One open rosbags ``Reader`` for each file, in the order of recording, for the caller alone."""
        readers = self._idle[:] or _open_all(self._paths)
        self._idle.clear()
        try:
            yield readers
        finally:
            _close(self._idle)
            self._idle[:] = readers

    def messages(self, reader: Any, connections: Sequence[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """Connection, receive time [ns] and bytes of each message.

        Raises:
            BagError: the file is damaged at the place that is read.
        """
        try:
            yield from reader.messages(connections)
        except Exception as error:
            raise BagError(
                f"'{reader.path}' is damaged: {_reason(error)}. Record it again, or use a copy that is whole."
            ) from error

    def _use_folder(self) -> None:
        if (self.path / "metadata.yaml").exists():
            try:
                self._idle[:] = [_open(self.path)]
                self._paths = [self.path]
                return
            except BagError as error:
                self.notes.append(f"The metadata.yaml of bag '{self.path}' is passed over: {error.__cause__ or error}.")
        self._use_files(self._files_of_folder())

    def _files_of_folder(self) -> list[Path]:
        files = sorted((p for p in self.path.iterdir() if p.suffix in _SUFFIXES), key=_natural_order)
        if files:
            return files
        names = sorted(p.name for p in self.path.iterdir())
        found = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "") or "nothing"
        raise BagError(
            f"folder '{self.path}' is not a bag: it holds {found}, and no .mcap or .db3 file that can be read. {_ALLOWED}"
        )

    def _use_files(self, files: Sequence[Path]) -> None:
        for file in files:
            self._idle.append(self._reader(file))
        self._paths = [reader.path for reader in self._idle]

    def _reader(self, file: Path) -> Any:
        try:
            return _open(file)
        except BagError as error:
            if file.suffix != ".mcap":
                raise
            try:
                reader = _open(RepairedMcap(file))
            except (ValueError, BagError):
                raise error from error.__cause__
            self.notes.append(f"'{file}' is cut off or damaged ({error.__cause__}); what is whole of it is read.")
        return reader


def _open(path: Any) -> Any:
    try:
        reader = Reader(path)
        reader.open()
    except Exception as error:
        if isinstance(path, Path) and path.is_file() and path.stat().st_size == 0:
            raise BagError(f"bag '{path}' is an empty file. Record it again.") from error
        raise BagError(
            f"'{path}' can't be read as a bag: {_reason(error)}. "
            f"It is damaged, still being recorded, or not a rosbag2 file. {_ALLOWED}"
        ) from error
    databases = path.glob("*.db3") if path.is_dir() else [path] if path.suffix == ".db3" else []
    for database in databases:
        if _is_cut(database):
            # SQLite reads zeros where pages are missing, and they look like messages.
            reader.close()
            raise BagError(
                f"The end of '{database}' is missing. Copy it again, or save what is left of it: "
                f"sqlite3 {database.name} .recover | sqlite3 saved.db3"
            )
    return reader


def _open_all(paths: Sequence[Any]) -> list[Any]:
    readers: list[Any] = []
    try:
        for path in paths:
            readers.append(_open(path))
    except BagError:
        _close(readers)
        raise
    return readers


def _close(readers: list[Any]) -> None:
    while readers:
        readers.pop().close()


def _is_cut(database: Path) -> bool:
    """Whether an SQLite file is shorter than its header says (sqlite.org/fileformat.html, section 1.3)."""
    with database.open("rb") as file:
        page_size, pages = map(int, struct.unpack(">16xH10xI", file.read(32)))
    return database.stat().st_size < (65536 if page_size == 1 else page_size) * pages


def _reason(error: Exception) -> str:
    return f"{error}".rstrip(".") or type(error).__name__


def _natural_order(path: Path) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name)]
