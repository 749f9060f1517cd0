"""Estimates and references next to an episode come back at its samples, or are refused in one line."""

import math

import numpy as np
import pytest
from recorded import make_episode

from twin.recording import EpisodeWriter, read_episode, read_estimates
from twin.recording import endotwin_pb2 as schema
from twin.recording.messages import REFERENCE_TOPIC, estimate_message, to_nanoseconds

TIMES = to_nanoseconds(make_episode().time)


def written(path, rows, topic=REFERENCE_TOPIC):
    """A record of twelve samples with messages (time [ns], message) on a topic next to them."""
    with EpisodeWriter(path / "a.mcap") as writer:
        writer.write(make_episode())
        for time, message in rows:
            writer.add_message(topic, message, time)
    return path / "a.mcap"


@pytest.mark.parametrize("topic", [REFERENCE_TOPIC, "/estimate/RAM"])
def test_angles_come_back_at_their_samples_and_nan_between(tmp_path, topic):
    path = written(tmp_path, [(TIMES[k], estimate_message(k / 3)) for k in (1, 2, 7)], topic)
    wanted = np.full(12, np.nan)
    wanted[[1, 2, 7]] = np.array([1, 2, 7]) / 3
    np.testing.assert_array_equal(read_estimates(path, topic), wanted)
    assert len(read_episode(path).time) == 12


@pytest.mark.parametrize(
    ("rows", "fault"),
    [
        (
            [(TIMES[3] + 1, estimate_message(1))],
            "the messages of /reference are not at the times of those of",
        ),
        (
            [(TIMES[3], estimate_message(1))] * 2,
            "the messages of /reference are not at the times of those of",
        ),
        ([(TIMES[3], estimate_message(math.inf))], "an angle of /reference is inf deg: must be from -1e"),
        ([(TIMES[3], estimate_message(1e39))], r"an angle of /reference is 1e\+39 deg: must be from -1e"),
        (
            [(TIMES[3], schema.Command(pull_mm=1))],
            "topic /reference has 'protobuf' messages of schema endotwin",
        ),
    ],
)
def test_what_is_no_reference_is_refused_in_one_line(tmp_path, rows, fault):
    path = written(tmp_path, rows)
    with pytest.raises(ValueError, match=f"a.mcap holds no whole /reference: {fault}") as error:
        read_estimates(path, REFERENCE_TOPIC)
    assert "\n" not in str(error.value)
