"""JointChoice: which joints of the URDF the stream of joint states is about, where nobody has said so."""

from __future__ import annotations

from collections.abc import Sequence

from sysid_ros.sample import JointStateRecord


class JointChoice:
    """Picks the joints from the first messages: the movable joints that one message names together, as many as there are.

    A message with all movable joints and their efforts decides at once. Else it waits, because a gripper's messages may come
    before the arm's on the same topic.

    Args:
        movable: movable joints of the URDF.
        patience: time from the first message to the decision [s].

    Attributes:
        text: what it waits for.
    """

    def __init__(self, movable: Sequence[str], patience: float = 0.5) -> None:
        self._movable = tuple(movable)
        self._patience = patience
        self._first: float | None = None
        self._best: tuple[str, ...] = ()
        self._best_score = (False, 0)
        self.text = f"Waiting for messages that name joints of the URDF: {', '.join(self._movable)}."

    def offer(self, record: JointStateRecord) -> tuple[str, ...] | None:
        """The joints, in the URDF's order, or None while it is not decided."""
        named = set(record.names)
        joints = tuple(name for name in self._movable if name in named)
        score = (len(record.effort) > 0, len(joints))
        if joints and score > self._best_score:
            self._best, self._best_score = joints, score
        if self._first is None or record.receive_time < self._first:
            self._first = record.receive_time
        if not self._best:
            self.text = (
                f"The messages name {', '.join(record.names) or 'no joint'}; the URDF's movable joints are "
                f"{', '.join(self._movable)}. Check that the URDF is this robot's, and the topic."
            )
            return None
        complete = self._best_score == (True, len(self._movable))
        return self._best if complete or record.receive_time - self._first >= self._patience else None
