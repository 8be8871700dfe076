"""The tables of a store: names, types and units of their columns, and the version of all of them.

Every table says with ``hash``, ``model``, ``version`` and ``job`` what it was worked out from, and by what. A null is a value
that nothing tells; no column holds a number that is not one (NaN), but for the covariances.
"""

from __future__ import annotations

from typing import Any, Final

from sysid_ros.exceptions import SettingsError

SCHEMA_VERSION: Final = 1
"""Of all tables together; it grows with every change that a reader of before would misread."""

JOINT_PARAMETERS: Final = (
    "coulomb_friction",
    "viscous_friction",
    "torque_offset",
    "torque_gain",
    "joint_offset",
    "rotor_inertia",
    "torque_delay",
    "noise",
)
"""What ``track`` tells of a joint, in the order of the rows and columns of ``covariance``."""

UNITS: Final = {
    "coulomb_friction": "N m",
    "viscous_friction": "N m s/rad",
    "torque_offset": "N m",
    "torque_gain": "1",
    "joint_offset": "rad",
    "rotor_inertia": "kg m^2",
    "torque_delay": "s",
    "noise": "N m",
}
"""Of :data:`JOINT_PARAMETERS`; on a prismatic joint N for N m and m for rad."""

TABLES: Final = ("bags", "joints", "payloads", "events")
"""``bags`` is written last: a row of another table counts where its bag's row is there."""

PARTITION: Final = "month"
"""The column that only the folders' names hold: of the bag's date in UTC, such as 2026-03; ``unknown`` where it has none."""

Columns = dict[str, tuple[str, str]]

_KEY: Columns = {
    "hash": ("string", "SHA-256 of the bag's content, hexadecimal; empty where it could not be read at all"),
    "model": ("string", "SHA-256 of what the robot was known by: URDF, model.yaml, known payload, settings"),
    "version": ("string", "of the package"),
    "job": ("string", "track, replay, identify or diagnose"),
    "robot": ("string", "name of the robot, by the rules of robots.yaml"),
    "kind": ("string", "kind of robot: robots of one kind are alike"),
    "date": (
        "timestamp",
        "UTC: as told in robots.yaml, else the bag's first stamp; null without either, or with a campaign alone",
    ),
}
_BAGS: Columns = {
    "bag": ("string", "path or URL"),
    **_KEY,
    "duration": ("double", "from the first message to the last [s]"),
    "rate": ("double", "of the joint states [Hz]"),
    "samples": ("int", "joint states that were read"),
    "status": ("string", "ok or failed"),
    "reason": ("string", "why it failed, or what should be known of how it was read; empty where there is nothing"),
    "temperature": ("double", "mean over joints and time of what the bag holds [degC]"),
    "seconds": ("double", "processor time [s]"),
    "document": ("string", "JSON of the job's whole result, where it has one"),
    "stamp": ("string", "size and time of change of the bag's files, by which a bag that was done is known without reading it"),
    "schema_version": ("int", "of the tables"),
    "date_told": ("bool", "whether the date is told in robots.yaml"),
    "campaign": ("string", "what it was recorded in, where robots.yaml tells that in place of a date; empty elsewhere"),
    "campaign_order": ("int", "place of the campaign in time from 0; null where it is not told"),
}
_JOINTS: Columns = {
    "bag": ("string", "path or URL"),
    **_KEY,
    "joint": ("string", "name"),
    "temperature": ("double", "mean over the time of the bag [degC]"),
    **{
        name: column
        for p in JOINT_PARAMETERS
        for name, column in {
            p: ("double", f"estimate [{UNITS[p]}]; null where the bag does not tell it"),
            f"{p}_std": ("double", f"standard deviation of the estimate [{UNITS[p]}]"),
        }.items()
    },
    "covariance": ("doubles", "of the parameters in their order, row by row, 64 values; NaN where one is not estimated"),
    "residual": ("double", "rms of what is left of the torque below the cut-off while the joint moves [N m]"),
    "torque": ("double", "rms of the torque there [N m]"),
    "lever": ("double", "rms distance of the carrying link's origin from the joint's axis [m/rad; 1 of a prismatic joint]"),
    "torque_per_zero": (
        "double",
        "rms change of torque per error of this joint's zero, of the joint where that is most [N m/rad]",
    ),
    "torque_per_mass": ("double", "rms torque of this joint per mass at the carrying link's origin [N m/kg]"),
    "from_prior": ("string", "parameters that are null because the bag tells little more of them than the prior"),
    "model_error": ("string", "what speaks against the model in this bag, in words; empty where nothing does"),
}
_PAYLOADS: Columns = {
    "bag": ("string", "path or URL"),
    **_KEY,
    "t_from": ("double", "since the first stamp of the bag [s]"),
    "t_to": ("double", "since the first stamp of the bag [s]"),
    "frame": ("string", "link that carries it, in whose axes com and inertia are"),
    "mass": ("double", "[kg]"),
    "mass_std": ("double", "[kg]"),
    **{
        name: ("double", f"{axis} of the centre of mass{what} [m]")
        for axis in "xyz"
        for name, what in ((f"com_{axis}", ""), (f"com_{axis}_std", ", standard deviation"))
    },
    "inertia": ("doubles", "xx, yy, zz, xy, xz, yz about the centre of mass [kg m^2]; null where the motion does not tell it"),
    "status": ("string", "whether to believe it, in a word"),
}
_EVENTS: Columns = {
    "bag": ("string", "path or URL"),
    **_KEY,
    "t": ("double", "since the first stamp of the bag [s]"),
    "kind_of_event": ("string", "picked, dropped, changed, collision, or as the job calls it"),
    "mass_before": ("double", "[kg]"),
    "mass_after": ("double", "[kg]"),
}
COLUMNS: Final[dict[str, Columns]] = {"bags": _BAGS, "joints": _JOINTS, "payloads": _PAYLOADS, "events": _EVENTS}
"""Of each table: name of the column to (type, what it holds)."""

ORDER: Final = {
    "bags": ("date", "bag", "job", "model", "version"),
    "joints": ("date", "bag", "job", "model", "version", "joint"),
    "payloads": ("date", "bag", "job", "model", "version", "t_from"),
    "events": ("date", "bag", "job", "model", "version", "t"),
}
"""Columns by which a table that is read is sorted, whatever order the jobs were done in."""


def require_pyarrow() -> Any:
    """The module ``pyarrow``.

    Raises:
        SettingsError: it is not installed.
    """
    try:
        import pyarrow
    except ImportError:
        raise SettingsError(
            "a fleet's store needs pyarrow, which is not installed. Install it: pip install 'sysid_ros[fleet]'"
        ) from None
    return pyarrow


def schema_of(table: str) -> Any:
    """The ``pyarrow.Schema`` of a table, without the column of its folders; what a column holds is its metadata ``about``.

    Raises:
        SettingsError: there is no such table, or pyarrow is not installed.
    """
    if table not in COLUMNS:
        raise SettingsError(f"a store has no table '{table}'; it has {', '.join(TABLES)}.")
    pa = require_pyarrow()
    types = {
        "string": pa.string(),
        "double": pa.float64(),
        "int": pa.int64(),
        "bool": pa.bool_(),
        "doubles": pa.list_(pa.float64()),
        "timestamp": pa.timestamp("us", tz="UTC"),
    }
    fields = [pa.field(name, types[kind], metadata={"about": about}) for name, (kind, about) in COLUMNS[table].items()]
    return pa.schema(fields, metadata={"sysid_schema_version": str(SCHEMA_VERSION), "sysid_table": table})
