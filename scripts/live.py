"""Live viewer: a running estimator shown in Foxglove or Lichtblick, over WebSocket (`endotwin[live]`)."""

import contextlib
import logging
import threading

from twin.errors import InputError, require_extra
from twin.live.reading import StreamSample
from twin.recording.container import schema_data
from twin.recording.live import LiveMessages

HOST, PORT = "127.0.0.1", 8765
BACKLOG = 1024  # messages that wait for one viewer, of all topics; the oldest give way to new ones
_LONGEST_GOODBYE_S = 1.0


class LiveViewer:
    """WebSocket server of all messages of a live stream; any number of viewers may come and go.

    It speaks `foxglove.sdk.v1`. It never waits for a viewer: of one that is slow or gone, the oldest messages
    are dropped beyond `BACKLOG`, and where as many control messages wait, it is disconnected. Topics
    without subscribers cost nothing. Messages of viewers are ignored.
    """

    def __init__(
        self, host: str = HOST, port: int = PORT, method: str = "estimator", *, controlled: bool = False
    ) -> None:
        if not 0 <= port <= 65535:
            raise InputError(f"port = {port}: must be from 0 to 65535")
        require_extra("live", "a live viewer")
        import foxglove

        logging.getLogger("foxglove").addHandler(logging.NullHandler())  # otherwise it writes to stderr
        self._stream = LiveMessages(method, controlled=controlled)
        self._context = foxglove.Context()  # kept: without it, viewers are disconnected
        try:
            self._server = foxglove.start_server(
                name="EndoTwin", host=host, port=port, context=self._context, message_backlog_size=BACKLOG
            )
        except RuntimeError as error:
            reason = str(error).rpartition(": ")[2]
            raise InputError(
                f"the live viewer cannot listen on {host}, port {port}: {reason}; choose another port or host"
            ) from error
        self.host, self.port = host, self._server.port
        self._channels = {
            topic: foxglove.Channel(
                topic,
                message_encoding="protobuf",
                schema=foxglove.Schema(
                    name=message.DESCRIPTOR.full_name,
                    encoding="protobuf",
                    data=schema_data(message.DESCRIPTOR),
                ),
                context=self._context,
            )
            for topic, message in self._stream.schemas.items()
        }

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

    def add(self, sample: StreamSample) -> None:
        """Show the next sample, at the time that a recording has it at."""
        timed = self._stream.of(sample)
        if timed is None:
            return
        log_time, _, messages = timed
        for topic, message in messages.items():
            channel = self._channels[topic]
            if channel.has_sinks():
                channel.log(message.SerializeToString(), log_time=log_time)

    def close(self) -> None:
        """Disconnect all viewers and stop listening, within a second; a second call does nothing."""
        for channel in self._channels.values():
            channel.close()
        # It waits until each viewer has taken its leave, which one that hangs never does.
        stopping = threading.Thread(target=self._stop, name="live viewer", daemon=True)
        stopping.start()
        stopping.join(_LONGEST_GOODBYE_S)

    def _stop(self) -> None:
        with contextlib.suppress(Exception):
            self._server.stop()
