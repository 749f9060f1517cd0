"""Logs that other libraries write: the same samples whatever the format."""

import datetime
import json

import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from google.protobuf import descriptor_pb2, wrappers_pb2
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat
from typed import typed

from twin.measured.log import LogFormat, read_measured_log
from twin.measured.look import look

TIME = np.arange(0, 10, 0.02)
PULL_MM = 3 * np.sin(TIME)
BEND_DEG = 25 * np.sin(TIME - 0.3)
NANOSECONDS = 1_700_000_000_000_000_000 + np.round(TIME * 1e9).astype(np.int64)
COLUMNS = LogFormat(command_column="pull_mm", angle_column="angle_deg")
TOPICS = LogFormat(
    command_column="/cmd.data", command_unit="mm", angle_column="/joint.position[1]", angle_unit="deg"
)


def arrays():
    return {"time_s": TIME, "pull_mm": PULL_MM, "angle_deg": BEND_DEG}


def write_npz(path):
    np.savez_compressed(path, **arrays(), settings=np.arange(3))


def write_mat(path):
    savemat(path, {"log": arrays(), "fs": 50.0})


def write_parquet(path):
    pq.write_table(pa.table(arrays() | {"note": ["x"] * len(TIME)}), path)


def write_excel(path):
    book = openpyxl.Workbook()
    begin = datetime.datetime(2026, 5, 1, 12)
    book.active.append(["Bench 3"])
    book.active.append(["when", "pull_mm", "angle_deg"])
    for time, pull, bend in zip(TIME, PULL_MM, BEND_DEG, strict=True):
        book.active.append([(begin + datetime.timedelta(seconds=float(time))).isoformat(), pull, bend])
    book.save(path)


def write_ros(writer, store, serialize, path, **options):
    types = store.types
    number, joint = types["std_msgs/msg/Float64"], types["sensor_msgs/msg/JointState"]
    stamp = types["builtin_interfaces/msg/Time"](1_700_000_000, 0)
    more = {"seq": 0} if "seq" in types["std_msgs/msg/Header"].__dataclass_fields__ else {}
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="odd", **more)
    with writer(path, **options) as bag:
        command = bag.add_connection("/cmd", number.__msgtype__, typestore=store)
        angle = bag.add_connection("/joint", joint.__msgtype__, typestore=store)
        none = np.empty(0)
        for time, pull, bend in zip(NANOSECONDS.tolist(), PULL_MM, BEND_DEG, strict=True):
            bag.write(command, time, serialize(store, number(float(pull)), number.__msgtype__))
            state = joint(header, ["a", "tip"], np.array([0.0, bend]), none, none)
            bag.write(angle, time, serialize(store, state, joint.__msgtype__))


def write_ros1(path):
    store = get_typestore(Stores.ROS1_NOETIC)
    write_ros(Ros1Writer, store, lambda of, message, kind: of.serialize_ros1(message, kind), path)


def write_ros2(path, storage):
    def serialize(store, message, kind):
        return store.serialize_cdr(message, kind)

    options = {"version": 9, "storage_plugin": storage}
    write_ros(Ros2Writer, get_typestore(Stores.ROS2_HUMBLE), serialize, path, **options)


def write_sqlite(path):
    write_ros2(path, StoragePlugin.SQLITE3)


def write_ros2_mcap(path):
    write_ros2(path, StoragePlugin.MCAP)


def write_mcap(path, compression=CompressionType.LZ4):
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, chunk_size=2000)
        writer.start()
        schema = writer.register_schema("joint", "jsonschema", b"{}")
        joint = writer.register_channel("/joint", "json", schema)
        files = descriptor_pb2.FileDescriptorSet()
        wrappers_pb2.DESCRIPTOR.CopyToProto(files.file.add())
        schema = writer.register_schema("google.protobuf.DoubleValue", "protobuf", files.SerializeToString())
        command = writer.register_channel("/cmd", "protobuf", schema)
        for time, pull, bend in zip(NANOSECONDS.tolist(), PULL_MM, BEND_DEG, strict=True):
            value = wrappers_pb2.DoubleValue(value=pull).SerializeToString()
            writer.add_message(command, time, value, time)
            writer.add_message(joint, time, json.dumps({"position": [0, bend]}).encode(), time)
        writer.finish()


