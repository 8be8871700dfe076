"""Bags are read as they were written, in every form they come in, and what can't be read says why."""

from __future__ import annotations

import shutil
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer

from sysid_ros.exceptions import BagError, RobotModelError
from sysid_ros.sample import JointStateRecord
from sysid_ros.sources import BagRecorder, BagSource, MemorySource, urdf_text
from sysid_ros.sources.joint_state_cdr import (
    JOINT_STATE,
    JointStateDecoder,
    decode_one,
    decode_string,
    encode,
    encode_names,
    typestore,
)

STORAGES = {"mcap": ".mcap", "sqlite3": ".db3"}
URDF = "<robot name='one'/>"
SHARED = Path(__file__).parents[2] / "shared" / "data"


def some_records(n: int = 1300, joints: int = 3, start: float = 1000.0) -> list[JointStateRecord]:
    values = np.random.default_rng(0).normal(size=(n, 3, joints))
    names = tuple(f"joint_{j}" for j in range(joints))
    return [JointStateRecord(start + k * 0.004, start + k * 0.004 + 0.0005, names, *values[k]) for k in range(n)]


def write(
    path: Path, records: list[JointStateRecord], storage: str = "mcap", topic: str = "/joint_states", urdf: str | None = URDF
) -> Path:
    with BagRecorder(path, storage) as recorder:
        if urdf is not None:
            recorder.write_robot_description(urdf, records[0].receive_time if records else 1.0)
        recorder.write_joint_states(records, topic)
    return path


def assert_same(a: JointStateRecord, b: JointStateRecord, tolerance: float = 0.0) -> None:
    assert a.names == b.names
    assert abs(a.stamp - b.stamp) <= tolerance
    assert abs(a.receive_time - b.receive_time) <= tolerance
    for key in ("position", "velocity", "effort"):
        np.testing.assert_array_equal(np.asarray(getattr(a, key), dtype=float), np.asarray(getattr(b, key), dtype=float))


def assert_read_back(source: BagSource, records: list[JointStateRecord]) -> None:
    read = list(source)
    assert len(read) == len(records) == source.message_count
    for a, b in zip(read, records, strict=True):
        assert_same(a, b, tolerance=1e-6)


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("form", ["folder", "file", "without_metadata"])
def test_round_trip(tmp_path: Path, storage: str, form: str) -> None:
    records = some_records()
    path = write(tmp_path / "bag", records, storage)
    if form == "file":
        path = path / f"bag{STORAGES[storage]}"
    if form == "without_metadata":
        (path / "metadata.yaml").unlink()
    source = BagSource(path)
    assert source.joint_names == ("joint_0", "joint_1", "joint_2")
    assert source.robot_description == URDF
    assert source.duration == pytest.approx(records[-1].receive_time - records[0].receive_time, abs=1e-6)
    assert source.topics == {"/joint_states": (JOINT_STATE, 1300), "/robot_description": ("std_msgs/msg/String", 1)}
    assert source.notes == []
    assert_read_back(source, records)
    assert_read_back(source, records)  # a second time


@pytest.mark.parametrize("storage", STORAGES)
def test_description_is_offered_to_late_nodes(tmp_path: Path, storage: str) -> None:
    with Reader(write(tmp_path / "bag", some_records(3), storage)) as reader:
        offered = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
    assert offered["/robot_description"].durability.name == "TRANSIENT_LOCAL"
    assert offered["/robot_description"].reliability.name == "RELIABLE"
    assert offered["/joint_states"].durability.name == "VOLATILE"


@pytest.mark.parametrize("storage", STORAGES)
def test_odd_messages_survive(tmp_path: Path, storage: str) -> None:
    nan = np.array([np.nan, -np.inf, 5e-324])
    records = [
        JointStateRecord(1.0, 1.0, ("a", "b", "c"), nan, (), nan),
        JointStateRecord(0.0, 2.0, ("c", "b", "a"), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), ()),
        JointStateRecord(3.0, 3.0, ("gelenk_ä",), (1.0,), (), ()),
        JointStateRecord(4.0, 4.0, (), (), (), ()),
        JointStateRecord(5.0, 5.0, ("a", "b"), (1.0,), (2.0, 3.0, 4.0), (5.0,)),
        JointStateRecord(6.0, 6.0, ("c", "b", "a"), (1.0, 2.0, 3.0), (), (4.0, 5.0, 6.0)),
    ]
    source = BagSource(write(tmp_path / "bag", records, storage))
    assert_read_back(source, records)
    assert source.joint_names == ("a", "b", "c", "gelenk_ä")


