"""Streams of samples through a runtime: JSON lines in and out, logs sample by sample, and what takes them in.

`protocol` is the one place that knows the lines, `docs/deployment.md` describes them for other programs.
"""

from twin.stream.sample import Sink, StreamSample

__all__ = ["Sink", "StreamSample"]
