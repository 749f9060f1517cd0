"""Files and folders that appear whole or not at all, and replace nothing but what EndoTwin wrote."""

import errno
import multiprocessing
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from repository import ENVIRONMENT

from twin.files.atomic import (
    MADE_BY,
    PartialFile,
    WholeFile,
    WholeFolder,
    check_overwritable,
    claim,
    write_whole,
)

SIGN = "our sign"


def killed(code: str, path) -> None:
    """Run lines of a program that has imported the module, and kill it after them."""
    program = f"import os, sys\nfrom twin.files.atomic import *\n{code}\nos.kill(os.getpid(), 9)"
    process = subprocess.run([sys.executable, "-c", program, str(path)], env=ENVIRONMENT)
    assert process.returncode == -signal.SIGKILL


def test_failure_of_a_block_leaves_the_former_file_and_names_it(tmp_path):
    path = tmp_path / "a.bin"
    write_whole(path, b"before")

    def fail(error: Exception) -> None:
        with WholeFile(path) as file:
            file.write(b"half")
            raise error

    with pytest.raises(OSError, match="No space") as failed:
        fail(OSError(errno.ENOSPC, "No space left on device"))  # without a name, as of a full disk
    assert failed.value.filename == str(path)
    with pytest.raises(OSError, match="elsewhere") as failed:
        fail(OSError(errno.EIO, "Input/output error", "elsewhere"))
    assert failed.value.filename == "elsewhere"  # a better name stays
    whole = WholeFile(path)
    with pytest.raises(OSError, match="No space") as failed, whole:
        raise OSError(errno.ENOSPC, "No space left on device", whole.open_path)
    assert failed.value.filename == str(path)
    assert path.read_bytes() == b"before"
    assert os.listdir(tmp_path) == ["a.bin"]


def test_only_a_file_is_replaced_and_no_link_followed(tmp_path):
    (tmp_path / "taken" / "inside").mkdir(parents=True)
    (tmp_path / "theirs").write_text("theirs")
    (tmp_path / "link").symlink_to("theirs")
    (tmp_path / "dangling").symlink_to("elsewhere")
    os.mkfifo(tmp_path / "pipe")
    for name, rule in (
        ("taken", "is a folder"),
        ("pipe", "is no file"),
        ("link", "is a link"),
        ("dangling", "is a link"),
    ):
        for write in (lambda path: write_whole(path, "text"), check_overwritable):
            with pytest.raises(ValueError, match=rf"{name} .*{rule}"):
                write(tmp_path / name)
    with pytest.raises(FileNotFoundError, match=r"no folder .*nothing to write b\.txt into"):
        write_whole(tmp_path / "nothing" / "b.txt", "text")
    assert (tmp_path / "theirs").read_text() == "theirs"
    assert sorted(os.listdir(tmp_path)) == ["dangling", "link", "pipe", "taken", "theirs"]


def test_the_name_appears_when_the_file_is_complete_with_the_mode_of_any_new_file(tmp_path):
    for numbers in (np.arange(1000.0), np.zeros(3)):  # where nothing is, and over a file of ours
        whole = WholeFile(tmp_path / "a.npy")
        with whole, open(whole.open_path, "wb") as file:  # as a library opens it
            (hidden,) = (name for name in os.listdir(tmp_path) if name != "a.npy")
            assert hidden.startswith(".a.npy.")
            np.save(file, numbers)
        np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), numbers)
        assert os.listdir(tmp_path) == ["a.npy"]
    (tmp_path / "plain").write_text("")
    assert (tmp_path / "a.npy").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_the_next_run_removes_what_a_killed_one_left_and_nothing_else(tmp_path):
    alike = [".a.partial", ".a.01234567.partial", ".a.0123456.endotwin", ".aa.01234567.endotwin"]
    for name in alike:
        (tmp_path / name).write_text("years of work")
    (tmp_path / ".a.01234567.endotwin").symlink_to(tmp_path / alike[0])
    before = set(os.listdir(tmp_path))
    killed(
        "with WholeFile(sys.argv[1]) as file:\n file.write(bytes(9))\n os.kill(os.getpid(), 9)",
        tmp_path / "a",
    )
    killed("with WholeFolder(sys.argv[1]) as folder:\n os.kill(os.getpid(), 9)", tmp_path / "a")
    assert len(set(os.listdir(tmp_path)) - before) == 1  # the second has removed that of the first
    with WholeFile(tmp_path / "a"):
        write_whole(tmp_path / "a", "of another run at the same time")  # which leaves this one alone
    assert set(os.listdir(tmp_path)) == {*before, "a"}
    assert {(tmp_path / name).read_text() for name in alike} == {"years of work"}


def test_a_folder_is_there_when_whole(tmp_path):
    (tmp_path / "le").mkdir()  # an empty one may be there
    with WholeFolder(tmp_path / "le") as folder:
        (folder / "a").write_text("whole")
        assert list((tmp_path / "le").iterdir()) == []
        with pytest.raises(ValueError, match="another run is writing"), WholeFolder(tmp_path / "le"):
            pass
    assert [path.name for path in (tmp_path / "le").iterdir()] == ["a"]
    for taken in ("le", "le/a"):
        with pytest.raises(ValueError, match=r"is not empty|is no folder"):
            WholeFolder(tmp_path / taken)
    whole = WholeFolder(tmp_path / "new")
    with pytest.raises(OSError, match="No space") as caught, whole as folder:
        raise OSError(errno.ENOSPC, "No space left on device", str(folder / "a"))
    assert caught.value.filename == str(tmp_path / "new")
    assert os.listdir(tmp_path) == ["le"]


