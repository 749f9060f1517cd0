"""Frames evenly apart: how many a second a record has, and its pieces where samples are missing."""

import dataclasses

import numpy as np
import pytest
from exporting import make_full
from recorded import make_episode

from twin.export.even import frames_per_second, whole_pieces_in_time


def test_uneven_samples_are_no_frames_and_a_sample_time_is_named(tmp_path):
    time = np.arange(12) * 0.02
    assert frames_per_second(dataclasses.replace(make_episode(), time=time + 3)) == 50
    time[5] += 0.003
    with pytest.raises(ValueError, match=r"0\.017 s to 0\.023 s apart: .* such as 0\.02 s"):
        frames_per_second(dataclasses.replace(make_episode(), time=time))
    drifting = np.arange(12) * 0.02 * 1.002
    with pytest.raises(ValueError, match="must be evenly apart, a whole number per second"):
        frames_per_second(dataclasses.replace(make_episode(), time=drifting))


def test_a_record_is_cut_where_samples_are_missing_and_nothing_is_made_up():
    full = make_full(20, 0)
    kept = np.r_[0:7, 9:10, 12:20]  # one alone in the middle
    fields = [field.name for field in dataclasses.fields(full)][:-2]
    cut = dataclasses.replace(full, **{field: getattr(full, field)[kept] for field in fields})
    first, second = whole_pieces_in_time(cut)
    np.testing.assert_array_equal(first.time, full.time[:7])
    np.testing.assert_array_equal(second.time, full.time[12:])
    np.testing.assert_array_equal(second.wire_slack, full.wire_slack[12:])
    assert second.metadata == full.metadata
    assert whole_pieces_in_time(full) == [full]
    long_enough = whole_pieces_in_time(cut, 7 * 0.02)  # the first lasts 6 steps, the second 7
    assert [piece.time[0] for piece in long_enough] == [full.time[12]]
    assert len(long_enough[0].resampled(7 * 0.02).time) == 2
