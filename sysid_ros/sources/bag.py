"""BagSource: joint states from a rosbag2 recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, Self

from sysid_ros.exceptions import BagError
from sysid_ros.robot.joint_choice import kinds_of
from sysid_ros.sample import JointStateRecord
from sysid_ros.sources.bag_files import BagFiles
from sysid_ros.sources.joint_messages import Decoder, decoder_of, holds_joints
from sysid_ros.sources.joint_state_cdr import JOINT_STATE, STRING, decode_string, typestore

DEFAULT_TOPIC = "/joint_states"
_BATCH = 512  # messages decoded at once
_LOOK_AHEAD = 200  # messages whose joint names are known before the bag is read


class BagSource:
    """The joint states of one topic of a bag, in the order of recording. It can be iterated again.

    The topic carries ``sensor_msgs/JointState``, or another type that one of :data:`.joint_messages.DECODERS` reads.

    Args:
        path: a rosbag2 folder, an .mcap file or a .db3 file, with or without metadata.yaml.
        topic: where the joint states are. When the default is not in the bag and there is exactly one other topic of joint
            states, that one is used, and a note says so; one of another type, where there is none of JointState.

    Attributes:
        topic: the topic that is read, of the type ``kind``. names_joints: whether its messages name the joints.
        topics: (type, number of messages) of every topic in the bag.
        message_count: messages on the topic. duration: of the bag [s].
        kinds: of the first messages, by the joints that they name.
        notes: what the user should know of how the bag is read, one sentence each; reading may add to it.

    Raises:
        BagError: the bag can't be read, is empty, or has no joint states on the topic; also while iterating, where it is damaged.
    """

    def __init__(self, path: str | Path, topic: str = DEFAULT_TOPIC) -> None:
        self.path = Path(path)
        self._files = BagFiles(self.path)
        self.notes: list[str] = self._files.notes
        self._names: dict[tuple[str, ...], None] = {}
        self._new_names: dict[str, str] = {}
        self._robot_description: str | None = None
        self._looked_for_description = False
        self._read_index()
        self.topic = self._choose(topic if topic.startswith("/") else f"/{topic}")
        self.kind, self.message_count = self.topics[self.topic]
        self.names_joints = True
        first = list(islice(self, _LOOK_AHEAD))
        if not first and self._files.use_files_of_folder():
            # The metadata.yaml and the file disagree on the topic's settings, so rosbags finds no message of it.
            self._read_index()
            first = list(islice(self, _LOOK_AHEAD))
        if not first:
            raise BagError(f"bag '{self.path}': topic {self.topic} has no message that can be read. Record it again.")
        self.kinds = kinds_of(first)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints that messages have named so far, in the order in which they came up."""
        return tuple(dict.fromkeys(self._new_names.get(name, name) for names in self._names for name in names))

    def renamed(self, names: Mapping[str, str]) -> Self:
        """The same bag with other names for some joints, by the names that the messages have."""
        other = copy(self)
        other._new_names = dict(names)
        pairs = ", ".join(f"{old} is {new}" for old, new in names.items())
        other.notes = [*self.notes, f"Joints of the messages are taken for the URDF's: {pairs}."]
        return other

    @property
    def robot_description(self) -> str | None:
        """The URDF on /robot_description (or the only topic of that name in a namespace), None where there is none."""
        if not self._looked_for_description:
            self._robot_description = self._read_robot_description()
            self._looked_for_description = True
        return self._robot_description

    def __iter__(self) -> Iterator[JointStateRecord]:
        with self._files.opened() as readers:
            for reader in readers:
                connections = [c for c in reader.connections if c.topic == self.topic and c.msgtype == self.kind]
                if connections:
                    yield from self._with_new_names(self._records(reader, connections))

    def _with_new_names(self, records: Iterator[JointStateRecord]) -> Iterator[JointStateRecord]:
        if not self._new_names:
            yield from records
            return
        known: dict[tuple[str, ...], tuple[str, ...]] = {}
        for record in records:
            if (names := known.get(record.names)) is None:
                names = known[record.names] = tuple(self._new_names.get(name, name) for name in record.names)
            yield replace(record, names=names)

    def raw_messages(self, topic: str) -> Iterator[tuple[int, bytes, str]]:
        """Receive time [ns], content and type of each message of any topic, in the order of recording."""
        with self._files.opened() as readers:
            for reader in readers:
                connections = [c for c in reader.connections if c.topic == topic]
                for connection, nanoseconds, data in self._files.messages(reader, connections) if connections else ():
                    yield nanoseconds, data, connection.msgtype

    def definition(self, topic: str) -> Any:
        """What the bag says of the type of a topic: rosbags' ``MessageDefinition`` with its format and text."""
        return self._definitions[topic]

    def _records(self, reader: Any, connections: list[Any]) -> Iterator[JointStateRecord]:
        messages = self._files.messages(reader, connections)
        decoder = self._decoder(connections[0])
        read, damage = 0, None
        while damage is None:
            raw: list[bytes] = []
            times: list[float] = []
            try:
                for _, nanoseconds, data in islice(messages, _BATCH):
                    raw.append(data)
                    times.append(nanoseconds * 1e-9)
            except BagError as error:
                damage = error
            if not raw:
                break
            read += len(raw)
            names: tuple[str, ...] | None = None
            records = decoder.decode(raw, times)
            for sentence in decoder.notes:
                self._note(f"Topic {self.topic}: {sentence}")
            for record in records:
                if record.names is not names:
                    names = record.names
                    self._names.setdefault(names)
                yield record
            if decoder.failures == read:
                raise BagError(
                    f"bag '{self.path}', topic {self.topic}: no message can be decoded: {decoder.last_failure}. "
                    "The bag is damaged, or its messages are compressed and the metadata.yaml that says so is missing."
                )
        if damage is not None:
            if read == 0:
                raise damage
            self._note(f"Only the first {read} messages of '{reader.path}' are read: {damage}")
        if decoder.failures:
            self._note(f"{decoder.failures} of {read} messages can't be decoded and are left out: {decoder.last_failure}.")

    def _decoder(self, connection: Any) -> Decoder:
        try:
            decoder = decoder_of(self.kind, connection.msgdef)
        except BagError as error:
            raise BagError(f"bag '{self.path}', topic {self.topic}: {error}") from error.__cause__
        self.names_joints = decoder.names_joints
        return decoder

    def _note(self, sentence: str) -> None:
        if sentence not in self.notes:
            self.notes.append(sentence)

    def _read_index(self) -> None:
        self.topics: dict[str, tuple[str, int]] = {}
        self._definitions: dict[str, Any] = {}
        starts, ends = [], []
        with self._files.opened() as readers:
            for reader in readers:
                for c in reader.connections:
                    self._definitions[c.topic] = c.msgdef
                    self.topics[c.topic] = (c.msgtype, c.msgcount + self.topics.get(c.topic, ("", 0))[1])
                if reader.message_count:
                    starts.append(reader.start_time)
                    ends.append(reader.end_time - 1)
        if not starts:
            raise BagError(
                f"bag '{self.path}' holds no message. Record it again: ros2 bag record {DEFAULT_TOPIC} /robot_description"
            )
        self.duration: float = (max(ends) - min(starts)) * 1e-9

    def _choose(self, topic: str) -> str:
        candidates = {name: count for name, (kind, count) in self.topics.items() if holds_joints(kind, self._definitions[name])}
        plain = [name for name in candidates if self.topics[name][0] == JOINT_STATE]
        listed = ", ".join(f"{name} ({count} messages)" for name, count in candidates.items())
        cure = (
            f"Choose one with --topic: {listed}."
            if candidates
            else f"No topic of it carries {JOINT_STATE}; it has {self._listed_topics()}.{self._undefined()}"
        )
        if topic not in self.topics:
            if topic == DEFAULT_TOPIC and len(plain or candidates) == 1:
                (only,) = plain or candidates
                self.notes.append(f"Bag '{self.path}' has no topic {topic}; its only topic of joint states, {only}, is used.")
                topic = only
            else:
                raise BagError(f"bag '{self.path}' has no topic {topic}. {cure}")
        kind, count = self.topics[topic]
        if topic not in candidates:
            raise BagError(f"bag '{self.path}': topic {topic} carries {kind}; it must be {JOINT_STATE}. {cure}")
        if count == 0:
            raise BagError(
                f"bag '{self.path}': topic {topic} has no message. The robot's driver was silent while it was recorded. {cure}"
            )
        return topic

    def _listed_topics(self) -> str:
        return ", ".join(f"{name} ({kind})" for name, (kind, _) in sorted(self.topics.items())) or "no topic"

    def _undefined(self) -> str:
        """Which types can't be looked into, because the bag does not define them."""
        known = typestore().types
        kinds = {kind for name, (kind, _) in self.topics.items() if not self._definitions[name].data and kind not in known}
        return f" It does not define {', '.join(sorted(kinds))}; an mcap bag would." if kinds else ""

    def _read_robot_description(self) -> str | None:
        named = [name for name, (kind, _) in self.topics.items() if kind == STRING and name.endswith("/robot_description")]
        if not named or (len(named) > 1 and "/robot_description" not in named):
            return None
        topic = "/robot_description" if "/robot_description" in named else named[0]
        with self._files.opened() as readers:
            for reader in readers:
                connections = [c for c in reader.connections if c.topic == topic and c.msgtype == STRING]
                for _, _, data in self._files.messages(reader, connections) if connections else ():
                    try:
                        text = decode_string(data)
                    except ValueError as error:
                        raise BagError(
                            f"bag '{self.path}': {topic} can't be decoded: {error}. Give the URDF with --urdf."
                        ) from error
                    if text.strip():
                        return text
        return None
