"""Files that appear whole or not at all."""

import errno

import numpy as np
import pytest

from twin.files.atomic import WholeFile, write_whole


def test_failure_of_a_block_leaves_the_former_file_and_names_it(tmp_path):
    path = tmp_path / "a.bin"
    write_whole(path, b"before")

    def fail(error: Exception) -> None:
        with WholeFile(path) as file:
            file.write(b"half")
            raise error

    with pytest.raises(OSError, match="No space") as failed:
        fail(OSError(errno.ENOSPC, "No space left on device"))  # as a full disk says it, without a name
    assert failed.value.filename == str(path)
    with pytest.raises(OSError, match="elsewhere") as failed:
        fail(OSError(errno.EIO, "Input/output error", "elsewhere"))
    assert failed.value.filename == "elsewhere"  # what is known better stays
    with pytest.raises(ValueError, match=r"^wrong$"):
        fail(ValueError("wrong"))
    assert path.read_bytes() == b"before"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.bin"]


def test_file_that_cannot_take_its_name_is_named_and_leaves_nothing(tmp_path):
    (tmp_path / "taken" / "inside").mkdir(parents=True)
    with pytest.raises(OSError, match="taken") as failed:
        write_whole(tmp_path / "taken", "text")
    assert failed.value.filename == str(tmp_path / "taken")
    assert [entry.name for entry in tmp_path.iterdir()] == ["taken"]
    with pytest.raises(FileNotFoundError, match=r"no folder .*nothing to write b\.txt into"):
        write_whole(tmp_path / "nothing" / "b.txt", "text")


def test_file_has_no_name_until_it_is_whole(tmp_path):
    with WholeFile(tmp_path / "a.bin") as file:
        file.write(np.arange(1000).tobytes())
        assert not (tmp_path / "a.bin").exists()
        assert [entry.name[:7] for entry in tmp_path.iterdir()] == [".a.bin."]
    assert (tmp_path / "a.bin").read_bytes() == np.arange(1000).tobytes()
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.bin"]
