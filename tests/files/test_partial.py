"""Files that grow under a name of their own: nothing that was left is overwritten, two do not mix."""

import os
import subprocess
import sys

import pytest
from repository import ENVIRONMENT

from twin.files.partial import PartialFile

SIGN = "our sign"


def written(path, text=SIGN):
    file = PartialFile(path, SIGN)
    assert file.write(text.encode()) == len(text)
    return file


def leave(path):
    """Write a file in a process that ends without completing it."""
    make = f"PartialFile({str(path)!r}, {SIGN!r})"
    code = f"from twin.files.partial import PartialFile; {make}.write(b'left here')"
    subprocess.run([sys.executable, "-c", code], env=ENVIRONMENT, check=True)


def test_it_has_a_name_from_its_first_byte_on_and_another_when_it_is_complete(tmp_path):
    file = written(tmp_path / "a.log")
    assert (tmp_path / "a.log.partial").read_text() == SIGN
    file.sync()
    file.write(b", and more")
    file.complete()
    assert os.listdir(tmp_path) == ["a.log"]
    assert (tmp_path / "a.log").read_text() == f"{SIGN}, and more"


def test_what_a_process_left_is_never_overwritten(tmp_path):
    for _ in range(3):
        leave(tmp_path / "a.log")
    names = ["a.log.partial", "a.log.partial.2", "a.log.partial.3"]
    assert sorted(os.listdir(tmp_path)) == names
    file = written(tmp_path / "a.log")
    assert file.partial.name == "a.log.partial.4"
    file.complete()
    assert {(tmp_path / name).read_text() for name in names} == {"left here"}
    assert sorted(os.listdir(tmp_path)) == ["a.log", *names]


def test_whatever_else_has_the_partial_name_stays(tmp_path):
    (tmp_path / "a.log.partial").mkdir()
    (tmp_path / "a.log.partial.2").symlink_to(tmp_path / "nowhere")
    os.mkfifo(tmp_path / "a.log.partial.3")
    written(tmp_path / "a.log").complete()
    assert len(os.listdir(tmp_path)) == 4
    assert not (tmp_path / "nowhere").exists()


def test_two_at_once_are_told_apart(tmp_path):
    file = written(tmp_path / "a.log")
    with pytest.raises(ValueError, match=r"another run is writing .*/a\.log"):
        PartialFile(tmp_path / "a.log", SIGN)
    file.complete()
    written(tmp_path / "a.log").complete()  # its like is replaced


def test_what_is_not_ours_is_refused_at_the_start_and_at_the_end(tmp_path):
    file = written(tmp_path / "a.log")
    (tmp_path / "a.log").write_text("thesis")
    with pytest.raises(ValueError, match="is there and no such command made it"):
        file.complete()
    file.close()
    with pytest.raises(ValueError, match="is there and no such command made it"):
        PartialFile(tmp_path / "a.log", SIGN)
    assert (tmp_path / "a.log").read_text() == "thesis"
    assert (tmp_path / "a.log.partial").read_text() == SIGN


def test_removed_or_not_made_it_leaves_nothing(tmp_path):
    file = written(tmp_path / "a.log")
    file.remove()
    assert os.listdir(tmp_path) == []
    with pytest.raises(FileNotFoundError, match="no folder"):
        PartialFile(tmp_path / "none" / "a.log", SIGN)


def test_full_disk_names_the_file(small_disk):
    disk = small_disk(64)
    file = PartialFile(disk / "a.log", SIGN)
    with pytest.raises(OSError, match="No space left") as caught:
        file.write(b"x" * 200_000)
    assert caught.value.filename == str(disk / "a.log.partial")
    file.close()
    assert os.listdir(disk) == ["a.log.partial"]