@pytest.mark.parametrize("storage", STORAGES)
def test_other_messages_can_be_recorded(tmp_path: Path, storage: str) -> None:
    kind = "std_msgs/msg/Float64MultiArray"
    types = typestore().types
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    with BagRecorder(tmp_path / "bag", storage) as recorder:
        recorder.write("/contacts", kind, types[kind](layout=layout, data=np.array([1.0, 0.0])), 1.5)
        recorder.write_joint_states((some_records(1)[0],))
        with pytest.raises(BagError, match="Float64MultiArray"):
            recorder.write_joint_states((some_records(1)[0],), topic="/contacts")
        with pytest.raises(BagError, match="not one of ROS 2"):
            recorder.write("/x", "my_msgs/msg/Thing", None, 1.0)
        with pytest.raises(BagError, match="is no std_msgs"):
            recorder.write("/y", kind, None, 1.0)
    assert BagSource(tmp_path / "bag").topics["/contacts"] == (kind, 1)


def test_recording_left_by_an_exception_is_readable(tmp_path: Path) -> None:
    records = some_records(10)

    def interrupted() -> None:
        with BagRecorder(tmp_path / "bag") as recorder:
            recorder.write_joint_states(records)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert_read_back(BagSource(tmp_path / "bag"), records)


def test_recorder_never_overwrites(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="not overwritten"):
        BagRecorder(tmp_path)
    with pytest.raises(BagError, match="mcap, sqlite3"):
        BagRecorder(tmp_path / "bag", "hdf5")


# One way of decoding or the other gives the same.

floats = st.floats(width=64)
arrays = st.lists(floats, max_size=4)
messages = st.builds(
    JointStateRecord,
    stamp=st.integers(0, 2**31 - 1).map(float),
    receive_time=st.just(0.0),
    names=st.lists(st.sampled_from(["a", "bb", "ccc", "dddd", "ä", ""]), max_size=4).map(tuple),
    position=arrays,
    velocity=arrays,
    effort=arrays,
)


def big_endian(record: JointStateRecord) -> bytes:
    types = typestore().types
    stamp = types["builtin_interfaces/msg/Time"](sec=int(record.stamp), nanosec=0)
    message = types[JOINT_STATE](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="world"),
        name=list(record.names),
        position=np.array(record.position, dtype=float),
        velocity=np.array(record.velocity, dtype=float),
        effort=np.array(record.effort, dtype=float),
    )
    return bytes(typestore().serialize_cdr(message, JOINT_STATE, little_endian=False))


@settings(deadline=None, max_examples=80)
@given(st.lists(st.tuples(messages, st.sampled_from(["plain", "framed", "big"]), st.integers(1, 3)), min_size=1, max_size=12))
def test_decoding_in_bulk_is_decoding_one_by_one(drawn: list[tuple[JointStateRecord, str, int]]) -> None:
    raw: list[bytes] = []
    for record, how, repeats in drawn:
        if how == "big":
            data = big_endian(record)
        else:
            data = encode(record, encode_names(record.names, "base" if how == "framed" else ""))
        raw += [data] * repeats
    times = [float(k) for k in range(len(raw))]
    decoder = JointStateDecoder()
    for _ in range(2):  # the second time every layout is known
        for record, data, time in zip(decoder.decode(raw, times), raw, times, strict=True):
            assert_same(record, decode_one(data, time))
    assert decoder.failures == 0


@settings(deadline=None, max_examples=50)
@given(messages)
def test_encoding_is_what_rosbags_encodes(record: JointStateRecord) -> None:
    assert_same(decode_one(encode(record, encode_names(record.names)), record.receive_time), record)


def test_same_length_with_other_counts_is_told_apart() -> None:
    six, names = (1.0, 2.0), ("a", "b")
    a = JointStateRecord(1.0, 0.0, names, six, six, ())
    b = JointStateRecord(1.0, 0.0, names, six, (), six)
    raw = [encode(r, encode_names(names)) for r in (a, b, a, b)]
    assert len({len(x) for x in raw}) <= 2
    for record, expected in zip(JointStateDecoder().decode(raw, [0.0] * 4), (a, b, a, b), strict=True):
        assert_same(record, expected)