def test_a_folder_that_another_made_meanwhile_is_not_overwritten(tmp_path):
    whole = WholeFolder(tmp_path / "le")
    (whole.__enter__() / "a").write_text("ours")
    (tmp_path / "le").mkdir()
    (tmp_path / "le" / "b").write_text("theirs")
    with pytest.raises(OSError, match="not empty") as caught:
        whole.__exit__(None, None, None)
    assert caught.value.filename == str(tmp_path / "le")
    assert [path.name for path in tmp_path.rglob("*")] == ["le", "b"]


def partial(path):
    file = PartialFile(path, SIGN)
    assert file.write(SIGN.encode()) == len(SIGN)
    return file


def test_a_log_has_a_name_from_its_first_byte_on_and_another_when_it_is_complete(tmp_path):
    file = partial(tmp_path / "a.log")
    with pytest.raises(ValueError, match=r"another run is writing .*/a\.log"):
        PartialFile(tmp_path / "a.log", SIGN)
    file.sync()
    file.write(b", and more")
    assert (tmp_path / "a.log.partial").read_text() == f"{SIGN}, and more"
    file.complete()
    partial(tmp_path / "a.log").complete()  # one of ours is replaced
    partial(tmp_path / "b.log").remove()
    assert os.listdir(tmp_path) == ["a.log"]


def test_a_log_overwrites_nothing_that_was_left(tmp_path):
    killed("PartialFile(sys.argv[1], '').write(b'left here')", tmp_path / "a.log")
    (tmp_path / "a.log.partial.2").symlink_to(tmp_path / "nowhere")
    os.mkfifo(tmp_path / "a.log.partial.3")
    file = partial(tmp_path / "a.log")
    assert file.partial.name == "a.log.partial.4"
    file.complete()
    assert (tmp_path / "a.log.partial").read_text() == "left here"
    assert not (tmp_path / "nowhere").exists()
    file = partial(tmp_path / "b.log")
    (tmp_path / "b.log").write_text("thesis")
    for take in (file.complete, lambda: PartialFile(tmp_path / "b.log", SIGN)):
        with pytest.raises(ValueError, match="is there and no such command made it"):
            take()
    assert (tmp_path / "b.log").read_text() == "thesis"
    assert (tmp_path / "b.log.partial").read_text() == SIGN


def test_full_disk_names_the_log(small_disk):
    disk = small_disk(64)
    file = PartialFile(disk / "a.log", SIGN)
    with pytest.raises(OSError, match="No space left") as caught:
        file.write(b"x" * 200_000)
    assert caught.value.filename == str(disk / "a.log.partial")
    file.close()
    assert os.listdir(disk) == ["a.log.partial"]


@pytest.mark.parametrize(
    ("content", "overwritable"),
    [
        ("", True),
        (f"{'x' * 100_000}{MADE_BY}", True),
        (f"{MADE_BY}{'x' * 100_000}", True),
        (f"{'x' * 100_000}{MADE_BY}{'x' * 100_000}", False),
        (MADE_BY[:-1], False),
    ],
)
def test_a_file_with_the_sign_at_either_end_is_overwritable(tmp_path, content, overwritable):
    check_overwritable(tmp_path / "a")
    (tmp_path / "a").write_text(content)
    if overwritable:
        check_overwritable(tmp_path / "a")
        return
    with pytest.raises(ValueError, match=r"/a is there and no such command made it"):
        check_overwritable(tmp_path / "a")


def hold(folder, held):
    with claim(folder):
        held.set()
        time.sleep(0.5)


def test_a_folder_that_another_process_holds_is_refused_or_waited_for(tmp_path):
    fresh = multiprocessing.get_context("spawn")
    begun = fresh.Event()
    folder, link = tmp_path / "a", tmp_path / "link"
    folder.mkdir()
    link.symlink_to(folder)
    process = fresh.Process(target=hold, args=(folder, begun))
    process.start()
    assert begun.wait(30)
    for path in (folder, link):
        with pytest.raises(ValueError, match=r"another run is writing into .*: wait for it"), claim(path):
            pass
    with claim(folder, wait_seconds=30), claim(tmp_path):  # two folders do not meet
        pass
    process.join()
    with pytest.raises(KeyError), claim(folder):
        raise KeyError
    with claim(folder):
        pass
    with pytest.raises(FileNotFoundError), claim(tmp_path / "none", wait_seconds=5):
        pass


def test_a_folder_that_took_the_name_meanwhile_is_the_one_that_is_locked(tmp_path, monkeypatch):
    folder, opened = tmp_path / "a", os.open
    folder.mkdir()

    def replaced(path, flags):
        descriptor = opened(path, flags)
        if not (tmp_path / "b").exists():
            folder.rename(tmp_path / "b")
            folder.mkdir()
        return descriptor

    monkeypatch.setattr(os, "open", replaced)
    with claim(folder, wait_seconds=5), claim(tmp_path / "b"):
        monkeypatch.undo()
        with pytest.raises(ValueError, match="another run is writing"), claim(folder):
            pass
