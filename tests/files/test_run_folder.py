"""A run folder belongs to one configuration and one process, and counts its processor time."""

import contextlib
import os
import time

import pytest

from twin.files.run_folder import COST_FILE, claim_folder, counted_cost, open_run, read_cost

MINE = {"seed": 1}


def test_run_is_taken_up_again_and_another_one_is_refused(tmp_path):
    for _ in range(2):
        with open_run(tmp_path / "run", MINE, ("net.onnx",)):
            pass
    with (
        pytest.raises(ValueError, match="holds a run of another configuration"),
        open_run(tmp_path / "run", {"seed": 2}, ("net.onnx",)),
    ):
        pass
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["config.yaml"]


def test_what_differs_is_named(tmp_path):
    mine = {"training": {"seed": 1, "noises": ["a", "b"], "rate": 0.1}, "preset": {"name": "x"}}
    claim_folder(tmp_path, mine)
    theirs = {"training": {"seed": 2, "noises": ["a", "c"], "rate": 0.1}, "preset": {"name": "x", "mass": 1}}
    expected = r"another configuration \(training.seed, training.noises, preset.mass\): choose"
    with pytest.raises(ValueError, match=expected):
        claim_folder(tmp_path, theirs)
    claim_folder(tmp_path, mine)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"", b"seed: 1\n" * 300_000])
def test_foreign_configuration_is_refused_and_kept(tmp_path, content):
    (tmp_path / "config.yaml").write_bytes(content)
    with pytest.raises(ValueError, match="holds a run of another configuration"):
        claim_folder(tmp_path, MINE)
    assert (tmp_path / "config.yaml").read_bytes() == content


def test_configuration_that_is_no_file_is_refused(tmp_path):
    outside = tmp_path / "outside.yaml"
    outside.write_text("seed: 1\n")
    for number, make in enumerate((os.mkdir, os.mkfifo, lambda path: os.symlink(outside, path))):
        folder = tmp_path / str(number)
        folder.mkdir()
        make(folder / "config.yaml")
        with pytest.raises(ValueError, match=r"config\.yaml is no file"):
            claim_folder(folder, MINE)
    assert outside.read_text() == "seed: 1\n"


@pytest.mark.parametrize("name", ["progress.csv", "net.onnx"])
def test_file_of_no_run_is_not_overwritten(tmp_path, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(ValueError, match=f"holds {name} without"), open_run(tmp_path, MINE, ("net.onnx",)):
        pass
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_one_run_at_a_time(tmp_path):
    with (
        open_run(tmp_path, MINE, ()),
        pytest.raises(ValueError, match="another run is writing into"),
        open_run(tmp_path, MINE, ()),
    ):
        pass


def work(seconds):
    until = time.process_time() + seconds
    while time.process_time() < until:
        pass


def test_processor_time_is_counted_and_waiting_is_not(tmp_path):
    assert read_cost(tmp_path) is None
    with counted_cost(tmp_path):
        work(0.2)
        time.sleep(0.5)
    assert 0.15 <= read_cost(tmp_path) < 0.6


def test_parts_of_a_run_that_was_stopped_add_up(tmp_path):
    with counted_cost(tmp_path):
        work(0.2)
    first = read_cost(tmp_path)
    with contextlib.suppress(KeyboardInterrupt), counted_cost(tmp_path):
        work(0.2)
        raise KeyboardInterrupt
    assert read_cost(tmp_path) >= first + 0.15


@pytest.mark.parametrize(
    ("content", "rule"),
    [
        ("{}", "processor_s is missing"),
        ('{"processor_s": -1}', "processor_s = -1: must be"),
        ("[1]", "is not a JSON object"),
        ('{"processor_s": 1,', "is not JSON"),
    ],
)
def test_a_file_of_that_name_that_is_something_else_is_named_and_stays(tmp_path, content, rule):
    path = tmp_path / COST_FILE
    path.write_text(content)
    with pytest.raises(ValueError, match=COST_FILE) as refused, counted_cost(tmp_path):
        raise AssertionError("it was begun")
    assert rule in str(refused.value)
    assert path.read_text() == content
