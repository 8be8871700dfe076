"""ChannelEffect: a cause that changes what is published rather than the torque."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

from sysid_ros.sample import FloatArray


@dataclass(frozen=True)
class Channels:
    """Positions, velocities and torques of a recording, shape (N, n) each; v is None where none is published."""

    q: FloatArray
    v: FloatArray | None
    tau: FloatArray

    def with_tau(self, tau: FloatArray) -> Channels:
        """The same positions and velocities with other torques."""
        return replace(self, tau=tau)


class ChannelEffect(ABC):
    """A fault between the sensors and the message: it is undone on the recording before anything is fitted.

    Attributes:
        id, label, words, signature, look_alikes, separated_by: as :class:`sysid_ros.effects.effect.Effect` has them.
        scales: True where its parameters are factors on the efforts, which the efforts tell.
        absorbs: id of the effect whose factors belong to this fault's where both were found.
    """

    id: ClassVar[str]
    label: ClassVar[str]
    words: ClassVar[str] = "{label} on {where} ({sizes})"
    signature: ClassVar[str]
    look_alikes: ClassVar[tuple[str, ...]]
    separated_by: ClassVar[str]
    scales: ClassVar[bool] = False
    absorbs: ClassVar[str] = ""

    @property
    def told_as(self) -> str:
        """``words`` of this one, with what it is set to."""
        return self.words

    def publish(self, tau: FloatArray) -> FloatArray:
        """True torques as this fault publishes them, shape (N, n)."""
        return tau

    @classmethod
    def takes(cls, id_: str) -> bool:
        """Whether the factors of an effect that was found beside this fault belong to it."""
        return bool(cls.absorbs) and id_ == cls.absorbs

    @abstractmethod
    def undo(self, channels: Channels) -> Channels:
        """The channels as they would be without the fault."""
