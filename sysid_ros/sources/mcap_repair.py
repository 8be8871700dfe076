"""An mcap file whose end is missing, made readable again up to where it was cut."""

from __future__ import annotations

import struct
from io import BytesIO
from pathlib import Path

_MAGIC = b"\x89MCAP0\r\n"
_HEADER, _CHUNK, _DATA_END = 0x01, 0x06, 0x0F
_FOOTER = b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0)  # no summary: readers scan the records


class RepairedMcap:
    """The whole records of a cut mcap file with a new footer, offered to rosbags in place of the file's path.

    A recorder that is killed leaves a file without its index, and often half a chunk. Whole chunks are kept; of a half
    chunk that is not compressed, its whole records are. Reference: MCAP format specification, mcap.dev/spec.

    Args:
        path: the cut file.

    Raises:
        ValueError: the file does not begin as an mcap, or no whole record is left of it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.name = path.name
        self.suffix = path.suffix
        self._content = _whole_records(path.read_bytes())

    def __str__(self) -> str:
        return str(self.path)

    def exists(self) -> bool:
        """As of a path."""
        return True

    def is_dir(self) -> bool:
        """As of a path."""
        return False

    def open(self, mode: str) -> BytesIO:
        """As of a path; ``mode`` is always to read bytes."""
        if mode != "rb":
            raise ValueError(f"mode '{mode}' to open a repaired mcap file; only 'rb' is allowed.")
        return BytesIO(self._content)


def _whole_records(data: bytes) -> bytes:
    if data[:8] != _MAGIC or data[8:9] != bytes([_HEADER]):
        raise ValueError("it does not begin as an mcap file does")
    at, kept = 8, 8
    while (size := _record_size(data, at, len(data))) is not None and data[at] != _DATA_END:
        at += size
        kept = at
    if kept == 8:
        raise ValueError("not one whole record is left of it")
    rest = _records_of_half_chunk(data, at) if data[at : at + 1] == bytes([_CHUNK]) else b""
    return data[:kept] + rest + _FOOTER + _MAGIC


def _record_size(data: bytes, at: int, end: int) -> int | None:
    """Bytes of the record at ``at``, None where it is not whole."""
    if at + 9 > end:
        return None
    size = 9 + int(struct.unpack_from("<Q", data, at + 1)[0])
    return size if at + size <= end else None


def _records_of_half_chunk(data: bytes, at: int) -> bytes:
    try:
        (compression_size,) = struct.unpack_from("<I", data, at + 9 + 28)
    except struct.error:
        return b""
    if compression_size:
        return b""
    begin = position = at + 9 + 28 + 4 + 8
    while (size := _record_size(data, position, len(data))) is not None:
        position += size
    return data[begin:position]
