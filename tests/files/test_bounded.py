"""Only regular files are read, and of them no more than asked for."""

import os
import subprocess
import sys

import pytest

from twin.errors import InputError, MissingFileError
from twin.files.bounded import read_limited


def test_a_file_up_to_the_limit_is_read_and_a_larger_one_refused(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_limited(path, 5) == b"12345"
    with pytest.raises(InputError, match="has 5 bytes or more: at most 4 are read"):
        read_limited(path, 4)


def test_a_hole_of_a_terabyte_is_not_read(tmp_path):
    path = tmp_path / "a"
    path.touch()
    os.truncate(path, 2**40)
    with pytest.raises(InputError, match="at most 10 are read"):
        read_limited(path, 10)


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(MissingFileError, match="no file"):
        read_limited(tmp_path / "none", 9)
    with pytest.raises(MissingFileError, match="no file"):
        read_limited(tmp_path / "none" / "a", 9)
    with pytest.raises(InputError, match="is a folder"):
        read_limited(tmp_path, 9)
    with pytest.raises(InputError, match="is no regular file"):
        read_limited("/dev/zero", 9)
    with pytest.raises(InputError, match="is no name of a file"):
        read_limited("a\0b", 9)
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(InputError, match="cannot be read"):
        read_limited(tmp_path / "loop", 9)
    with pytest.raises(InputError, match="cannot be read"):
        read_limited(tmp_path / ("x" * 300), 9)


def test_a_pipe_that_nobody_writes_into_does_not_block(tmp_path):
    os.mkfifo(tmp_path / "pipe.mcap")
    program = (
        "import sys\nfrom twin.errors import InputError\nfrom twin.recording import read_episode\n"
        "try:\n    read_episode(sys.argv[1])\nexcept InputError as error:\n    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, tmp_path / "pipe.mcap"], capture_output=True, text=True, timeout=60
    )
    assert done.stdout.strip().endswith("pipe.mcap is no regular file"), done.stderr[-300:]
