"""Bridges of docs/examples to other programs, as far as they run here: ROS 2, TCP, Simulink, containers."""

import importlib.util
import json
import math
import re
import socket
import sys
import threading
import tomllib
import types

import pytest
import yaml
from repository import REPOSITORY

from twin.live import Source, load_runtime
from twin.live.lines import ReadingLine, SampleLine

EXAMPLES = REPOSITORY / "docs/examples"
EXTRAS = set(tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]["optional-dependencies"])


def example(name: str) -> types.ModuleType:
    """A program of the examples as a module."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Message(types.SimpleNamespace):
    """A message of ROS: whatever fields it is given."""

    OK, WARN = b"\0", b"\1"


class Node:
    """The part of a node of rclpy that the example uses; it keeps what is published."""

    def __init__(self, name: str):
        self.published, self.callback = {}, None

    def declare_parameter(self, name, default):
        return types.SimpleNamespace(value=PARAMETERS.get(name, default))

    def create_publisher(self, kind, topic, depth):
        messages = self.published.setdefault(topic, [])
        return types.SimpleNamespace(publish=messages.append)

    def create_subscription(self, kind, topic, callback, depth):
        assert topic == "measured"
        self.callback = callback


PARAMETERS: dict[str, object] = {}


@pytest.fixture
def ros(monkeypatch):
    """Stand-ins for the packages of ROS 2."""
    members = {
        "rclpy": {},
        "rclpy.executors": {"ExternalShutdownException": RuntimeError},
        "rclpy.node": {"Node": Node},
        "sensor_msgs.msg": {"JointState": Message},
        "diagnostic_msgs.msg": dict.fromkeys(["DiagnosticArray", "DiagnosticStatus", "KeyValue"], Message),
    }
    for name, values in members.items():
        module = types.ModuleType(name)
        vars(module).update(values)
        monkeypatch.setitem(sys.modules, name, module)


def test_a_node_of_ros_answers_each_sample_in_si_units(ros, ram_policy, monkeypatch):
    monkeypatch.setitem(PARAMETERS, "policy", str(ram_policy))
    node, runtime = example("ros2_node").EstimatorNode(), load_runtime(ram_policy)
    for k in range(30):
        pull_mm, measured_deg = 2 + math.sin(0.1 * k), 30 * math.sin(0.1 * k - 0.3)
        joints = {"pull": 1e-3 * pull_mm} | ({"bend": math.radians(measured_deg)} if k != 20 else {})
        stamp = types.SimpleNamespace(sec=k // 10, nanosec=k % 10 * 100_000_000)
        header = types.SimpleNamespace(stamp=stamp)
        node.callback(Message(header=header, name=[*joints], position=[*joints.values()]))
        reading = runtime.push(0.1 * k, pull_mm, measured_deg if k != 20 else math.nan)
        estimate, (status,) = node.published["estimate"][-1], node.published["/diagnostics"][-1].status
        expected = [math.radians(angle) for angle in (reading.bend_deg, reading.low_deg, reading.high_deg)]
        assert estimate.header is header
        assert estimate.name == ["bend", "bend_low", "bend_high"]
        assert estimate.position == pytest.approx(expected, abs=1e-6)
        assert ("NO_MEASUREMENT" in status.message) == (k == 20)
        good = reading.source is Source.ADVANCED and not reading.health
        assert status.level == (Message.OK if good else Message.WARN)


def test_the_tcp_server_answers_the_lines_of_each_connection(ram_policy):
    runtime = load_runtime(ram_policy)
    with example("tcp_server").tcp_server(str(ram_policy), 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with (
            socket.create_connection(server.server_address, timeout=60) as connection,
            connection.makefile("rw") as stream,
            socket.create_connection(server.server_address, timeout=60),  # another one does not disturb it
        ):
            for k in range(20):
                sample = {"time_s": 0.1 * k, "pull_mm": 2.0, "measurement_deg": None if k == 9 else 10.0}
                stream.write(f"{json.dumps(sample)}\n")
                stream.flush()
                answer = ReadingLine.model_validate_json(stream.readline())
                reading = runtime.push(0.1 * k, 2.0, math.nan if k == 9 else 10.0)
                assert answer.bend_deg == reading.bend_deg
            stream.write("none\n")
            stream.flush()
            assert json.loads(stream.readline())["line"] == 21
        server.shutdown()


def test_the_block_of_simulink_uses_the_keys_of_the_protocol():
    code = (EXAMPLES / "EndoTwin.m").read_text()
    (struct,) = re.findall(r"struct\((.*?)\);", code)
    assert set(re.findall(r"'(\w+)'", struct)) < set(SampleLine.model_fields)
    assert set(re.findall(r"answer\.(\w+)", code)) - {"error"} < set(ReadingLine.model_fields)


def test_the_container_has_extras_and_libraries_that_exist():
    recipe = (EXAMPLES / "Dockerfile").read_text()
    assert set(re.search(r"ARG EXTRAS=(\S+)", recipe)[1].split(",")) < EXTRAS
    libraries = re.search(r"--no-install-recommends (.*?) \\", recipe)[1].split()
    stated = (REPOSITORY / "scripts/system_libraries.sh").read_text()
    assert re.search(r'has_egl \|\| packages="(.*?)"', stated)[1].split() == libraries


def test_the_environment_of_conda_names_files_and_extras_that_exist():
    *conda, pip = yaml.safe_load((EXAMPLES / "environment.yml").read_text())["dependencies"]
    assert "python=3.11" in conda
    constraints, package = (line.split() for line in pip["pip"])
    assert (constraints[0], package[0]) == ("-c", "-e")
    assert (EXAMPLES / constraints[1]).is_file()
    folder, extra = package[1].removesuffix("]").split("[")
    assert (EXAMPLES / folder / "pyproject.toml").is_file()
    assert extra in EXTRAS
