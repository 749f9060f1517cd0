"""What is vouched for, and what a worker refuses to do."""

import dataclasses
from pathlib import Path

import pytest
from small_dataset import NAMES, RECIPE, SECOND, changed, contents, make

from twin.dataset.files import make_files
from twin.recording import read_episode, write_episode


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    make(tmp_path / "data", csv=True)
    return tmp_path / "data"


def test_file_whose_numbers_are_not_those_of_its_metadata_is_made_anew(folder):
    """As if it were thinned or recovered, under the name of the whole one."""
    whole = contents(folder)
    (folder / "dataset.json").unlink()
    episode = read_episode(folder / SECOND)
    write_episode(folder / SECOND, episode.resampled(0.04))
    third = read_episode(folder / NAMES[2])
    write_episode(folder / NAMES[2], dataclasses.replace(third, bend=third.bend + 0.01))
    written = make(folder, csv=True)
    assert written.damage[0] == f"{folder / SECOND} has 25 samples, its metadata states 50"
    assert written.damage[1].startswith(f"{folder / NAMES[2]}: max of truth_deg is")
    assert contents(folder) == whole


def test_late_task_of_a_run_that_is_over_does_not_write_into_the_next_dataset(folder):
    whole = contents(folder)
    other = changed(seconds=0.5)
    with pytest.raises(ValueError, match="is the folder of another dataset by now"):
        make_files(other, other.keys[:1], folder, {}, False)
    assert contents(folder) == whole


def test_worker_of_another_version_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"a worker has endotwin .*, here is endotwin 9: they must agree"):
        make_files(RECIPE, RECIPE.keys, tmp_path, {}, False, {"endotwin": "9"})
    assert list(tmp_path.iterdir()) == []
