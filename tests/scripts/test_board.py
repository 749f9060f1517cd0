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


def test_a_resumed_run_that_writes_rows_again_shows_them_once(tmp_path):
    for counts in ((1, 2), (1, 2, 3), (3,)):
        board = Board([tmp_path])
        for count in counts:
            write_curve(tmp_path, ROWS[:count], COLUMNS)
            board()
        board.close()
    assert [step for step, _ in scalars(tmp_path)["training/mean_reward"]] == [100, 200, 300]


def test_training_with_the_option_writes_events_of_the_whole_curve(workspace, tmp_path):
    out = tmp_path / "run"
    words = f"{workspace}/data/train --model {workspace}/coleman_hodgdon.json --episodes 8 --tensorboard"
    assert main([*words.split(), "--out", str(out)]) == 0
    with (out / CURVE_FILE).open() as file:
        rows = [(int(row["samples"]), float(row["mean_reward"])) for row in csv.DictReader(file)]
    assert scalars(out)["training/mean_reward"] == [
        (samples, pytest.approx(reward, rel=1e-5)) for samples, reward in rows
    ]
