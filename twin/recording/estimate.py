"""Estimates of the bending angle among the messages of an episode."""

import re
from typing import Any

from twin.recording.endotwin_pb2 import Measurement


def estimate_topic(method: str) -> str:
    """Return the topic of a method's estimates: `/estimate/` and its name, in letters, digits, - and _."""
    return "/estimate/" + re.sub(r"[^A-Za-z0-9-]+", "_", method).strip("_")


def estimate_message(bend_deg: float) -> Any:
    """Return a message of one estimate: an angle [deg], in the schema of `/measurement`."""
    return Measurement(bend_deg=bend_deg)