def test_messages_that_can_not_be_decoded_are_left_out_and_told(tmp_path: Path) -> None:
    records = some_records(50)
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/joint_states", JOINT_STATE, typestore=typestore())
        for k, record in enumerate(records):
            data = encode(record, encode_names(record.names))
            writer.write(connection, k, data[:37] if k % 10 == 5 else data)
    source = BagSource(tmp_path / "bag")
    assert len(list(source)) == 45
    assert "5 of 50 messages can't be decoded" in source.notes[0]


# Forms of bags.


def test_split_bag_without_metadata_is_read_in_order(tmp_path: Path) -> None:
    records = some_records(110)
    folder = tmp_path / "split"
    folder.mkdir()
    for k in range(11):
        write(tmp_path / f"part_{k}", records[10 * k : 10 * k + 10], urdf=URDF if k == 0 else None)
        shutil.copy(tmp_path / f"part_{k}" / f"part_{k}.mcap", folder / f"split_{k}.mcap")
    source = BagSource(folder)
    assert_read_back(source, records)
    assert source.robot_description == URDF


@pytest.mark.parametrize("mode", [CompressionMode.MESSAGE, CompressionMode.FILE])
def test_compressed_bags(tmp_path: Path, mode: CompressionMode) -> None:
    records = some_records(30)
    writer = Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/joint_states", JOINT_STATE, typestore=typestore())
        for record in records:
            writer.write(connection, round(record.receive_time * 1e9), encode(record, encode_names(record.names)))
    assert_read_back(BagSource(tmp_path / "bag"), records)
    (tmp_path / "bag" / "metadata.yaml").unlink()
    with pytest.raises(BagError, match=r"compressed and the metadata\.yaml|no \.mcap or \.db3 file"):
        BagSource(tmp_path / "bag")


def test_useless_metadata_is_passed_over(tmp_path: Path) -> None:
    path = write(tmp_path / "bag", some_records(20))
    (path / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    source = BagSource(path)
    assert_read_back(source, some_records(20))
    assert "metadata.yaml" in source.notes[0]


def test_other_topic_is_used_when_it_is_the_only_one(tmp_path: Path) -> None:
    path = write(tmp_path / "bag", some_records(20), topic="/arm/joint_states")
    source = BagSource(path)
    assert source.topic == "/arm/joint_states"
    assert "/arm/joint_states" in source.notes[0]
    assert BagSource(path, "arm/joint_states").notes == []


@pytest.mark.parametrize(
    ("topic", "words"),
    [
        ("/joint_states", ["/joint_states", "/left/joint_states (20 messages)", "/right/joint_states (20 messages)", "--topic"]),
        ("/nowhere", ["/nowhere", "/left/joint_states"]),
        ("/robot_description", ["std_msgs/msg/String", "sensor_msgs/msg/JointState", "/right/joint_states"]),
    ],
)
def test_topics_that_can_not_be_read(tmp_path: Path, topic: str, words: list[str]) -> None:
    with BagRecorder(tmp_path / "bag") as recorder:
        recorder.write_robot_description(URDF, 1.0)
        recorder.write_joint_states(some_records(20), "/left/joint_states")
        recorder.write_joint_states(some_records(20), "/right/joint_states")
    with pytest.raises(BagError) as error:
        BagSource(tmp_path / "bag", topic)
    assert all(word in str(error.value) for word in words), error.value


def test_bag_without_joint_states(tmp_path: Path) -> None:
    with BagRecorder(tmp_path / "bag") as recorder:
        recorder.write_robot_description(URDF, 1.0)
    with pytest.raises(BagError, match=r"no topic /joint_states.*robot_description \(std_msgs/msg/String\)"):
        BagSource(tmp_path / "bag")


@pytest.mark.parametrize("storage", STORAGES)
def test_empty_bags(tmp_path: Path, storage: str) -> None:
    with BagRecorder(tmp_path / "empty", storage):
        pass
    with pytest.raises(BagError, match="holds no message"):
        BagSource(tmp_path / "empty")
    with BagRecorder(tmp_path / "silent", storage) as recorder:
        recorder.write_robot_description(URDF, 1.0)
        recorder.write_joint_states([])
    with pytest.raises(BagError, match="has no message"):
        BagSource(tmp_path / "silent")


def missing(path: Path) -> Path:
    return path / "nothing_here"


def empty_folder(path: Path) -> Path:
    (path / "folder").mkdir()
    return path / "folder"


def folder_of_other_files(path: Path) -> Path:
    (path / "notes.txt").write_text("x")
    return path


def text_file(path: Path) -> Path:
    (path / "notes.txt").write_text("x")
    return path / "notes.txt"


def empty_file(path: Path) -> Path:
    (path / "bag.mcap").touch()
    return path / "bag.mcap"


def text_as_mcap(path: Path) -> Path:
    (path / "bag.mcap").write_text("this is no bag " * 100)
    return path / "bag.mcap"


def text_as_db3(path: Path) -> Path:
    (path / "bag.db3").write_text("this is no bag " * 100)
    return path / "bag.db3"


def ros1(path: Path) -> Path:
    (path / "old.bag").write_text("#ROSBAG V2.0\n")
    return path / "old.bag"


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (missing, "does not exist"),
        (empty_folder, "holds nothing"),
        (folder_of_other_files, "notes.txt"),
        (text_file, "'.txt'"),
        (empty_file, "empty file"),
        (text_as_mcap, "can't be read as a bag"),
        (text_as_db3, "can't be read as a bag"),
        (ros1, "rosbags-convert"),
    ],
)
def test_what_is_no_bag(tmp_path: Path, make: Callable[[Path], Path], word: str) -> None:
    path = make(tmp_path)
    with pytest.raises(BagError) as error:
        BagSource(path)
    assert word in str(error.value)
    assert str(path) in str(error.value)


