"""A measured log becomes an episode in SI units, of its own samples; a fault is one clear line."""

import hashlib

import numpy as np
import pytest
from csv_logs import LOOP, PHASE, steps, write

from twin.measured.log import LogFormat, read_measured_log


def test_a_loop_is_read_in_si_units_with_repeats_averaged(tmp_path):
    episode = read_measured_log(write(tmp_path, LOOP))
    phase = np.unique(PHASE)
    np.testing.assert_allclose(episode.time, phase * 20 / (2 * np.pi), rtol=1e-12)
    np.testing.assert_allclose(episode.pull, np.radians(60 * np.sin(phase)) * 0.01, atol=1e-15)
    np.testing.assert_allclose(episode.bend, np.radians(30 * np.sin(phase - 0.3)), atol=1e-12)
    np.testing.assert_array_equal(episode.measured_bend, episode.bend)
    assert episode.wire_tension.shape == (len(phase), 2, 1)
    np.testing.assert_allclose(episode.tension[:, 0], LOOP["tension_a_n"][::2])
    np.testing.assert_allclose(episode.tension[:, 1], LOOP["tension_b_n"][::2])
    assert episode.joint_angle.shape == (len(phase), 0)
    assert episode.sheath_friction.shape == (len(phase), 2, 0)
    assert len(episode.sheath_bend) == len(episode.pulley) == len(episode.lateral_bend) == 0


def test_the_pulley_angle_can_be_had_back_from_the_metadata(tmp_path):
    log = write(tmp_path, LOOP)
    episode = read_measured_log(log, LogFormat(pulley_radius=0.023))
    facts = episode.metadata
    np.testing.assert_allclose(
        np.degrees(episode.pull / facts["pulley_radius"]), 60 * np.sin(np.unique(PHASE))
    )
    assert facts["source"] == "measured"
    assert (facts["command_unit"], facts["angle_unit"], facts["time_unit"]) == ("deg", "deg", "rad")
    assert facts["seconds_per_cycle"] == 20
    assert (facts["file"], facts["file_sha256"]) == ("log.csv", hashlib.sha256(log.read_bytes()).hexdigest())
    assert facts["rows"] == len(PHASE)
    assert facts["tension_columns"] == ["tension_a_n", "tension_b_n"]


@pytest.mark.parametrize(
    ("column", "unit", "metres"),
    [
        ("command_deg", None, 0.02 * np.pi / 180),
        ("turn_rad", None, 0.02),
        ("pull_mm", None, 1e-3),
        ("PULL_MM", None, 1e-3),
        ("pull_m", None, 1.0),
        ("command", "mm", 1e-3),
        ("command_deg", "rad", 0.02),
    ],
)
def test_unit_of_the_command_is_given_or_the_end_of_its_name(tmp_path, column, unit, metres):
    columns = steps(command_deg=None) | {column: [0.0, 0.1, 0.2, 0.1]}
    form = LogFormat(command_column=column, command_unit=unit, pulley_radius=0.02)
    episode = read_measured_log(write(tmp_path, columns), form)
    np.testing.assert_allclose(episode.pull, np.array([0.0, 0.1, 0.2, 0.1]) * metres, rtol=1e-12)
    of_the_pulley = (unit or column[-3:]) in ("deg", "rad")
    assert episode.metadata["pulley_radius"] == (0.02 if of_the_pulley else None)


@pytest.mark.parametrize(
    ("column", "unit", "seconds"),
    [
        ("time_s", None, 1),
        ("stamp_ms", None, 1e-3),
        ("t_us", None, 1e-6),
        ("t", "ms", 1e-3),
        ("t", "rad", 7 / (2 * np.pi)),
    ],
)
def test_unit_of_time_is_given_or_the_end_of_its_name(tmp_path, column, unit, seconds):
    columns = steps(time_s=None) | {column: [1, 2, 4, 5]}
    form = LogFormat(time_column=column, time_unit=unit, seconds_per_cycle=7)
    episode = read_measured_log(write(tmp_path, columns), form)
    np.testing.assert_allclose(episode.time, np.array([0, 1, 3, 4]) * seconds, rtol=1e-12)


def test_bend_of_the_sheath_is_the_column_unless_one_is_given(tmp_path):
    log = write(tmp_path, steps(sheath_bend_deg=[0, 0, 90, 90]))
    np.testing.assert_allclose(read_measured_log(log).sheath_bend, np.radians([0, 0, 90, 90]))
    given = read_measured_log(log, LogFormat(sheath_bend_deg=45))
    np.testing.assert_allclose(given.sheath_bend, np.full(4, np.pi / 4))
    assert given.metadata["sheath_bend_deg"] == 45
    assert given.metadata["sheath_bend_column"] is None


def test_one_tension_alone_is_warned_of_and_left_out(tmp_path):
    said = []
    log = write(tmp_path, steps(tension_b_n=[1, 2, 3, 4]))
    assert read_measured_log(log, on_warning=said.append).wire_tension.shape == (4, 2, 0)
    assert said == [f"{log} has tension_b_n but no tension_a_n: no tension is recorded"]


