"""Imports into one folder at the same time, and imports that are killed: the index is right in the end."""

import filecmp
import json
import random
import signal
import subprocess
import time

import pytest
from csv_logs import LOOP, steps, write
from repository import ENVIRONMENT, command

from twin.dataset.verify import verify
from twin.measured import folder as measured_folder
from twin.measured.folder import write_measured
from twin.measured.log import read_measured_log


def start(csv, folder):
    return subprocess.Popen(
        command("import", csv, "--out", folder),
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
    )


def leave_unlisted(monkeypatch, folder, name, log):
    """State of a folder after an import that was killed between its file and the index."""
    with monkeypatch.context() as patch:
        patch.setattr(measured_folder, "write_contents", lambda *_: None)
        return write_measured(folder, name, log)


def same_files(one, other):
    names = sorted(path.name for path in one.glob("[!.]*"))
    assert names == sorted(path.name for path in other.glob("[!.]*"))
    return filecmp.cmpfiles(one, other, names, shallow=False)[0] == names


def test_four_imports_at_once_are_all_listed(tmp_path):
    folder = tmp_path / "out"
    logs = [write(tmp_path, steps(angle_deg=[0, n, 1, 2]), f"log_{n}.csv") for n in range(4)]
    runs = [start(log, folder) for log in logs]
    for run in runs:
        _, said = run.communicate(timeout=120)
        assert run.returncode == 0, said
    names = [f"log_{n}.mcap" for n in range(4)]
    assert sorted(path.name for path in folder.iterdir()) == ["dataset.json", *names]
    assert [file["name"] for file in json.loads((folder / "dataset.json").read_text())["files"]] == names
    assert verify(folder) == ([], 4)


def test_what_a_killed_import_left_unlisted_is_taken_up_by_itself_and_by_others(tmp_path, monkeypatch):
    one = read_measured_log(write(tmp_path, LOOP, "one.csv"))
    two = read_measured_log(write(tmp_path, steps(), "two.csv"))
    for name in ("undisturbed", "itself", "others"):
        (tmp_path / name).mkdir()
    for name, log in (("one", one), ("two", two)):
        write_measured(tmp_path / "undisturbed", name, log)
    leave_unlisted(monkeypatch, tmp_path / "itself", "one", one)
    for name, log in (("one", one), ("two", two)):
        write_measured(tmp_path / "itself", name, log)
    assert same_files(tmp_path / "itself", tmp_path / "undisturbed")
    leave_unlisted(monkeypatch, tmp_path / "others", "one", one)
    write_measured(tmp_path / "others", "two", two)
    assert verify(tmp_path / "others") == ([], 2)
    write_measured(tmp_path / "others", "one", one)
    assert same_files(tmp_path / "others", tmp_path / "undisturbed")


def test_what_it_left_of_another_csv_file_is_not_written_over(tmp_path, monkeypatch):
    one = read_measured_log(write(tmp_path, LOOP, "one.csv"))
    two = read_measured_log(write(tmp_path, steps(), "two.csv"))
    path = leave_unlisted(monkeypatch, tmp_path, "log", one)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=r"log\.mcap is the log of another CSV file"):
        write_measured(tmp_path, "log", two)
    assert path.read_bytes() == before


@pytest.mark.parametrize("kills", [1, pytest.param(50, marks=pytest.mark.endurance)])
def test_an_import_that_was_killed_can_be_run_again(tmp_path, kills):
    rng = random.Random(kills)
    other = read_measured_log(write(tmp_path, steps(), "other.csv"))
    log = write(tmp_path, LOOP, "log.csv")
    undisturbed = tmp_path / "undisturbed"
    undisturbed.mkdir()
    write_measured(undisturbed, "other", other)
    begun = time.monotonic()
    assert start(log, undisturbed).wait() == 0
    usual = time.monotonic() - begun
    for kill in range(kills):
        folder = tmp_path / f"killed_{kill}"
        folder.mkdir()
        write_measured(folder, "other", other)
        run = start(log, folder)
        time.sleep(rng.uniform(0.5, 1.1) * usual)
        run.send_signal(signal.SIGKILL)
        run.communicate()
        _, said = (again := start(log, folder)).communicate(timeout=120)
        assert again.returncode == 0, said
        assert same_files(folder, undisturbed)


def test_what_was_renamed_or_linked_is_not_taken_up(tmp_path, monkeypatch):
    one = read_measured_log(write(tmp_path, LOOP, "one.csv"))
    path = leave_unlisted(monkeypatch, tmp_path, "log", one)
    renamed = path.rename(tmp_path / "other.mcap")
    with pytest.raises(ValueError, match=r"other\.mcap, which no import wrote"):
        write_measured(tmp_path, "log", one)
    path.symlink_to(renamed.rename(tmp_path / "kept"))
    with pytest.raises(ValueError, match=r"log\.mcap, which no import wrote"):
        write_measured(tmp_path, "log", one)
    path.unlink()
    (tmp_path / "dataset.json").symlink_to(tmp_path / "nowhere")
    with pytest.raises(ValueError, match=r"dataset\.json is a link"):
        write_measured(tmp_path, "log", one)
