"""Outputs are checked before the work, and folders made for them go again if they stay empty."""

import pytest

from scripts.outputs import keep_folders, output_file, output_folder, remove_empty_folders
from twin.files.atomic import MADE_BY, claim


@pytest.fixture(autouse=True)
def no_former_folders():
    keep_folders()


def test_folders_that_stay_empty_are_removed_and_no_others(tmp_path):
    (tmp_path / "theirs").mkdir()
    output_file(tmp_path / "theirs" / "a" / "b" / "model.json")
    output_folder(tmp_path / "results")
    (tmp_path / "results" / "figure.png").write_text("")
    remove_empty_folders()
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["figure.png", "results", "theirs"]


def test_the_files_of_others_are_not_replaced(tmp_path):
    (tmp_path / "notes.md").write_text("mine")
    (tmp_path / "model.json").write_text('{"rmse_deg": 1}')
    output_file(tmp_path / "model.json", (".json",), '"rmse_deg"')
    with pytest.raises(ValueError, match=r"notes\.md is there and no such command made it"):
        output_file(tmp_path / "model.json", (".json",), '"rmse_deg"', companions={"notes.md": MADE_BY})
    with pytest.raises(ValueError, match=r"model\.json is there and no such command made it"):
        output_folder(tmp_path, {"model.json": '"protocol"'})


def test_an_output_that_is_an_input_is_refused_by_whatever_name(tmp_path):
    data = tmp_path / "data.mp4"
    data.write_text(MADE_BY)
    (tmp_path / "folder").mkdir()
    for name in (data, tmp_path / "folder" / ".." / "data.mp4"):
        with pytest.raises(ValueError, match="is what is read: name another file"):
            output_file(name, (".mp4",), inputs=[tmp_path / "nothing", data])


def test_a_parent_that_is_a_file_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match=r"^cannot write to the folder .*/file/a: Not a directory$"):
        output_file(tmp_path / "file" / "a" / "model.json")


def test_a_folder_that_another_run_has_taken_stays_although_it_is_empty(tmp_path):
    """Of several runs at once, one that is refused must not remove what the first is about to fill."""
    folder = output_folder(tmp_path / "out")
    with claim(folder):
        remove_empty_folders()
    assert folder.is_dir()
