"""A disk that fills up in the middle of a dataset: one clear line, nothing damaged, and it goes on later."""

import os
import subprocess
from pathlib import Path

import pytest
from recorded import make_episode
from repository import endotwin

from twin.files.atomic import write_whole
from twin.recording import read_episode, write_episode

EPISODES = 12
RECIPE = f"""
preset: {{name: small, vertebrae: 6, sheath_elements: 2, section_stiffness: 0.05, pretension: 3.0}}
episodes: {EPISODES}
seconds: 2
"""


def generate(folder: Path) -> subprocess.CompletedProcess[str]:
    recipe = folder.parent.parent / "recipe.yaml"
    recipe.write_text(RECIPE)
    words = f"generate {recipe} --out {folder} --workers 2 --format csv"
    return endotwin(*words.split(), cwd=recipe.parent)


@pytest.mark.slow
def test_full_disk_is_said_in_one_line_and_the_same_command_goes_on(small_disk, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    assert generate(tmp_path / "elsewhere" / "data").returncode == 0
    whole = {path.name: path.read_bytes() for path in (tmp_path / "elsewhere" / "data").iterdir()}
    needed = sum(map(len, whole.values())) // 1024

    folder = small_disk(needed // 2) / "data"
    refused = generate(folder)
    assert refused.returncode == 2
    assert refused.stdout == ""
    assert "Traceback" not in refused.stderr
    line = refused.stderr.splitlines()[-1]
    assert "No space left on device" in line
    assert f"of {EPISODES} episodes are complete; the same command continues" in line

    there = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert "dataset.json" not in there
    assert 0 < len([name for name in there if name.endswith(".mcap")]) < EPISODES
    for name, data in there.items():
        assert data == whole[name], f"{name} is not what it should be"

    small_disk(3 * needed)
    assert generate(folder).returncode == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == whole


def test_full_disk_leaves_no_part_of_an_episode(small_disk, tmp_path):
    episode = make_episode(samples=2000)
    disk = small_disk(64)
    with pytest.raises(OSError, match="No space left"):
        write_episode(disk / "a.mcap", episode)
    assert os.listdir(disk) == []
    small_disk(4096)
    assert len(read_episode(write_episode(disk / "a.mcap", episode)).time) == 2000


def test_full_disk_leaves_the_file_that_was_there(small_disk):
    disk = small_disk(64)
    path = disk / "a.txt"
    write_whole(path, "before")
    with pytest.raises(OSError, match="No space left") as caught:
        write_whole(path, b"x" * 200_000)
    assert caught.value.filename == str(path)
    assert path.read_text() == "before"
    assert os.listdir(disk) == ["a.txt"]
