"""The folder of an export: whole or not there, whatever stops the command."""

import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from exporting import make_records, run
from recorded import make_episode
from repository import endotwin

import twin.export.export
from twin.files.whole_folder import WholeFolder
from twin.recording import write_episode

pytest.importorskip("pyarrow")


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return make_records(tmp_path / "data")


def hidden(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize("form", ["parquet", "csv"])
def test_a_disk_that_fills_up_leaves_nothing_and_one_line(tmp_path, form):
    write_episode(tmp_path / "long.mcap", make_episode(3000, vertebrae=16, elements=10))

    def little_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    words = ["export", "long.mcap", "--out", "le", "--format", form]
    done = endotwin(*words, cwd=tmp_path, preexec_fn=little_room)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == f"endotwin export: {tmp_path / 'le'}: File too large"
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["long.mcap"]


def test_a_stopped_export_leaves_nothing(data, tmp_path, capsys, monkeypatch):
    def stop(path: Path, episode: object, everything: bool) -> None:
        Path(path).write_text("half")
        raise KeyboardInterrupt

    monkeypatch.setattr(twin.export.export, "write_csv", stop)
    code, _, err = run(capsys, data, "--out", tmp_path / "le", "--format", "csv")
    assert (code, err) == (130, "endotwin export: stopped")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data"]


def test_a_folder_is_there_when_whole(tmp_path):
    (tmp_path / "le").mkdir()  # an empty one may be there
    with WholeFolder(tmp_path / "le") as folder:
        (folder / "a").write_text("whole")
        assert list((tmp_path / "le").iterdir()) == []
        with pytest.raises(ValueError, match="another run is writing"), WholeFolder(tmp_path / "le"):
            pass
    assert [path.name for path in (tmp_path / "le").iterdir()] == ["a"]
    assert hidden(tmp_path) == []


WRITE = """
import os, sys
from twin.files.whole_folder import WholeFolder
with WholeFolder(sys.argv[1]) as folder:
    (folder / "half").write_text("half")
    os.kill(os.getpid(), 9)
"""


def test_what_a_killed_process_left_is_removed_and_what_is_named_alike_is_not(tmp_path):
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    (theirs / "thesis").write_text("years of work")
    (tmp_path / ".le.01234567.partial").symlink_to(theirs)
    (tmp_path / ".le.partial").symlink_to(theirs)
    for name in (".le.89abcdef.partial", ".le.x.partial"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "thesis").write_text("years of work")
    before = sorted(path.name for path in tmp_path.iterdir())

    for name in ("le", "[l]e"):  # a name that would match the other's, if taken as a pattern
        process = subprocess.run([sys.executable, "-c", WRITE, str(tmp_path / name)])
        assert process.returncode == -signal.SIGKILL
    assert len(hidden(tmp_path)) == 6
    with WholeFolder(tmp_path / "[l]e") as folder:
        (folder / "a").write_text("whole")
    assert len(hidden(tmp_path)) == 5
    with WholeFolder(tmp_path / "le") as folder:
        (folder / "a").write_text("whole")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*before, "le", "[l]e"])
    assert (theirs / "thesis").read_text() == "years of work"
    assert (tmp_path / ".le.89abcdef.partial" / "thesis").read_text() == "years of work"


def test_a_folder_that_another_made_meanwhile_is_not_overwritten(tmp_path):
    whole = WholeFolder(tmp_path / "le")
    (whole.__enter__() / "a").write_text("ours")
    (tmp_path / "le").mkdir()
    (tmp_path / "le" / "b").write_text("theirs")
    with pytest.raises(OSError, match="not empty") as caught:
        whole.__exit__(None, None, None)
    assert caught.value.filename == str(tmp_path / "le")
    assert [path.name for path in tmp_path.rglob("*")] == ["le", "b"]