@pytest.mark.parametrize("form", ["folder", "file"])
@pytest.mark.parametrize("kept", [0.97, 0.6, 0.2])
def test_cut_mcap_is_read_up_to_the_cut(tmp_path: Path, kept: float, form: str) -> None:
    records = some_records(8000)
    folder = write(tmp_path / "bag", records)
    file = folder / "bag.mcap"
    content = file.read_bytes()
    data_end = content.rindex(encode(records[-1], encode_names(records[-1].names))[40:])
    file.write_bytes(content[: int(kept * data_end)])
    source = BagSource(folder if form == "folder" else file)
    read = list(source)
    assert 0.9 * kept < len(read) / len(records) < 1.1 * kept
    for a, b in zip(read, records, strict=False):
        assert_same(a, b, tolerance=1e-6)
    assert any("cut off" in note for note in source.notes)
    assert source.robot_description == URDF


@pytest.mark.parametrize("storage", STORAGES)
def test_cut_anywhere_is_an_error_or_a_note(tmp_path: Path, storage: str) -> None:
    records = some_records(400)
    folder = write(tmp_path / "bag", records, storage)
    file = folder / f"bag{STORAGES[storage]}"
    content = file.read_bytes()
    for cut in np.linspace(1, len(content) - 1, 25).astype(int):
        file.write_bytes(content[:cut])
        try:
            source = BagSource(file)
            read = list(source)
        except BagError:
            continue
        assert source.notes != []
        for a, b in zip(read, records, strict=False):
            assert_same(a, b, tolerance=1e-6)


@pytest.mark.parametrize("form", ["folder", "file"])
def test_cut_database_is_refused(tmp_path: Path, form: str) -> None:
    folder = write(tmp_path / "bag", some_records(400), "sqlite3")
    file = folder / "bag.db3"
    file.write_bytes(file.read_bytes()[:-3000])
    with pytest.raises(BagError, match=r"\.recover"):
        BagSource(folder if form == "folder" else file)


def test_messages_outside_of_a_database_are_told(tmp_path: Path) -> None:
    folder = write(tmp_path / "bag", some_records(4), "sqlite3")
    (folder / "bag.db3-wal").write_bytes(b"pages")
    assert "bag.db3-wal" in BagSource(folder).notes[0]
    assert "bag.db3-wal" in BagSource(folder / "bag.db3").notes[0]


@pytest.mark.parametrize("storage", STORAGES)
def test_overwritten_bytes_never_raise_anything_else(tmp_path: Path, storage: str) -> None:
    rng = np.random.default_rng(0)
    folder = write(tmp_path / "bag", some_records(300), storage)
    file = folder / f"bag{STORAGES[storage]}"
    content = file.read_bytes()
    for _ in range(20):
        damaged = bytearray(content)
        at = int(rng.integers(len(content) - 64))
        damaged[at : at + 64] = rng.bytes(64)
        file.write_bytes(bytes(damaged))
        for path in (folder, file):
            with suppress(BagError):
                list(BagSource(path))


# What is not a bag.