def in_struct(form):
    return LogFormat("log.pull_mm", angle_column="log.angle_deg", time_column="log.time_s")


CASES = {
    "log.npz": (write_npz, COLUMNS),
    "log.mat": (write_mat, in_struct(COLUMNS)),
    "log.parquet": (write_parquet, COLUMNS),
    "log.xlsx": (write_excel, LogFormat("pull_mm", angle_column="angle_deg", time_column="when")),
    "log.bag": (write_ros1, TOPICS),
    "sqlite": (write_sqlite, TOPICS),
    "folder": (write_ros2_mcap, TOPICS),
    "log.mcap": (
        write_mcap,
        LogFormat("/cmd.value", "mm", angle_column="/joint.position[1]", angle_unit="deg"),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_samples_are_those_that_another_library_wrote(name, tmp_path):
    write, form = CASES[name]
    write(tmp_path / name)
    log = read_measured_log(tmp_path / name, form)
    np.testing.assert_allclose(log.time, TIME, atol=1e-6 if name == "log.xlsx" else 1e-9)
    np.testing.assert_allclose(log.pull_mm, PULL_MM, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(log.truth_deg, BEND_DEG, rtol=1e-12, atol=1e-12)
    assert log.metadata["name"] == name.split(".")[0]


@pytest.mark.parametrize("name", ["sqlite", "folder"])
def test_the_file_of_a_bag_is_read_alone(name, tmp_path):
    write, form = CASES[name]
    write(tmp_path / name)
    (file,) = [*(tmp_path / name).glob("*.db3"), *(tmp_path / name).glob("*.mcap")]
    np.testing.assert_allclose(read_measured_log(file, form).truth_deg, BEND_DEG)


@pytest.mark.parametrize("name", CASES)
def test_a_damaged_file_is_one_line(name, tmp_path):
    write, form = CASES[name]
    write(tmp_path / name)
    path = tmp_path / name
    if path.is_dir():
        (path,) = [*path.glob("*.db3"), *path.glob("*.mcap")]
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    for kept in (0, 10, len(whole) // 2, len(whole)):
        damaged = bytearray(whole[:kept])
        for place in rng.integers(0, max(kept, 1), 30 if kept == len(whole) else 0):
            damaged[place] ^= 0x5A
        path.write_bytes(damaged)
        try:
            log = read_measured_log(path, form)
        except ValueError as error:
            fault = str(error)
            assert (fault.count("\n"), path.name in fault) == (0, True), fault
        else:
            assert np.isfinite(log.pull).all()


def test_objects_in_npz_are_refused_and_never_loaded(tmp_path):
    np.savez(tmp_path / "log.npz", pull_mm=np.array([{}, {}], dtype=object))
    with pytest.raises(ValueError, match=r"log.npz cannot be read: Object arrays cannot be loaded"):
        read_measured_log(tmp_path / "log.npz", COLUMNS)


def test_look_shows_the_fields_of_topics_and_the_command_by_topics_imports(tmp_path):
    write_ros1(tmp_path / "log.bag")
    guess = look(tmp_path / "log.bag")
    assert guess.roles["time"] == "time_s"
    assert guess.roles["command"] == "/cmd.data"
    assert "/joint.position[1]" in guess.table.columns
    line = "import log.bag --command-topic /cmd.data --command-unit mm --angle-topic /joint.position[1]"
    code, out, said = typed(f"{line} --angle-unit deg --out data", tmp_path)
    assert code == 0, said
    assert "500 samples" in out


def test_a_field_that_is_not_there_is_named_with_a_command_that_works(tmp_path):
    write_mcap(tmp_path / "log.mcap")
    code, _, said = typed("import log.mcap --command-topic /cmd.data --out data", tmp_path)
    assert code == 2
    assert "has no column /cmd.data and no angle_deg; " in said
    hint = said.split("try: endotwin ")[1]
    assert hint.startswith("import log.mcap --time-column time_s --command-column /cmd.value ")
    units = hint.replace("--command-unit UNIT", "--command-unit mm").replace("UNIT", "deg")
    code, _, said = typed(units.strip(), tmp_path)
    assert code == 0, said
