"""Windows cut from longer records: each is an episode of its own, and all of a file come and go together."""

import dataclasses
import json

import numpy as np
import pytest
from csv_logs import steps, write

from twin.dataset.verify import verify
from twin.evaluation.reading import evaluation_records
from twin.measured.folder import write_measured, write_windows
from twin.measured.log import read_measured_log, read_windows
from twin.recording import read_dataset

TIME = np.tile(np.arange(4) * 0.5, 3)
CUT = {
    "window": np.repeat([7, 3, 5], 4),
    "time_s": TIME,
    "command_deg": [0, 9, 20, 9, -30, -40, -30, -20, 50, 60, 50, 40],
    "angle_deg": [0, 4, 9, 6, -15, -19, -16, -12, 24, 29, 26, 22],
}


def held(folder):
    return sorted(path.name for path in folder.iterdir())


def test_each_window_is_an_episode_from_time_0_in_the_order_of_the_file(tmp_path):
    logs = read_windows(write(tmp_path, CUT), "window")
    assert [log.metadata["window"] for log in logs] == [7, 3, 5]
    assert [log.metadata["rows"] for log in logs] == [4, 4, 4]
    for place, log in enumerate(logs):
        np.testing.assert_allclose(log.time, [0, 0.5, 1, 1.5])
        np.testing.assert_allclose(np.degrees(log.pull) * 100, CUT["command_deg"][4 * place : 4 * place + 4])
        np.testing.assert_allclose(log.measured_deg, CUT["angle_deg"][4 * place : 4 * place + 4])


def test_one_window_may_stand_still_but_not_all(tmp_path):
    still = [*CUT["command_deg"][:4], *[5] * 4, *CUT["command_deg"][8:]]
    assert np.ptp(read_windows(write(tmp_path, CUT | {"command_deg": still}), "window")[1].pull) == 0
    with pytest.raises(ValueError, match="command_deg is 5 in every row: a log without motion"):
        read_windows(write(tmp_path, CUT | {"command_deg": [5] * 12}), "window")


@pytest.mark.parametrize(
    ("changes", "column", "fault"),
    [
        ({}, "piece", "has no column piece; its columns: window, time_s"),
        ({}, "angle_deg", "window_column = angle_deg: must be a column of its own, not of time"),
        ({}, "time_s", "window_column = time_s: must be a column of its own, not of time"),
        ({"window": [1] * 11 + [""]}, "window", "line 13: window is missing"),
        ({"window": [*["a"] * 6, *["b"] * 6]}, "window", "line 2: window is 'a', not a finite number"),
        (
            {"window": [0] * 11 + [1], "time_s": range(12)},
            "window",
            "record needs two times (window 1, lines 13 to 13)",
        ),
        (
            {"angle_deg": [*CUT["angle_deg"][:8], "", "", 1, ""]},
            "window",
            "angle_deg is measured 1 times, a record needs two (window 5, lines 10 to 13)",
        ),
        ({"angle_deg": [0] * 9 + ["x", 1, 2]}, "window", "line 11: angle_deg is 'x', not a finite number"),
    ],
)
def test_windows_that_cannot_be_are_refused_and_named(tmp_path, changes, column, fault):
    with pytest.raises(ValueError, match=r"^[^\n]*$") as caught:
        read_windows(write(tmp_path, CUT | changes), column)
    assert fault in str(caught.value)


def test_windows_are_listed_and_read_as_separate_records(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    paths = write_windows(folder, "cut", read_windows(write(tmp_path, CUT), "window"))
    assert [path.stem for path in paths] == ["cut_window_0000", "cut_window_0001", "cut_window_0002"]
    assert held(folder) == [*(path.name for path in paths), "dataset.json"]
    listed = json.loads((folder / "dataset.json").read_text())
    assert [entry["csv"] for entry in listed["files"]] == ["log.csv"] * 3
    assert verify(folder) == ([], 3)
    assert [log.metadata["window"] for log in read_dataset(folder)] == [7, 3, 5]
    records = evaluation_records([folder], 0.5)
    assert [record.name for record in records] == [path.stem for path in paths]
    assert [record.reference_deg[0] for record in records] == pytest.approx([0, -15, 24])


def test_a_file_that_is_read_again_in_another_way_leaves_nothing_of_the_first(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    csv = write(tmp_path, CUT | {"half": np.repeat([0, 1], 6), "time_s": np.arange(12)})
    write_measured(folder, "other", read_measured_log(write(tmp_path, steps(), "other.csv")))
    write_windows(folder, "cut", read_windows(csv, "window"))
    write_windows(folder, "cut_window_9", read_windows(csv, "half"))
    write_measured(folder, "cut_window_0007", read_measured_log(csv))  # no window, whatever its name
    kept = {"other.mcap", "cut_window_9_window_0000.mcap", "cut_window_9_window_0001.mcap"}
    kept |= {"cut_window_0007.mcap", "dataset.json"}
    before = (folder / "cut_window_0001.mcap").read_bytes()
    write_windows(folder, "cut", read_windows(csv, "window"))
    assert (folder / "cut_window_0001.mcap").read_bytes() == before
    write_windows(folder, "cut", read_windows(csv, "half"))
    assert {*held(folder)} == kept | {"cut_window_0000.mcap", "cut_window_0001.mcap"}
    write_measured(folder, "cut", read_measured_log(csv))
    assert {*held(folder)} == kept | {"cut.mcap"}
    assert verify(folder) == ([], 5)


def test_windows_take_the_place_of_no_other_file_and_are_written_all_or_none(tmp_path):
    logs = read_windows(write(tmp_path, CUT), "window")
    folder = tmp_path / "out"
    folder.mkdir()
    late = dataclasses.replace(logs[2], time=logs[2].time * 1e-12)
    with pytest.raises(ValueError, match="less than 1 ns"):
        write_windows(folder, "cut", [*logs[:2], late])
    assert held(folder) == []
    write_measured(folder, "cut_window_0002", read_measured_log(write(tmp_path, steps(), "other.csv")))
    before = held(folder)
    with pytest.raises(ValueError, match=r"cut_window_0002\.mcap is the log of another CSV file"):
        write_windows(folder, "cut", logs)
    assert held(folder) == before
