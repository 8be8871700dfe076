"""BagRecorder: writes a rosbag2 folder that rosbag2 itself can play."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer

from sysid_ros.exceptions import BagError
from sysid_ros.sample import ContactRecord, ImuRecord, JointStateRecord
from sysid_ros.sources.joint_state_cdr import JOINT_STATE, encode, encode_names, typestore

IMU = "sensor_msgs/msg/Imu"
CONTACTS = "std_msgs/msg/Float32MultiArray"
_STORAGES = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}


def quality_of_service(depth: int = 10, latched: bool = False) -> Qos:
    """What a player offers: reliable and volatile as controllers do, or transient local for what a late node must still get."""
    forever = QosTime(2147483647, 4294967295)
    return Qos(
        QosHistory.KEEP_LAST,
        depth,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        forever,
        forever,
        QosLiveliness.AUTOMATIC,
        forever,
        False,
    )


class BagRecorder:
    """A new bag, written within ``with``. What was written stays readable when the block is left by an exception.

    Args:
        path: the folder to create. storage: "mcap" or "sqlite3".

    Raises:
        BagError: the folder exists already or can't be created, the storage is unknown, or a message does not fit its type.
    """

    def __init__(self, path: str | Path, storage: str = "mcap") -> None:
        self.path = Path(path)
        if storage not in _STORAGES:
            raise BagError(f"storage '{storage}' of a bag is not known; it must be one of {', '.join(_STORAGES)}.")
        if self.path.exists():
            raise BagError(f"'{self.path}' exists already and is not overwritten. Choose another name, or remove it first.")
        self._writer = Writer(self.path, version=9, storage_plugin=_STORAGES[storage])
        self._connections: dict[str, Any] = {}
        self._prefixes: dict[tuple[str, ...], bytes] = {}

    def __enter__(self) -> BagRecorder:
        try:
            self._writer.open()
        except Exception as error:
            raise BagError(f"bag '{self.path}' can't be created: {error}. Choose a folder that can be written to.") from error
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with self._told():
            self._writer.close()

    def write_joint_states(self, records: Iterable[JointStateRecord], topic: str = "/joint_states") -> None:
        """Many records at once, at their receive times."""
        connection = self._connection(topic, JOINT_STATE, quality_of_service())
        write = self._writer.write
        prefixes = self._prefixes
        with self._told():
            for record in records:
                if (prefix := prefixes.get(record.names)) is None:
                    prefix = prefixes[record.names] = encode_names(record.names)
                write(connection, round(record.receive_time * 1e9), encode(record, prefix))

    def write_imu(self, record: ImuRecord, topic: str = "/imu") -> None:
        """One ``sensor_msgs/Imu``, at its receive time; covariances are marked as unknown where they are 0."""
        kinds = typestore().types
        vector, nothing = kinds["geometry_msgs/msg/Vector3"], np.zeros(9)
        sec, nanosec = divmod(round(record.stamp * 1e9), 10**9)
        message = kinds[IMU](
            header=kinds["std_msgs/msg/Header"](
                stamp=kinds["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec), frame_id=record.frame_id
            ),
            orientation=kinds["geometry_msgs/msg/Quaternion"](*map(float, record.orientation)),
            orientation_covariance=nothing,
            angular_velocity=vector(*map(float, record.omega)),
            angular_velocity_covariance=nothing,
            linear_acceleration=vector(*map(float, record.specific_force)),
            linear_acceleration_covariance=nothing,
        )
        self.write(topic, IMU, message, record.receive_time)

    def write_contacts(self, record: ContactRecord, topic: str = "/contacts") -> None:
        """One ``std_msgs/Float32MultiArray`` of foot contacts, at its receive time."""
        kinds = typestore().types
        values = np.asarray(record.values, dtype=np.float32)
        dimension = kinds["std_msgs/msg/MultiArrayDimension"](label="foot", size=values.size, stride=values.size)
        layout = kinds["std_msgs/msg/MultiArrayLayout"](dim=[dimension], data_offset=0)
        self.write(topic, CONTACTS, kinds[CONTACTS](layout=layout, data=values), record.receive_time)

    def write_robot_description(self, urdf: str, receive_time: float, topic: str = "/robot_description") -> None:
        """The URDF's text, so that who plays the bag offers it to nodes that start later."""
        message = typestore().types["std_msgs/msg/String"](data=urdf)
        self.write(topic, "std_msgs/msg/String", message, receive_time, quality_of_service(depth=1, latched=True))

    def write(self, topic: str, kind: str, message: Any, receive_time: float, qos: Qos | None = None) -> None:
        """Any message: ``kind`` is a type such as "sensor_msgs/msg/Imu", ``message`` has its fields, ``receive_time`` is [s]."""
        connection = self._connection(topic, kind, qos or quality_of_service())
        try:
            data = typestore().serialize_cdr(message, kind)
        except Exception as error:
            raise BagError(f"a message for {topic} is no {kind}: {error}. Give every field its type and length.") from error
        with self._told():
            self._writer.write(connection, round(receive_time * 1e9), data)

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            reason = getattr(error, "strerror", None) or error
            raise BagError(f"bag '{self.path}' can't be written: {reason}. Make room, or write to another disk.") from error

    def _connection(self, topic: str, kind: str, qos: Qos) -> Any:
        connection = self._connections.get(topic)
        if connection is None:
            if kind not in typestore().types:
                raise BagError(f"message type '{kind}' of topic {topic} is not one of ROS 2's own. Write it as package/msg/Name.")
            connection = self._writer.add_connection(topic, kind, typestore=typestore(), offered_qos_profiles=[qos])
            self._connections[topic] = connection
        if connection.msgtype != kind:
            raise BagError(f"topic {topic} carries {connection.msgtype}; a {kind} can't be written to it. Use another topic.")
        return connection