def test_memory_source() -> None:
    records = some_records(5)
    source = MemorySource(iter(records), URDF)
    assert list(source) == list(source) == records
    assert source.joint_names == ("joint_0", "joint_1", "joint_2")
    assert source.message_count == 5
    assert source.duration == pytest.approx(0.016)
    assert MemorySource([]).duration == 0.0


def test_urdf_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sysid_ros.robot.xacro_file._command", list)
    file = tmp_path / "arm.urdf"
    file.write_text("<robot name='file'/>")
    assert urdf_text(file, MemorySource([], URDF)) == "<robot name='file'/>"
    assert urdf_text(None, MemorySource([], URDF)) == URDF
    assert urdf_text("", MemorySource([], URDF)) == URDF
    (tmp_path / "arm.xacro").write_text("<robot xmlns:xacro='x'/>")
    (tmp_path / "binary.urdf").write_bytes(struct.pack("<d", -1.3) * 9)
    for path, source, word in (
        (None, None, "--urdf"),
        (None, MemorySource([]), "/robot_description"),
        (tmp_path / "none.urdf", None, "does not exist"),
        (tmp_path, None, "folder"),
        (tmp_path / "arm.xacro", None, r"xacro is not installed: pip install .*expand it"),
        (f"{file} side:=left", None, "no xacro file"),
        (tmp_path / "binary.urdf", None, "not text in UTF-8"),
    ):
        with pytest.raises(RobotModelError, match=word):
            urdf_text(path, source)


@pytest.mark.parametrize(
    ("bag", "count", "duration"),
    [
        ("ur10e/fast20_load", 2089, 22.276),
        ("ur10e/fast20_load/fast20_load.mcap", 2089, 22.276),
        ("unisa_ur10/ur10_exciting_trajectory.db3", 3441, 27.52),
        ("staubli_tx40/excitation", 9000, 8.999),
    ],
)
def test_real_bags(bag: str, count: int, duration: float) -> None:
    if not (SHARED / bag).exists():
        pytest.skip(f"{SHARED / bag} is not here")
    source = BagSource(SHARED / bag)
    records = list(source)
    assert len(records) == source.message_count == count
    assert source.duration == pytest.approx(duration, abs=1e-3)
    assert len(source.joint_names) == 6
    assert source.robot_description is None
    with Reader(SHARED / bag) as reader:
        for (_, time, data), record in list(zip(reader.messages(), records, strict=True))[::50]:
            assert_same(decode_one(data, time * 1e-9), record)


@pytest.mark.parametrize("storage", STORAGES)
def test_iterations_do_not_disturb_each_other(tmp_path: Path, storage: str) -> None:
    """Also where one begins while another is under way, or is left half-way."""
    records = some_records(1300)
    source = BagSource(write(tmp_path / "bag", records, storage))
    next(iter(source))
    for pair, record in zip(zip(source, source, strict=True), records, strict=True):
        for read in pair:
            assert_same(read, record, tolerance=1e-6)
    assert source.robot_description == URDF


@settings(deadline=None, max_examples=50)
@given(st.text(), st.booleans())
def test_strings_are_decoded_as_rosbags_encodes_them(text: str, little_endian: bool) -> None:
    text = text.replace("\x00", "").encode(errors="ignore").decode()
    message = typestore().types["std_msgs/msg/String"](data=text)
    data = bytes(typestore().serialize_cdr(message, "std_msgs/msg/String", little_endian=little_endian))
    assert decode_string(data) == text
    with pytest.raises(ValueError, match="bytes that are not a std_msgs"):
        decode_string(data[:6])


@settings(deadline=None, max_examples=120)
@given(messages, st.integers(0, 10_000), st.integers(0, 2**32 - 1))
def test_damaged_messages_are_left_out_or_read_alike(record: JointStateRecord, place: int, number: int) -> None:
    """A wrong length in a message must not cost memory, nor be believed where rosbags does not."""
    data = bytearray(encode(record, encode_names(record.names)))
    struct.pack_into("<I", data, 12 + 4 * (place % ((len(data) - 12) // 4)), number)
    decoder = JointStateDecoder()
    decoded = decoder.decode([bytes(data)], [0.0])
    try:
        expected = decode_one(bytes(data), 0.0)
    except ValueError:
        assert decoder.failures == 1
        assert decoded == []
        return
    for other in decoded:
        assert_same(other, expected)
    assert len(decoded) == 1
