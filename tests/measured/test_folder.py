"""A folder of measured logs lists them, and takes the place of nothing else."""

import hashlib
import json

import numpy as np
import pytest
from csv_logs import LOOP, steps, write

from twin.measured.folder import write_measured
from twin.measured.log import LogFormat, read_measured_log
from twin.recording import read_dataset, read_episode


def test_logs_share_a_folder_that_lists_them(tmp_path):
    first = read_measured_log(write(tmp_path, LOOP, "one.csv"))
    second = read_measured_log(write(tmp_path, steps(sheath_bend_deg=[9] * 4), "two.csv"))
    paths = [write_measured(tmp_path, name, log) for name, log in (("b", first), ("a", second))]
    listed = json.loads((tmp_path / "dataset.json").read_text())
    assert listed["source"] == "measured"
    assert [entry["name"] for entry in listed["files"]] == ["a.mcap", "b.mcap"]
    assert [entry["samples"] for entry in listed["files"]] == [4, len(first.time)]
    for entry, path in zip(listed["files"], reversed(paths), strict=True):
        assert entry["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    read = read_dataset(tmp_path)
    assert [log.metadata["name"] for log in read] == ["a", "b"]
    np.testing.assert_allclose(read[1].pull, first.pull, atol=1e-15)
    np.testing.assert_array_equal(read[1].wire_tension, first.wire_tension)
    np.testing.assert_allclose(read[0].sheath_bend, second.sheath_bend, rtol=1e-12)


def test_the_same_log_may_be_read_again_and_gives_the_same_bytes(tmp_path):
    log = write(tmp_path, LOOP)
    once = write_measured(tmp_path, "log", read_measured_log(log)).read_bytes()
    assert write_measured(tmp_path, "log", read_measured_log(log)).read_bytes() == once
    write_measured(tmp_path, "log", read_measured_log(log, LogFormat(pulley_radius=0.02)))
    assert read_episode(tmp_path / "log.mcap").metadata["pulley_radius"] == 0.02
    assert len(json.loads((tmp_path / "dataset.json").read_text())["files"]) == 1


def test_another_log_does_not_take_the_place_of_one_unless_that_is_removed(tmp_path):
    path = write_measured(tmp_path, "log", read_measured_log(write(tmp_path, LOOP)))
    other = read_measured_log(write(tmp_path, steps()))
    with pytest.raises(ValueError, match=r"log\.mcap is the log of another CSV file: choose another `name`"):
        write_measured(tmp_path, "log", other)
    assert len(read_episode(path).time) > 4
    path.unlink()
    write_measured(tmp_path, "log", other)
    assert len(read_episode(path).time) == 4


@pytest.mark.parametrize(
    ("name", "content", "fault"),
    [
        ("dataset.json", '{"preset": {}, "files": []}', "dataset.json .*source is missing"),
        ("dataset.json", '{"source": "simulated", "files": []}', "dataset.json .*endotwin is missing"),
        ("dataset.json", "{", "dataset.json is damaged"),
        ("dataset.json", '{"source": "measured", "files": [1]}', "dataset.json .* import again into"),
        ("episode_0000.mcap", "", "holds episode_0000.mcap, which no import wrote"),
        ("log.mcap", "", "holds log.mcap, which no import wrote"),
    ],
)
def test_a_folder_of_other_files_is_left_alone(tmp_path, name, content, fault):
    episode = read_measured_log(write(tmp_path, LOOP))
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / name).write_text(content)
    with pytest.raises(ValueError, match=fault):
        write_measured(folder, "log", episode)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {name: content}


@pytest.mark.parametrize("name", ["", ".log", "..", "a/b", "/a", "a\\b"])
def test_a_name_that_is_no_file_name_is_refused(tmp_path, name):
    episode = read_measured_log(write(tmp_path, LOOP))
    with pytest.raises(ValueError, match="name = "):
        write_measured(tmp_path, name, episode)


def test_a_simulated_dataset_is_left_alone(tmp_path, dataset_copy):
    episode = read_measured_log(write(tmp_path, LOOP))
    before = {path.name: path.read_bytes() for path in dataset_copy.iterdir()}
    with pytest.raises(ValueError, match=r"dataset\.json that no import wrote: choose another `folder`"):
        write_measured(dataset_copy, "log", episode)
    assert {path.name: path.read_bytes() for path in dataset_copy.iterdir()} == before
