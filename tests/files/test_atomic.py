"""Files that appear whole or not at all, and replace nothing but files."""

import errno
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import twin.files.atomic
from twin.files.atomic import WholeFile, write_whole


@pytest.fixture(params=["nameless", "named"])
def system(request, monkeypatch):
    """A system with files that have no name, and one without."""
    if request.param == "named":
        monkeypatch.setattr(twin.files.atomic, "_open_nameless", lambda folder: None)
    elif twin.files.atomic._open_nameless("/tmp") is None:
        pytest.skip("this system makes no file without a name")
    return request.param


def test_failure_of_a_block_leaves_the_former_file_and_names_it(system, tmp_path):
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


def test_a_library_that_fails_on_the_open_path_is_told_by_the_final_name(system, tmp_path):
    whole = WholeFile(tmp_path / "a.bin")
    with pytest.raises(OSError, match="No space") as failed, whole:
        raise OSError(errno.ENOSPC, "No space left on device", whole.open_path)
    assert failed.value.filename == str(tmp_path / "a.bin")


def test_what_is_no_file_is_not_replaced_and_no_link_followed(system, tmp_path):
    (tmp_path / "taken" / "inside").mkdir(parents=True)
    (tmp_path / "theirs").write_text("theirs")
    (tmp_path / "link").symlink_to("theirs")
    (tmp_path / "dangling").symlink_to("elsewhere")
    os.mkfifo(tmp_path / "pipe")
    for name, rule in (("taken", "is a folder"), ("pipe", "is no file")):
        with pytest.raises(ValueError, match=rf"{name} .*{rule}"):
            write_whole(tmp_path / name, "text")
    for name in ("link", "dangling"):
        with pytest.raises(ValueError, match="is a link, which is not followed"):
            write_whole(tmp_path / name, "text")
    with pytest.raises(FileNotFoundError, match=r"no folder .*nothing to write b\.txt into"):
        write_whole(tmp_path / "nothing" / "b.txt", "text")
    assert (tmp_path / "theirs").read_text() == "theirs"
    assert sorted(os.listdir(tmp_path)) == ["dangling", "link", "pipe", "taken", "theirs"]


def test_file_has_no_name_until_it_is_whole(system, tmp_path):
    for text in (b"first", b"second"):  # where nothing is, and over a file of ours
        with WholeFile(tmp_path / "a.bin") as file:
            file.write(text)
            hidden = [name for name in os.listdir(tmp_path) if name != "a.bin"]
            assert len(hidden) == (system == "named")
            assert all(name.startswith(".a.bin.") for name in hidden)
        assert (tmp_path / "a.bin").read_bytes() == text
        assert os.listdir(tmp_path) == ["a.bin"]


def test_library_writes_by_the_open_path(system, tmp_path):
    numbers = np.arange(1000.0)
    whole = WholeFile(tmp_path / "a.npy")
    with whole, open(whole.open_path, "wb") as file:
        np.save(file, numbers)
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), numbers)


def test_modes_are_those_of_any_new_file(system, tmp_path):
    (tmp_path / "plain").write_text("")
    write_whole(tmp_path / "whole", "")
    assert (tmp_path / "whole").stat().st_mode == (tmp_path / "plain").stat().st_mode


WRITE_FOR_EVER = """
import sys
from twin.files.atomic import WholeFile
while True:
    with WholeFile(sys.argv[1]) as file:
        print("open", flush=True)
        for _ in range(50):
            file.write(bytes(100_000))
"""


def test_a_killed_process_leaves_nothing(tmp_path):
    if twin.files.atomic._open_nameless(tmp_path) is None:
        pytest.skip("this system makes no file without a name")
    for kill in range(5):
        words = [sys.executable, "-c", WRITE_FOR_EVER, str(tmp_path / "a")]
        process = subprocess.Popen(words, stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(0.003 * kill)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        assert set(os.listdir(tmp_path)) <= {"a"}
        if (tmp_path / "a").exists():
            assert (tmp_path / "a").stat().st_size == 5_000_000
