"""Events for TensorBoard: read back by its own reader, they are the rows of the learning curve."""

import csv

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from rl.run import write_curve
from scripts.board import EVENTS_FOLDER, Board
from scripts.train import main
from twin.files.run_folder import CURVE_FILE

COLUMNS = ("samples", "mean_reward", "kl")
ROWS = [(100, -3.5, float("nan")), (200, -2.25, 0.01), (300, -1.0, 0.02)]


def scalars(folder):
    accumulator = EventAccumulator(str(folder / EVENTS_FOLDER))
    accumulator.Reload()
    return {
        tag: [(event.step, event.value) for event in accumulator.Scalars(tag)]
        for tag in accumulator.Tags()["scalars"]
    }


def test_rows_are_shown_once_as_they_come(tmp_path):
    board = Board([tmp_path])
    board()  # before there is a curve
    for count in (1, 1, 2, 3):
        write_curve(tmp_path, ROWS[:count], COLUMNS)
        board()
    board.close()
    found = scalars(tmp_path)
    assert found["training/mean_reward"] == [(samples, reward) for samples, reward, _ in ROWS]
    assert found["training/kl"] == [(200, pytest.approx(0.01)), (300, pytest.approx(0.02))]


def test_a_resumed_run_that_tells_rows_again_shows_them_once(tmp_path):
    for counts in ((1, 2), (1, 2, 3), (3,)):
        board = Board([tmp_path])
        for count in counts:
            write_curve(tmp_path, ROWS[:count], COLUMNS)
            board()
        board.close()
    assert [step for step, _ in scalars(tmp_path)["training/mean_reward"]] == [100, 200, 300]


def test_a_folder_that_a_training_refuses_is_left_as_it_is(tmp_path, capsys):
    (tmp_path / CURVE_FILE).write_text("mine\n1\n")
    assert main(["--protocol", "twins", "--tensorboard", "--out", str(tmp_path)]) == 2
    assert "progress.csv without the config.yaml of its run" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir() if not path.name.startswith(".")] == [CURVE_FILE]


def test_training_with_the_option_writes_events_of_the_whole_curve(tmp_path):
    out = tmp_path / "run"
    options = ["--protocol", "twins", "--episodes", "1", "--seed", "1", "--tensorboard"]
    assert main([*options, "--out", str(out)]) == 0
    with (out / CURVE_FILE).open() as file:
        rows = [(int(row["samples"]), float(row["mean_reward"])) for row in csv.DictReader(file)]
    assert scalars(out)["training/mean_reward"] == [
        (samples, pytest.approx(reward, rel=1e-5)) for samples, reward in rows
    ]
