"""Frames evenly apart: how many a second a record has."""

import dataclasses

import numpy as np
import pytest
from recorded import make_episode

from twin.export.even import frames_per_second


def test_uneven_samples_are_no_frames_and_a_sample_time_is_named(tmp_path):
    time = np.arange(12) * 0.02
    assert frames_per_second(dataclasses.replace(make_episode(), time=time + 3)) == 50
    time[5] += 0.003
    with pytest.raises(ValueError, match=r"0\.017 s to 0\.023 s apart: .* such as 0\.02 s"):
        frames_per_second(dataclasses.replace(make_episode(), time=time))
    drifting = np.arange(12) * 0.02 * 1.002
    with pytest.raises(ValueError, match="must be evenly apart, a whole number per second"):
        frames_per_second(dataclasses.replace(make_episode(), time=drifting))
