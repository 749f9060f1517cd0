"""Progress of long work: a bar on a terminal, a line from time to time in a file."""

import time
from unittest import mock

from scripts.progress import Progress


def test_a_file_gets_a_line_every_ten_seconds_with_the_time_that_is_left(capsys, monkeypatch):
    clock = mock.Mock(side_effect=[0.0, 4.0, 10.0, 14.0, 40.0])
    monkeypatch.setattr(time, "monotonic", clock)
    progress = Progress("train", "step")
    for done in (100, 140, 200, 240, 500):  # a run that goes on from 100
        progress(done, 600, "error 2 deg")
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "train: 33 %, 0:40 min left, error 2 deg",
        "train: 83 %, 0:10 min left, error 2 deg",
    ]


def test_a_file_gets_nothing_of_short_work(capsys):
    progress = Progress("export")
    for done in range(4):
        progress(done, 3)
    Progress("nothing")(0, 0)
    Progress.close_all()
    assert capsys.readouterr().err == ""


def test_a_terminal_gets_a_bar(capsys):
    with mock.patch("sys.stderr.isatty", return_value=True):
        progress = Progress("export", "ep")
        progress(1, 2)
        progress(2, 2)
    assert "100%" in capsys.readouterr().err
