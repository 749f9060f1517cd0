"""A viewer of another library sees a live stream: by the schemas that it is sent, what was added."""

import base64
import contextlib
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import psutil
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from live_streams import ESTIMATE, METHOD, Sample, good_samples, reading, sample
from repository import ENVIRONMENT

from twin.errors import MissingExtraError
from twin.live.reading import Alarm, Health, Reading, Source

client = pytest.importorskip("websockets.sync.client")

from scripts.live import LiveViewer  # noqa: E402

PROTOCOL = "foxglove.sdk.v1"
MESSAGE = struct.Struct("<BIQ")  # opcode 1, subscription, log time [ns]
TOPICS = {"/command", "/measurement", ESTIMATE, "/health"}


def wait_until(holds: Callable[[], bool]) -> None:
    for _ in range(1000):
        if holds():
            return
        time.sleep(0.02)
    raise AssertionError("the server has not taken what the viewer said")


class Client:
    """Viewer of its own: WebSocket by `websockets`, messages by the schemas that it is sent."""

    def __init__(self, url: str):
        self.socket = client.connect(url, subprotocols=[PROTOCOL]).__enter__()
        self.channels: dict[str, dict] = {}
        while not self.channels.keys() >= TOPICS:
            message = json.loads(self.socket.recv(timeout=20))
            self.channels |= {channel["topic"]: channel for channel in message.get("channels", [])}

    def subscribe(self, viewer: LiveViewer, topics: set[str]) -> None:
        """Subscribe, and wait until the server knows of it: of topics without another viewer."""
        self.ids = {number: topic for number, topic in enumerate(sorted(topics), start=1)}
        wanted = [{"id": number, "channelId": self.channels[t]["id"]} for number, t in self.ids.items()]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        wait_until(lambda: all(viewer.is_watched(topic) for topic in topics))

    def estimate_next_to_others(self, viewer: LiveViewer, bend_deg: float) -> float:
        """Return an estimate that is shown again and again, where others have subscribed to it already."""
        for k in range(500):
            viewer.add(Sample(1e6 + k, 1.0, 2.0, reading(bend_deg)))
            with contextlib.suppress(TimeoutError):
                return self.receive(timeout=0.1)[2].estimate_deg
        raise AssertionError("no estimate has come")

    def receive(self, timeout: float = 20) -> tuple[str, int, object]:
        """Return topic, log time and decoded message of the next one."""
        while isinstance(data := self.socket.recv(timeout=timeout), str):
            pass
        opcode, number, log_time = MESSAGE.unpack_from(data)
        assert opcode == 1
        return self.ids[number], log_time, self.decode(self.ids[number], data[MESSAGE.size :])

    def decode(self, topic: str, data: bytes) -> object:
        channel = self.channels[topic]
        assert channel["encoding"] == channel["schemaEncoding"] == "protobuf"
        files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
        pool = descriptor_pool.DescriptorPool()
        for file in files.file:
            pool.Add(file)
        kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))
        return kind.FromString(data)


@pytest.fixture
def viewer():
    with LiveViewer(port=0, method=METHOD) as made:
        yield made


def test_a_viewer_sees_the_numbers_that_were_added(viewer):
    assert viewer.url == f"ws://127.0.0.1:{viewer.port}"
    seen = Client(viewer.url)
    assert seen.socket.subprotocol == PROTOCOL
    assert set(seen.channels) == TOPICS
    seen.subscribe(viewer, TOPICS)
    samples, found = good_samples(100), {topic: [] for topic in TOPICS}
    for one in samples:
        viewer.add(one)
    for _ in range(3 * 100 + 75):
        topic, log_time, message = seen.receive()
        found[topic].append((log_time, message))
    assert [time for time, _ in found["/command"]] == [round(one.time_s * 1e9) for one in samples]
    assert [message.pull_mm for _, message in found["/command"]] == [one.pull_mm for one in samples]
    estimates = [(message.estimate_deg, message.low_deg, message.high_deg) for _, message in found[ESTIMATE]]
    assert estimates == [one.reading[:3] for one in samples]
    angles = [message.measured_deg for _, message in found["/measurement"]]
    assert angles == [one.measurement_deg for one in samples if one.measurement_deg == one.measurement_deg]


def test_a_viewer_sees_what_is_wrong(viewer):
    seen = Client(viewer.url)
    seen.subscribe(viewer, {"/health"})
    viewer.add(sample(1.0))
    alarmed = Reading(1.0, 0.0, 2.0, Source.FALLBACK, Health.LATE, Alarm.DISAGREEMENT | Alarm.RATE)
    viewer.add(Sample(0.5, 1.0, 2.0, alarmed))
    assert seen.receive()[1] == 10**9
    _, log_time, health = seen.receive()
    assert log_time == 10**9
    assert (list(health.faults), list(health.alarms)) == (["late"], ["disagreement", "rate"])
    assert health.source == "fallback"


STALLED = """
import json, os, signal, sys
from websockets.sync.client import connect
with connect(sys.argv[1], subprotocols=["foxglove.sdk.v1"]) as socket:
    channels = []
    while len(channels) < 4:
        channels += json.loads(socket.recv()).get("channels", [])
    wanted = [{"id": one["id"], "channelId": one["id"]} for one in channels]
    socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    print("subscribed", flush=True)
    sys.stdin.read()
"""


