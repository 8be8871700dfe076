"""What a node says of its start: that it still works, and what went wrong in a way that nobody foresaw."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from sysid_ros.exceptions import SysidError

_PATIENCE = 2.0
COMPILES = (
    "Loading compiled code; after an install it is compiled, which takes about a minute, once. Messages are not used until it is "
    "done."
)


@contextmanager
def said_if_slow(say: Callable[[str], object], text: str, after: float = _PATIENCE) -> Iterator[None]:
    """Say the text where what follows takes longer than ``after`` [s]."""
    timer = threading.Timer(after, say, (text,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def cause_of(error: Exception) -> str:
    """A sentence on what went wrong and what to do, also where nobody foresaw it."""
    if isinstance(error, SysidError):
        return str(error)
    return (
        f"{type(error).__name__}: {error}. This was not foreseen: see that 'sysid doctor' finds nothing wrong, try the URDF with "
        "'sysid replay', and report it with the URDF."
    )
