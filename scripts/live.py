"""Live viewer: a running estimator shown in Foxglove or Lichtblick, over WebSocket (`endotwin[live]`).

The protocol is Foxglove's (`foxglove.sdk.v1`): topics are advertised as JSON, messages are binary.

Any web page may open a WebSocket to this machine. A browser states which page asks (`Origin`) and by which
name (`Host`): pages of others are refused, and so are names that were just pointed here by another
server (DNS rebinding). Programs that are no browsers state no origin.
"""

import asyncio
import base64
import collections
import contextlib
import functools
import ipaddress
import json
import logging
import socket
import struct
import threading
import time
from collections.abc import Collection
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from twin.errors import InputError, require_extra
from twin.files.shown import shown
from twin.live.reading import StreamSample
from twin.recording.container import schema_data
from twin.recording.live import LiveMessages

if TYPE_CHECKING:
    from websockets.asyncio.server import Server, ServerConnection
    from websockets.http11 import Request, Response

HOST, PORT = "127.0.0.1", 8765
PROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
ORIGINS = (
    "https://app.foxglove.dev",
    "https://studio.foxglove.dev",
    "https://lichtblick-suite.github.io",
    "file://",  # of their programs for the desktop
)
"""Pages that may watch, in addition to those of this machine."""
BACKLOG = 1024  # messages that wait for one viewer, of all topics; the oldest give way to new ones
_MESSAGE = struct.Struct("<BIQ")  # 1 for a message, number of the subscription, log time [ns]
_LARGEST_NUMBER = 2**32 - 1  # of a subscription
_LONGEST_REQUEST = 2**16  # bytes of a message of a viewer
_LONGEST_GOODBYE_S = 1.0


def judge(
    connection: "ServerConnection", request: "Request", listening: str, origins: Collection[str], hint: str
) -> "Response | None":
    """Return the answer to a request that is refused, or None.

    Known are where the server listens, further pages that may watch, and a hint to those that may not.
    """
    host, origin = (request.headers.get_all(name) for name in ("Host", "Origin"))
    if len(host) > 1 or len(origin) > 1:
        why: str | None = "a header is there twice"
    else:
        why = _refusal(host[0] if host else None, origin[0] if origin else None, listening, origins, hint)
    return None if why is None else connection.respond(HTTPStatus.FORBIDDEN, f"{why}\n")


def quiet_logger() -> logging.Logger:
    """Return a logger that discards all: failed handshakes would be written to stderr."""
    quiet = logging.getLogger("endotwin.live")
    quiet.addHandler(logging.NullHandler())
    quiet.propagate = False
    return quiet


def _refusal(
    host: str | None, origin: str | None, listening: str, origins: Collection[str], hint: str
) -> str | None:
    """Return why headers are refused, or None; see `judge`."""
    try:
        name, page = (urlsplit(of).hostname or "" for of in (f"//{host or ''}", origin or ""))
    except ValueError:
        return "its headers cannot be read"
    machine = socket.gethostname().lower()
    own = {"localhost", listening.lower(), machine, f"{machine}.local"}
    if not name or not (name in own or _address(name)):
        return f"this machine is not {shown(name)}: open its address"
    address = _address(page)
    if origin is None or page == "localhost" or (address and address.is_loopback):
        return None
    if origin.lower().rstrip("/") in {of.lower().rstrip("/") for of in origins}:
        return None
    return f"pages of {shown(origin)} may not watch{hint}"


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """Return the address that a name is, or None where it is no address."""
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(name)
    return None


class _Viewer:
    """One viewer that is connected: its subscriptions, and what waits for it."""

    def __init__(self, connection: "ServerConnection", loop: asyncio.AbstractEventLoop) -> None:
        self.connection = connection
        self.numbers: dict[str, int] = {}  # of its subscriptions, by topic; replaced as a whole
        self._pending = collections.deque[bytes](maxlen=BACKLOG)
        self._loop, self._ready, self._waits = loop, asyncio.Event(), False

    def offer(self, message: bytes) -> None:
        """Queue a message for the viewer; called from any thread."""
        self._pending.append(message)
        if self._waits:
            self._waits = False
            with contextlib.suppress(RuntimeError):  # the server has just stopped
                self._loop.call_soon_threadsafe(self._ready.set)

    async def send_all(self) -> None:
        """Send what waits, for as long as the viewer is connected."""
        while True:
            while self._pending:
                await self.connection.send(self._pending.popleft())
            self._waits = True
            if not self._pending:
                await self._ready.wait()
            self._ready.clear()
            self._waits = False