def test_a_viewer_that_hangs_neither_blocks_nor_fills_the_memory(viewer):
    """Far more than the backlog and all buffers of the system hold; the others see all of the end."""
    words = [sys.executable, "-c", STALLED, viewer.url]
    stalled = subprocess.Popen(words, env=ENVIRONMENT, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        assert stalled.stdout.readline().strip() == b"subscribed"
        wait_until(lambda: viewer.is_watched("/command"))
        os.kill(stalled.pid, signal.SIGSTOP)
        process, one = psutil.Process(), sample(0.0)
        for k in range(20_000):  # 80,000 messages
            viewer.add(one._replace(time_s=k / 50))
        before = process.memory_info().rss
        for k in range(20_000, 80_000):
            viewer.add(one._replace(time_s=k / 50))
        # 240,000 messages of 40 to 60 bytes and what holds each would be more than 20 MB.
        assert process.memory_info().rss - before < 8 * 2**20
        other = Client(viewer.url)
        other.subscribe(viewer, {ESTIMATE})
        assert other.estimate_next_to_others(viewer, 7.25) == 7.25
        closing = threading.Thread(target=viewer.close)
        closing.start()
        closing.join(30)
        assert not closing.is_alive()
    finally:
        stalled.kill()
        stalled.wait()


def handshake(viewer: LiveViewer, **headers: str) -> int:
    """Return the status that a handshake with these headers is answered with."""
    said = {"Host": f"127.0.0.1:{viewer.port}", "Upgrade": "websocket", "Connection": "Upgrade"}
    said |= {"Sec-WebSocket-Key": base64.b64encode(bytes(16)).decode(), "Sec-WebSocket-Version": "13"}
    said |= {"Sec-WebSocket-Protocol": PROTOCOL}
    lines = [f"{name}: {value}" for name, value in (said | headers).items()]
    with socket.create_connection((viewer.host, viewer.port), timeout=20) as raw:
        raw.sendall("\r\n".join(["GET / HTTP/1.1", *lines, "", ""]).encode())
        return int(raw.recv(1024).split()[1])


@pytest.mark.parametrize(
    "origin",
    [
        "https://app.foxglove.dev",
        "https://lichtblick-suite.github.io",
        "file://",
        "http://localhost:8080",
        "http://127.0.0.1",
        "http://[::1]:5000",
    ],
)
def test_pages_of_viewers_and_of_this_machine_may_watch(viewer, origin):
    assert handshake(viewer, Origin=origin) == 101
    assert handshake(viewer, Origin=origin, Host=f"localhost:{viewer.port}") == 101


@pytest.mark.parametrize(
    "origin",
    [
        "https://evil.example",
        "null",
        "https://app.foxglove.dev.evil.example",
        "https://evil.example/https://app.foxglove.dev",
        "http://localhost.evil.example",
        "http://127.0.0.1.evil.example",
        "http://app.foxglove.dev",
        "",
    ],
)
def test_a_page_of_others_may_not_watch(viewer, origin):
    assert handshake(viewer, Origin=origin) == 403


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8765", "localhost.evil.example", "", "[::1"])
def test_a_name_that_was_pointed_at_this_machine_is_refused(viewer, host):
    """DNS rebinding: the page and the name are of one server, so that the browser lets it ask."""
    assert handshake(viewer, Host=host) >= 400
    assert handshake(viewer, Host=host, Origin=f"http://{host}") >= 400


def test_a_page_may_watch_that_the_user_allows():
    with LiveViewer(port=0, method=METHOD, origins=["https://lab.example"]) as viewer:
        assert handshake(viewer, Origin="https://lab.example") == 101
        assert handshake(viewer, Origin="https://other.example") == 403
    with pytest.raises(ValueError, match=r"live origin 'lab': must be as https://lab\.example"):
        LiveViewer(port=0, method=METHOD, origins=["lab"])


def test_nonsense_of_a_viewer_is_ignored(viewer):
    seen = Client(viewer.url)
    for said in (
        "{",
        "[]",
        '{"op": 1}',
        '{"op": "subscribe"}',
        b"\x01\x02",
        '{"op": "subscribe", "subscriptions": [7]}',
        '{"op": "subscribe", "subscriptions": [{"id": 4294967296, "channelId": 1}]}',
        '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}',
        '{"op": "subscribe", "subscriptions": [{"id": 1e999, "channelId": 1}]}',
    ):
        seen.socket.send(said)
    seen.subscribe(viewer, {ESTIMATE})
    viewer.add(sample(1.0))
    assert seen.receive()[0] == ESTIMATE
    seen.socket.send(json.dumps({"op": "unsubscribe", "subscriptionIds": list(seen.ids)}))
    wait_until(lambda: not viewer.is_watched(ESTIMATE))


def test_a_port_in_use_is_said_in_one_line(viewer):
    with pytest.raises(ValueError, match=f"cannot listen on 127.0.0.1, port {viewer.port}: Address already"):
        LiveViewer(port=viewer.port, method=METHOD)


def test_without_the_package_the_extra_is_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(
        MissingExtraError, match=r"a live viewer needs websockets: pip install 'endotwin\[live\]'"
    ):
        LiveViewer(port=0, method=METHOD)
