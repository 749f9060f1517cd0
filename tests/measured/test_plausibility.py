"""Logs whose units are hardly those that were stated: a warning each, and no refusal."""

import numpy as np
import pytest
from csv_logs import write

from twin.measured.log import LogFormat, oddities, read_measured_log

TIME = np.arange(400) / 20
KNOB = 45 * np.sin(TIME)  # [deg], of a pulley of 10 mm: 16 mm in all


def log(folder, *, time=TIME, command=KNOB, angle=2 * KNOB, name="command_deg", clock="time_s", **form):
    columns = {clock: time, name: command, "angle_deg": angle}
    form = LogFormat(command_column=name, time_column=clock, **form)
    return read_measured_log(write(folder, columns), form)


def test_a_log_as_endoscopes_leave_them_is_not_warned_of(tmp_path):
    assert oddities(log(tmp_path)) == []
    assert oddities(log(tmp_path, command=KNOB / 30, name="pull_mm")) == []
    assert oddities(log(tmp_path, time=TIME, clock="phase_rad")) == []


@pytest.mark.parametrize(
    ("odd", "warning"),
    [
        ({"command": KNOB * 1e-4, "name": "pull_mm"}, "pull_mm ranges over 0.009 mm of pulling distance, un"),
        (
            {"command": KNOB * 2, "name": "pull_mm"},
            "180 mm of pulling distance, unusually much (more than 100",
        ),
        (
            {"command": np.radians(KNOB)},
            "command_deg ranges over 1.57 deg, unusually little (less than 5 deg)",
        ),
        ({"command": KNOB * 20, "pulley_radius": 1e-3}, "over 1.8e+03 deg, unusually much (more than 1080"),
        (
            {"pulley_radius": 1e-5},
            "0.0157 mm of pulling distance, unusually little (less than 0.1 mm): check",
        ),
        ({"angle": np.radians(KNOB)}, "angle_deg ranges over 1.57 deg, unusually little (less than 5 deg)"),
        ({"angle": KNOB * 15}, "angle_deg ranges over 1.35e+03 deg, unusually much (more than 540 deg)"),
        ({"time": TIME * 1000}, "time_s steps by 50 s, unusually much (more than 2 s): check `time_unit`"),
        (
            {"clock": "t_ms"},
            "t_ms steps by 5e-05 s, unusually little (less than 0.0001 s): check `time_unit`",
        ),
        ({"time": TIME / 25}, "time_s ranges over 0.798 s, unusually little (less than 1 s): check"),
        ({"time": np.degrees(TIME), "clock": "phase_rad"}, "9.12 s, unusually much (more than 2 s): check"),
    ],
)
def test_a_range_of_another_unit_is_warned_of(tmp_path, odd, warning):
    (line,) = oddities(log(tmp_path, **odd))
    assert warning in line
    assert "check `" in line
    assert "\n" not in line
