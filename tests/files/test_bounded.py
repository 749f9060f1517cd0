"""Only regular files are read, and of them no more than asked for."""

import os

import pytest

from twin.errors import InputError, MissingFileError
from twin.files.bounded import read_limited


def test_a_file_up_to_the_limit_is_read_and_a_larger_one_refused(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_limited(path, 5) == b"12345"
    with pytest.raises(InputError, match="has 5 bytes or more: at most 4 are read"):
        read_limited(path, 4)
    os.truncate(path, 2**40)  # a hole, of which nothing is read
    with pytest.raises(InputError, match="at most 10 are read"):
        read_limited(path, 10)


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(MissingFileError, match="no file"):
        read_limited(tmp_path / "none", 9)
    with pytest.raises(MissingFileError, match="no file"):
        read_limited(tmp_path / "none" / "a", 9)
    with pytest.raises(InputError, match="is a folder"):
        read_limited(tmp_path, 9)
    os.mkfifo(tmp_path / "pipe")
    for path in ("/dev/zero", tmp_path / "pipe"):  # a pipe without a writer does not block
        with pytest.raises(InputError, match="is no regular file"):
            read_limited(path, 9)
    with pytest.raises(InputError, match="is no name of a file"):
        read_limited("a\0b", 9)
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(InputError, match="cannot be read"):
        read_limited(tmp_path / "loop", 9)
    with pytest.raises(InputError, match="cannot be read"):
        read_limited(tmp_path / ("x" * 300), 9)


def test_a_read_that_fails_names_the_file(tmp_path):
    (tmp_path / "bad.yaml").symlink_to("/proc/self/mem")  # nothing is mapped at its begin: EIO
    with pytest.raises(OSError, match=r"Input/output error: '.*bad\.yaml'"):
        read_limited(tmp_path / "bad.yaml", 9)
