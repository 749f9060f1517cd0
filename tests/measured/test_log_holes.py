"""What is missing in a measured log, and rows that come late: each becomes what the documents say."""

import numpy as np
import pytest
from csv_logs import steps, write
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.measured.log import read_measured_log


def test_an_angle_that_is_missing_stays_missing_in_the_record(tmp_path):
    said = []
    columns = steps(
        time_s=[0, 1, 4, 5, 6], command_deg=[0, 1, 2, 1, 0], angle_deg=["", 3, "NaN", 7, " null "]
    )
    log = write(tmp_path, columns)
    episode = read_measured_log(log, on_warning=said.append)
    np.testing.assert_allclose(episode.measured_deg, [np.nan, 3, np.nan, 7, np.nan])
    np.testing.assert_allclose(episode.truth_deg, [3, 3, 6, 7, 7])  # linear in time, level at the ends
    np.testing.assert_allclose(episode.pull, np.radians([0, 1, 2, 1, 0]) * 0.01)
    assert said == [f"{log} line 2: angle_deg is missing, as in 3 of 5 rows: nothing is measured there"]
    assert not {"rows_dropped", "commands_held"} & episode.metadata.keys()


def test_a_missing_command_is_held(tmp_path):
    said = []
    log = write(tmp_path, steps(command_deg=[3, "", "nan", 1]))
    episode = read_measured_log(log, on_warning=said.append)
    np.testing.assert_allclose(np.degrees(episode.pull / 0.01), [3, 3, 3, 1])
    assert said == [f"{log} line 3: command_deg is missing, as in 2 of 4 rows: the last one is held"]
    assert episode.metadata["commands_held"] == 2


def test_rows_without_a_time_and_rows_that_come_late_are_dropped_and_counted(tmp_path):
    time = np.arange(40.0)
    rows = {"time_s": [*time], "command_deg": [*np.sin(time)], "angle_deg": [*np.cos(time)]}
    wanted = read_measured_log(write(tmp_path, rows))
    for place, stamp in ((30, 12.5), (20, ""), (20, "nan"), (10, 3.0)):
        for name, value in (("time_s", stamp), ("command_deg", 19.0), ("angle_deg", "")):
            rows[name].insert(place, value)
    said = []
    log = write(tmp_path, rows)
    episode = read_measured_log(log, on_warning=said.append)
    for field in ("time", "pull", "bend", "measured_bend"):
        np.testing.assert_array_equal(getattr(episode, field), getattr(wanted, field))
    assert said == [
        f"{log} line 23: time_s is missing, as in 2 of 44 rows: such rows are dropped",
        f"{log} line 12: time_s runs backwards, as in 2 of 42 rows: such rows are dropped",
    ]
    assert (episode.metadata["rows"], episode.metadata["rows_dropped"]) == (44, 4)


def test_a_tenth_of_the_rows_may_come_late_and_no_more(tmp_path):
    late = [*range(1, 19), 3.5, 4.5]
    columns = {"time_s": late, "command_deg": np.arange(20), "angle_deg": np.arange(20)}
    assert len(read_measured_log(write(tmp_path, columns)).time) == 18
    with pytest.raises(ValueError, match=r"line 19: time_s runs backwards, as in 3 of 20 rows: at most 10%"):
        read_measured_log(write(tmp_path, columns | {"time_s": [*range(1, 18), 2.5, 3.5, 4.5]}))


TIMES = st.lists(st.sampled_from([0.0, 0.01, 0.1, 0.1, 0.1, 0.1, 3.0]), min_size=2, max_size=40).map(
    np.cumsum
)
FIELD = st.floats(-300, 300, width=16).map(str)
HOLED = st.one_of(FIELD, FIELD, FIELD, FIELD, st.sampled_from(["", "nan", "NA", " "]))


@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_no_hole_of_a_log_becomes_a_hole_of_the_record(tmp_path_factory, data):
    time = data.draw(TIMES)
    stamps = [f"{second:.3f}" for second in time]
    broken = data.draw(st.lists(st.integers(0, len(time) - 1), max_size=3))
    for place in broken:
        stamps[place] = data.draw(st.sampled_from(["", "nan", "-1", "0.05", stamps[-1], "inf", "x", "1e300"]))
    column = st.lists(HOLED, min_size=len(time), max_size=len(time))
    columns = {"time_s": stamps, "command_deg": data.draw(column), "angle_deg": data.draw(column)}
    log = write(tmp_path_factory.getbasetemp(), columns, "holed.csv")
    said = []
    try:
        episode = read_measured_log(log, on_warning=said.append)
    except ValueError as refused:
        fault = str(refused)
    else:
        fault = None
    if fault is not None:
        assert fault.startswith(f"{log}")
        assert "\n" not in fault
        return
    assert all(line.startswith(f"{log}") and "\n" not in line for line in said)
    for field in ("time", "pull", "bend"):
        assert np.isfinite(getattr(episode, field)).all()
    assert episode.time[0] == 0
    assert (np.diff(episode.time) > 0).all()
    known = ~np.isnan(episode.measured_bend)
    np.testing.assert_array_equal(episode.measured_bend[known], episode.bend[known])
    # What is kept is known from the rows one by one: the latest time so far, and what was read at it.
    latest, angles, begun = -np.inf, {}, False
    for stamp, command, angle in zip(*columns.values(), strict=True):
        if stamp not in ("", "nan") and float(stamp) >= latest:
            latest = float(stamp)
            begun = begun or command not in ("", "nan", "NA", " ")
            if not begun:
                continue
            angles.setdefault(latest, [])
            if angle not in ("", "nan", "NA", " "):
                angles[latest].append(float(angle))
    np.testing.assert_allclose(episode.time, np.array([*angles]) - min(angles), atol=1e-12)
    wanted = [sum(seen) / len(seen) if seen else np.nan for seen in angles.values()]
    np.testing.assert_allclose(episode.measured_deg, wanted, rtol=1e-9, atol=1e-9)