class LiveViewer:
    """WebSocket server of all messages of a live stream; any number of viewers may come and go.

    It never waits for a viewer: of one that is slow or gone, the oldest messages are dropped beyond
    `BACKLOG`. Topics without viewers cost nothing. Messages of viewers other than subscriptions are ignored.
    """

    def __init__(
        self,
        host: str = HOST,
        port: int = PORT,
        method: str = "estimator",
        *,
        controlled: bool = False,
        origins: Collection[str] = (),  # further pages that may watch, as `https://lab.example`
    ) -> None:
        if not 0 <= port <= 65535:
            raise InputError(f"port = {port}: must be from 0 to 65535")
        for origin in origins:
            if not (urlsplit(origin).scheme and urlsplit(origin).netloc):
                raise InputError(f"live origin {origin!r}: must be as https://lab.example")
        require_extra("live", "a live viewer")
        self.host, self._origins = host, (*ORIGINS, *origins)
        self._stream = LiveMessages(method, controlled=controlled)
        self._topics = dict(enumerate(self._stream.schemas, start=1))
        self._viewers: tuple[_Viewer, ...] = ()  # replaced as a whole: `add` runs in another thread
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="live viewer", daemon=True)
        self._thread.start()
        try:
            self._server = asyncio.run_coroutine_threadsafe(self._listen(port), self._loop).result()
        except OSError as error:
            self._stop_loop()
            reason = error.strerror or str(error)
            reason = reason.rpartition(": ")[2].capitalize()
            raise InputError(
                f"the live viewer cannot listen on {host}, port {port}: {reason}; choose another port or host"
            ) from error
        self.port = next(iter(self._server.sockets)).getsockname()[1]

    @property
    def url(self) -> str:
        """Address to open in a viewer."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"ws://{host}:{self.port}"

    def __enter__(self) -> "LiveViewer":
        """Return the viewer, which listens already."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop listening."""
        self.close()

    def is_watched(self, topic: str) -> bool:
        """Return whether any viewer has subscribed to a topic."""
        return any(topic in viewer.numbers for viewer in self._viewers)

    def add(self, sample: StreamSample) -> None:
        """Show the next sample, at the time that a recording has it at."""
        timed = self._stream.of(sample)
        if timed is None:
            return
        log_time, _, messages = timed
        for topic, message in messages.items():
            watching = [(viewer, viewer.numbers.get(topic)) for viewer in self._viewers]
            data = message.SerializeToString() if any(number is not None for _, number in watching) else b""
            for viewer, number in watching:
                if number is not None:
                    viewer.offer(_MESSAGE.pack(1, number, log_time) + data)

    def close(self) -> None:
        """Disconnect all viewers and stop listening, within a second; a second call does nothing."""
        if self._thread.is_alive():
            with contextlib.suppress(TimeoutError):
                asyncio.run_coroutine_threadsafe(self._goodbye(), self._loop).result(_LONGEST_GOODBYE_S)
            self._stop_loop()

    def _stop_loop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_LONGEST_GOODBYE_S)

    async def _goodbye(self) -> None:
        self._server.close()
        await self._server.wait_closed()

    async def _listen(self, port: int) -> "Server":
        from websockets.asyncio.server import serve

        return await serve(
            self._serve,
            self.host,
            port,
            subprotocols=PROTOCOLS,  # type: ignore[arg-type]  # plain text is one
            process_request=self._judge,
            compression=None,
            max_size=_LONGEST_REQUEST,
            close_timeout=_LONGEST_GOODBYE_S / 2,
            logger=quiet_logger(),
        )

    def _judge(self, connection: "ServerConnection", request: "Request") -> "Response | None":
        return judge(connection, request, self.host, self._origins, ": --live-origin allows them")

    async def _serve(self, connection: "ServerConnection") -> None:
        """Advertise the topics to a new viewer, and take its subscriptions."""
        viewer = _Viewer(connection, self._loop)
        self._viewers += (viewer,)
        sending = asyncio.create_task(viewer.send_all())
        try:
            for message in self._greeting:
                await connection.send(message)
            async for text in connection:
                self._subscribe(viewer, text)
        finally:
            sending.cancel()
            self._viewers = tuple(of for of in self._viewers if of is not viewer)

    @functools.cached_property
    def _greeting(self) -> tuple[str, str]:
        """What each viewer gets first: the server, and its topics."""
        info = {"op": "serverInfo", "name": "EndoTwin", "capabilities": [], "sessionId": str(time.time_ns())}
        schemas = {topic: self._stream.schemas[topic].DESCRIPTOR for topic in self._topics.values()}
        channels = [
            {
                "id": number,
                "topic": topic,
                "encoding": "protobuf",
                "schemaName": schemas[topic].full_name,
                "schema": base64.b64encode(schema_data(schemas[topic])).decode(),
                "schemaEncoding": "protobuf",
            }
            for number, topic in self._topics.items()
        ]
        return json.dumps(info), json.dumps({"op": "advertise", "channels": channels})

    def _subscribe(self, viewer: _Viewer, text: str | bytes) -> None:
        """Take a viewer's message; only subscriptions count."""
        with contextlib.suppress(ValueError, TypeError, KeyError, AttributeError, OverflowError):
            said = json.loads(text)
            if said["op"] == "subscribe":
                wanted = {self._topics[of["channelId"]]: int(of["id"]) for of in said["subscriptions"]}
                if all(0 <= number <= _LARGEST_NUMBER for number in wanted.values()):
                    viewer.numbers = viewer.numbers | wanted
            elif said["op"] == "unsubscribe":
                gone = said["subscriptionIds"]
                viewer.numbers = {topic: of for topic, of in viewer.numbers.items() if of not in gone}
