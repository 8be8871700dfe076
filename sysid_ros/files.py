"""Files and folders that are written whole or not at all: beside their target first, and renamed when they are done. Values as
files of JSON have them."""

from __future__ import annotations

import errno
import math
import os
import secrets
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.exceptions import OutputError

_BLOCK = 4096
"""Bytes that must fit on the disk before the work begins."""


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A path beside ``path`` to write a file to. It takes the place of ``path`` when the block is left, with the rights of the
    file that was there; when it is left by an exception it is removed, and what was there stays.

    A symbolic link stays one. What is no regular file (a device, a pipe) is written to as it is.

    Raises:
        OutputError: it can't be written.
    """
    with _said(path):
        if is_stream(path):
            yield path
            return
        target = path.resolve()
        beside = target.with_name(f".sysid-{secrets.token_hex(6)}{target.suffix}")
        try:
            os.close(os.open(beside, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
            yield beside
            if target.exists():
                shutil.copymode(target, beside)
            beside.replace(target)
        finally:
            with suppress(OSError):
                beside.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8, whole or not at all.

    Raises:
        OutputError: it can't be written.
    """
    with whole(path) as beside:
        beside.write_text(text, encoding="utf-8")


@contextmanager
def whole_folder(path: Path, replace: bool = False) -> Iterator[Path]:
    """The path of a folder to create, of the same name; it becomes ``path`` when the block is left, and is removed when that is
    by an exception.

    Args:
        replace: a folder that is there is removed then; else it stays, and that is an error.

    Raises:
        OutputError: it can't be written.
    """
    with _said(path):
        target = path.resolve()
        room = Path(tempfile.mkdtemp(prefix=".sysid-", dir=target.parent))
        try:
            yield room / target.name
            if target.exists():
                if not replace:
                    raise OutputError(_there_already(path))
                target.rename(room / ".before")
            (room / target.name).rename(target)
        finally:
            if not target.exists() and (room / ".before").exists():
                (room / ".before").rename(target)
            shutil.rmtree(room, ignore_errors=True)


@contextmanager
def whole_files(folder: Path, names: Collection[str]) -> Iterator[Path]:
    """A folder to write files to, which all come to ``folder`` when the block is left, and none when that is by an exception.

    Args:
        folder: made where it is not there; other files in it stay. names: of the files that belong together; those of before that
            are not written again are removed.

    Raises:
        OutputError: they can't be written.
    """
    with _said(folder):
        missing = [p for p in (folder, *folder.parents) if not p.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        room = Path(tempfile.mkdtemp(prefix=".sysid-", dir=folder))
        try:
            yield room
            written = {file.name for file in room.iterdir()}
            for name in sorted(written):
                (room / name).replace(folder / name)
            for name in set(names) - written:
                (folder / name).unlink(missing_ok=True)
        finally:
            shutil.rmtree(room, ignore_errors=True)
            for made in missing:
                with suppress(OSError):  # not empty: it is done
                    made.rmdir()


def check_file(path: Path, force: bool, what: str) -> None:
    """Check that a file can be written, before the work and not after it.

    Args:
        force: one that is there may be replaced. what: the option that asks for it, for the message.

    Raises:
        OutputError: it can't, or there is one already.
    """
    with _said(path, f"{what}: "):
        if is_stream(path):
            return
        if path.is_dir():
            raise OutputError(f"{what} is '{path}', which is a folder. Give the name of a file, such as {path / 'result'}.")
        _check_parent(path, what)
        if not force and path.exists() and path.stat().st_size:
            raise OutputError(f"{what}: {_there_already(path)}")


def check_folder(folder: Path, names: Collection[str], force: bool, what: str) -> None:
    """The same for files of these names in a folder, which is made where it is not there.

    Raises:
        OutputError: as of :func:`check_file`.
    """
    with _said(folder, f"{what}: "):
        there = next(p for p in (folder, *folder.parents) if p.exists())
        if not there.is_dir():
            raise OutputError(f"{what} is '{folder}', but '{there}' is a file. Give the name of a folder.")
        _try_writing(there)
        if not force and (found := sorted(name for name in names if (folder / name).exists())):
            raise OutputError(
                f"{what}: folder '{folder}' holds {', '.join(found)} already, not overwritten. Choose another folder, or give "
                "--force."
            )


def check_bag(folder: Path, force: bool, what: str) -> None:
    """The same for a bag, a folder of its own.

    Raises:
        OutputError: as of :func:`check_file`; also with ``force``, where what is there is no bag.
    """
    with _said(folder, f"{what}: "):
        _check_parent(folder, what)
        if not folder.exists():
            return
        bag = folder.is_dir() and {file.suffix for file in folder.iterdir()} <= {".yaml", ".mcap", ".db3"}
        if not bag:
            raise OutputError(f"{what}: '{folder}' exists already, is no bag, and is not overwritten. Choose another name.")
        if not force:
            raise OutputError(f"{what}: {_there_already(folder)}")


def _check_parent(path: Path, what: str) -> None:
    parent = path.parent
    if not parent.exists():
        raise OutputError(f"{what} is '{path}', but the folder '{parent}' does not exist. Create it first: mkdir -p '{parent}'.")
    if not parent.is_dir():
        raise OutputError(f"{what} is '{path}', but '{parent}' is a file, not a folder.")
    _try_writing(parent)


def _try_writing(folder: Path) -> None:
    """Rights, a read-only file system and a full disk: all show in a file without a name."""
    with tempfile.TemporaryFile(dir=folder) as file:
        file.write(bytes(_BLOCK))
        file.flush()


def _there_already(path: Path) -> str:
    return f"'{path}' exists already and is not overwritten. Choose another name, or give --force."


def is_stream(path: Path) -> bool:
    """A device, a pipe, or what the process has open already."""
    return (
        path.absolute().parts[1:2] == ("proc",)
        or str(path).startswith(("/dev/fd/", "/dev/std"))
        or (path.exists() and not path.is_file() and not path.is_dir())
    )


@contextmanager
def _said(path: Path, option: str = "") -> Iterator[None]:
    try:
        yield
    except OSError as error:
        about = path if error.filename is None else Path(os.fsdecode(error.filename)).resolve()
        if path.resolve().parent not in (about, *about.resolve().parents):
            raise
        cure = _CURES.get(error.errno or 0, "")
        raise OutputError(f"{option}'{path}' can't be written: {error.strerror or error}.{cure}") from error


_CURES = {
    errno.ENOSPC: " Make room, or write to another disk.",
    errno.EDQUOT: " Make room, or write to another disk.",
    errno.EACCES: " Choose a folder that you may write to.",
    errno.EPERM: " Choose a folder that you may write to.",
    errno.EROFS: " Choose a folder that you may write to.",
}


def plain(value: Any) -> Any:
    """Arrays, their numbers and tuples as lists and numbers, complex numbers as [real, imaginary], dataclasses as mappings,
    numbers that are not finite as None, all else as it is."""
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {key: plain(v) for key, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
