"""``sysid simulate``: record bags of simulated robots, with the truth beside them."""

from __future__ import annotations

import click

from sysid_ros.cli.main import LazyGroup

COMMANDS = {
    "arm": ("sysid_ros.cli.simulate_arm", "An arm that picks up and drops a payload, or that hides something (PyBullet)."),
    "quadruped": ("sysid_ros.cli.simulate_quadruped", "A quadruped that stands, sways or trots with a box on its back."),
    "fleet": ("sysid_ros.cli.simulate_fleet", "Many arms over months: wear, seasons, slips, drift, tools."),
}


@click.group(cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """Record bags of simulated robots, with the truth beside them.

    \b
    Example:
      sysid simulate arm --bag pick_and_drop --payload-mass 1.5 --pick 4 --drop 10
      sysid simulate quadruped --bag trot --gait trot --payload-mass 3 --pick 4 --drop 8
      sysid simulate fleet --bag fleet --robots 10 --weeks 26
    """
