"""The folder of an export: whole or not there, whatever stops the command."""

import resource
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


def test_a_folder_is_there_when_whole_and_what_a_killed_one_left_is_removed(tmp_path):
    left = tmp_path / ".le.partial" / "data"
    left.mkdir(parents=True)
    (left / "half.parquet").write_text("half")
    (tmp_path / "le").mkdir()  # an empty one may be there
    with WholeFolder(tmp_path / "le") as folder:
        assert list(folder.iterdir()) == []
        (folder / "a").write_text("whole")
        assert list((tmp_path / "le").iterdir()) == []
        with pytest.raises(ValueError, match="another run is writing"), WholeFolder(tmp_path / "le"):
            pass
    assert [path.name for path in (tmp_path / "le").iterdir()] == ["a"]
    assert hidden(tmp_path) == []


def test_a_folder_that_another_made_meanwhile_is_not_overwritten(tmp_path):
    whole = WholeFolder(tmp_path / "le")
    (whole.__enter__() / "a").write_text("ours")
    (tmp_path / "le").mkdir()
    (tmp_path / "le" / "b").write_text("theirs")
    with pytest.raises(OSError, match="not empty") as caught:
        whole.__exit__(None, None, None)
    assert caught.value.filename == str(tmp_path / "le")
    assert [path.name for path in tmp_path.rglob("*")] == ["le", "b"]
