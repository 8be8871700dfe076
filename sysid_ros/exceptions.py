"""Errors of the package: one root, one child for each kind of mistake a user can make."""

_LONG = 200
"""Letters of another library's message that are told."""


class SysidError(Exception):
    """Root of every error the package raises on purpose.

    The message says what is wrong, the value found, what is allowed, and the cure. Commands print it and exit with 2.
    """


class RobotModelError(SysidError):
    """The URDF, its joints or a frame can't be used."""


class BagError(SysidError):
    """A recorded bag can't be read or lacks what is needed."""


class ModelFileError(SysidError):
    """A ``model.yaml`` can't be read or does not belong to the robot."""


class SettingsError(SysidError):
    """A setting is unknown, of the wrong type or out of its range."""


class DataError(SysidError):
    """The data can't answer the question asked of them."""


class ClusterError(SysidError):
    """The processes that work on a fleet can't be reached, or were lost."""


class OutputError(SysidError):
    """A result can't be written where it was asked for."""


def in_a_line(error: BaseException) -> str:
    """What an error of another library says, in one short line without a full stop."""
    if isinstance(error, UnicodeDecodeError):
        return "it is not text in UTF-8"
    words = " ".join(str(error).split()).rstrip(".")
    return (words if len(words) <= _LONG else words[: _LONG - 3] + "...") or type(error).__name__
