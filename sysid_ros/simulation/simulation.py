"""Simulation: what a scenario step by step is for every robot: a body that is picked up and dropped, and the truth."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.payload import Payload, truth_of_payload
from sysid_ros.simulation.scenario import CONTROL_RATE, Scenario

if TYPE_CHECKING:  # each needs its own simulator
    from sysid_ros.simulation.arm import ArmWorld
    from sysid_ros.simulation.legged_world import LeggedWorld
    from sysid_ros.simulation.quadruped import QuadrupedWorld

Message = TypeVar("Message")
"""What the sensors tell at one instant."""


class Simulation(ABC, Generic[Message]):
    """A robot that may carry the payload of its scenario.

    Attributes:
        robot: whose joints the messages hold. urdf: the description that belongs to them. frame: link that carries the payload.
        payload: the body, or None. world: in its simulator.
        events: (t [s], "pick" | "drop") of all that happened, t of the first message that shows it.
    """

    robot: RobotModel
    world: ArmWorld | QuadrupedWorld | LeggedWorld
    scenario: Scenario

    def __init__(self, scenario: Scenario, urdf: str, frame: str) -> None:
        self.urdf, self.frame = urdf, frame
        self.payload: Payload | None = scenario.payload
        self.events: list[tuple[float, str]] = []
        self._k = 0

    @property
    def t(self) -> float:
        """Time of the next physics step since the start [s]."""
        return self._k / CONTROL_RATE

    @property
    @abstractmethod
    def carries(self) -> bool:
        """True while the payload is tied to its link."""

    def pick(self) -> bool:
        """Tie the payload on now; False where there is none, or it is on already."""
        if self.payload is None or self.carries:
            return False
        self._tie(self.payload)
        self.events.append((self.t, "pick"))
        return True

    def drop(self) -> bool:
        """Let the payload go now; False where none is carried."""
        if not self.carries:
            return False
        self._untie()
        self.events.append((self.t, "drop"))
        return True

    @abstractmethod
    def step(self) -> Message:
        """Simulate until the next message is complete and return it, without noise."""

    @abstractmethod
    def noisy(self, exact: Message) -> Message:
        """The message as the robot's sensors would tell it."""

    @property
    def count(self) -> int:
        """Number of messages of a scenario of finite duration."""
        return round(self.scenario.duration * self.scenario.rate)

    def run(self, progress: Callable[[int], None] | None) -> Iterator[tuple[Message, Message]]:
        """All messages of a scenario of finite duration, each without noise and with it; ``progress``: called with the number of
        new ones now and then."""
        for k in range(self.count):
            exact = self.step()
            yield exact, self.noisy(exact)
            if progress is not None and k % 100 == 99:
                progress(100)

    @abstractmethod
    def _tie(self, payload: Payload) -> None: ...

    @abstractmethod
    def _untie(self) -> None: ...

    def close(self) -> None:
        """Free the world."""
        self.world.close()

    def _truth(self, s: Scenario, start_time: float, **more: Any) -> dict[str, Any]:
        """All that the recording hides, in plain types; times are stamps, ``start_time`` [s] is the first one."""
        return {
            "format": 1,
            "robot": self.robot.name,
            "joint_names": list(self.robot.joint_names),
            "frame": self.frame,
            "start_time": start_time,
            "duration": s.duration if math.isfinite(s.duration) else None,
            "rate": s.rate,
            "seed": s.seed,
            **truth_of_payload(self.payload, self.events, start_time),
            **more,
        }
