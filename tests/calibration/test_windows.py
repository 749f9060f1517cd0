"""A calibration fits the first windows of a file and predicts the others; one alone need not be a loop."""

import dataclasses

import numpy as np
import pytest
from calibrating import TRUTH, recorded

from twin.calibration.files import read_loops
from twin.recording import write_episode

TURNS = recorded().pull[:40]  # there and back
RISES = np.linspace(-2e-3, 2e-3, 40)


def window_of(folder, place, pull, sign=1.0, file="a"):
    episode = recorded()
    part = {
        name: values[:40]
        for name, values in vars(episode).items()
        if isinstance(values, np.ndarray) and len(values)
    }
    facts = {"source": "measured", "window": place, "file_sha256": file, "name": f"{file}_{place}"}
    bend = sign * (60 * pull + 1e-3 * np.arange(40))
    part |= {"pull": pull, "bend": bend, "measured_bend": bend, "wire_tension": np.empty((40, 2, 0))}
    write_episode(folder / f"{file}_{place}.mcap", dataclasses.replace(episode, metadata=facts, **part))


def names(loops):
    return [loop.name for loop in loops]


def test_the_share_is_one_of_the_windows_of_each_file(tmp_path):
    for place in range(4):
        window_of(tmp_path, place, TURNS)
    window_of(tmp_path, 0, TURNS, file="b")
    fitted, predicted, _ = read_loops([tmp_path], [], TRUTH, fraction=0.5)
    assert names(fitted) == ["a_0", "a_1", "b_0"]  # at least one of each
    assert names(predicted) == ["a_2", "a_3"]
    assert all(loop.fitted.all() for loop in fitted)
    assert not any(loop.fitted.any() for loop in predicted)
    assert names(read_loops([tmp_path], [], TRUTH)[0]) == ["a_0", "a_1", "a_2", "a_3", "b_0"]
    with pytest.raises(ValueError, match="fraction = 0: must be above 0 and at most 1"):
        read_loops([tmp_path], [], TRUTH, fraction=0)


def test_a_window_may_stand_still_or_go_one_way_where_another_reverses(tmp_path):
    for place, pull in enumerate((np.zeros(40), RISES, TURNS)):
        window_of(tmp_path, place, pull)
    assert len(read_loops([tmp_path], [], TRUTH)[0]) == 3
    with pytest.raises(ValueError, match="a_0: the command moves by 0 mm: nothing to calibrate on"):
        read_loops([tmp_path], [], TRUTH, fraction=0.6)
