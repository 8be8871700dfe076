"""Options that several commands have."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from sysid_ros.robot.effort_presets import PRESETS

PATH = click.Path(path_type=Path)
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def path(*names: str, **more: Any) -> Decorator:
    """A path."""
    return click.option(*names, type=PATH, **more)


class Range(click.FloatRange):
    """Numbers from ``min`` to ``max``; NaN, which is neither below nor above, is none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number."""
        found = super().convert(value, param, ctx)
        if math.isnan(found):
            self.fail(f"{value!r} is not a number.", param, ctx)
        return found


def number(*names: str, default: float, **more: Any) -> Decorator:
    """A number of the default's type."""
    return click.option(*names, type=type(default), default=default, show_default=True, **more)


def vector(*names: str, default: tuple[float, ...] | None = None, metavar: str = "X Y Z", **more: Any) -> Decorator:
    """Three numbers; None where there is no default."""
    return click.option(*names, type=float, nargs=3, metavar=metavar, default=default, show_default=default is not None, **more)


def each_joint(*names: str, **more: Any) -> Decorator:
    """A number for all joints, or one a joint, with commas between them; 0 by default."""
    return click.option(*names, callback=numbers, metavar="X[,X...]", default="0", **more)


def numbers(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, ...] | None:
    """Numbers with commas between them, the callback of an option."""
    try:
        return None if value is None else tuple(float(x) for x in value.split(","))
    except ValueError:
        raise click.BadParameter(
            f"{value!r} is not one number or numbers with commas between them, such as 0.5 or 0,-1.2,0.5,0,1,0."
        ) from None


BAGS = click.argument("bags", type=PATH, nargs=-1, required=True, metavar="BAG...")
COLUMNS = path("--columns", "columns_path", metavar="YAML", help="Which columns of a table are which; else guessed, and shown.")
CONFIG = path("--config", "config_path", help="Parameters of the node (effort_scale, joint_names, ...), a ROS 2 YAML file.")
EFFORT_PRESET = click.option(
    "--effort-preset",
    default="",
    metavar="ARM",
    help=f"Efforts are what this arm's driver publishes, such as currents: {', '.join(PRESETS)}. Never assumed.",
)
FORCE = click.option("--force", is_flag=True, help="Overwrite results that are there.")
IMU_TOPIC = click.option(
    "--imu-topic", default="", help="sensor_msgs/Imu of a legged robot; else /imu, or the only one in the bag."
)
CONTACT_TOPIC = click.option("--contact-topic", default="", help="Which feet stand; else /contacts, if it is in the bag.")
JOINT_NAMES = click.option(
    "--joint-names", multiple=True, metavar="NAME...", help="Joints that move; others are locked at 0.  [default: all]"
)
READ_JOINTS = click.option(
    "--joint-names",
    multiple=True,
    metavar="NAME...",
    help="Joints of the messages that are the robot's; in the URDF's order, where it calls them otherwise.  [default: all]",
)
JSON = path("--json", "json_path", help="Write the result for machines.")
NEW_BAG = path("--bag", required=True, help="Folder to create; the truth goes to BAG.truth.json.")
PLOT = path("--plot", "plot_path", help="Write a figure: .png, .svg, .pdf, or .html to look around in.")
RERUN = path(
    "--rerun", "rerun_path", metavar="RRD", help="Write figures and robot over time for the viewer of Rerun (extra rerun)."
)
SEED = number("--seed", default=0, help="Of the motion and of the noise.")
STORAGE = click.option("--storage", type=click.Choice(["mcap", "sqlite3"]), default="mcap", show_default=True, help="Of the bag.")
TOPIC = click.option("--topic", default="/joint_states", show_default=True)