def test_a_gap_is_warned_of_with_its_line(tmp_path):
    time = np.arange(100) * 0.1
    time[60:] += 2.5
    columns = {"time_s": time, "command_deg": np.sin(time), "angle_deg": np.sin(time)}
    said = []
    log = write(tmp_path, columns)
    read_measured_log(log, on_warning=said.append)
    assert said == [f"{log} line 62: a gap of 26 times the usual step comes before it"]
    said.clear()
    read_measured_log(write(tmp_path, columns | {"time_s": np.arange(100)}), on_warning=said.append)
    assert said == []


@pytest.mark.parametrize(
    ("columns", "form", "fault"),
    [
        (steps(), {"angle_column": "angle"}, "no column angle; its columns: time_s, command_deg, angle_deg"),
        (steps(), {"tension_a_column": "angle_deg"}, "no column tension_b_n"),
        (steps(time_s=None), {}, "no column time_s or phase_rad"),
        (steps(angle_deg=[0, 1, "inf", 2]), {}, "line 4: angle_deg is 'inf', not a finite number"),
        (steps(angle_deg=[0, 1, "1;5", 2]), {}, "line 4: angle_deg is '1;5', not a finite number"),
        (steps(angle_deg=["", 1, "nan", ""]), {}, "angle_deg is measured 1 times, a record needs two"),
        (steps(command_deg=[""] * 4), {}, "command_deg is missing in every row"),
        (steps(command_deg=[1, "", 1, ""]), {}, "command_deg is 1 in every row: a log without motion"),
        (steps(time_s=["nan"] * 4), {}, "time_s is missing in every row"),
        (steps(time_s=[0, 1, "soon", 2]), {}, "line 4: time_s is 'soon', not a finite number"),
        (steps(time_s=[0, "", 0, 0]), {}, "all rows have the same time_s"),
        (steps(time_s=[0, 1, 2, 1e10]), {}, "line 5: time_s is 1e+10 s, which is not from -9.2e+09"),
        (
            steps(command_deg=[0, 0.1, 1e308, 0]),
            {"command_unit": "m"},
            "line 4: command_deg is inf mm of pull",
        ),
        (steps(sheath_bend_deg=[0, "", 0, 0]), {}, "line 3: sheath_bend_deg is missing"),
        (steps(tension_a_n=[0, "", 1, 1], tension_b_n=[0] * 4), {}, "line 3: tension_a_n is missing"),
        (steps(time_s=[0, 1, 0.5, 2]), {}, "line 4: time_s runs backwards, as in 1 of 4 rows: at most 10%"),
        (steps(time_s=None, phase_rad=[0, 1, 0.5, 2]), {}, "line 4: phase_rad runs backwards"),
        (steps(time_s=[1, 1, 1, 1]), {}, "all rows have the same time_s"),
        (steps(command_deg=[7, 7, 7, 7]), {}, "command_deg is 7 in every row: a log without motion"),
        (steps(drive=[0, 1, 2, 3]), {"command_column": "drive"}, "give `command_unit`, mm, m, deg or rad"),
        (steps(tip=[0, 1, 2, 3]), {"angle_column": "tip"}, "give `angle_unit`, deg or rad"),
        (steps(t=[0, 1, 2, 3]), {"time_column": "t"}, "give `time_unit`, s, ms, us, ns or rad"),
        (steps(), {"angle_unit": "mm"}, "angle_unit = mm: must be deg or rad"),
        (steps(angle_deg=[0, 1, 30, 1]), {"angle_unit": "rad"}, "line 4: angle_deg is 1718.87 deg, which is"),
        (steps(angle_deg=[0, -721, 0, 1]), {}, "from -720 to 720: check `angle_unit`"),
        (steps(command_deg=[0, 1, 2, 60]), {"command_unit": "rad"}, "line 5: command_deg is 600 mm of pull"),
        (
            steps(command_deg=[0, 1, 2, -60]),
            {"command_unit": "rad"},
            "check `command_unit` and `pulley_radius`",
        ),
        (steps(tension_a_n=[0] * 4, tension_b_n=[0, 0, 1200, 0]), {}, "line 4: tension_b_n is 1200 N"),
        (steps(tension_a_n=[-6] * 4, tension_b_n=[0] * 4), {}, "line 2: tension_a_n is -6 N"),
        (steps(sheath_bend_deg=[0, -1, 0, 0]), {}, "line 3: sheath_bend_deg is -1 deg"),
        (steps(), {"sheath_bend_deg": -1.0}, "sheath_bend_deg = -1: must be from 0 to 1440"),
        (steps(), {"pulley_radius": 0.0}, "`pulley_radius` is 0 m: must be positive"),
        (steps(), {"seconds_per_cycle": np.nan}, "seconds_per_cycle = nan: must be positive"),
    ],
)
def test_a_log_that_cannot_be_is_refused(tmp_path, columns, form, fault):
    with pytest.raises(ValueError, match=r"^[^\n]*$") as caught:
        read_measured_log(write(tmp_path, columns), LogFormat(**form))
    assert fault in str(caught.value)
