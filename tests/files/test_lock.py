"""Folders that one run at a time writes into."""

import multiprocessing
import os
import time

import pytest

from twin.files.lock import claim


def hold(folder, seconds, held):
    with claim(folder):
        held.set()
        time.sleep(seconds)


@pytest.fixture
def held(tmp_path):
    """A folder that another process holds for half a second."""
    fresh = multiprocessing.get_context("spawn")
    begun = fresh.Event()
    process = fresh.Process(target=hold, args=(tmp_path, 0.5, begun))
    process.start()
    assert begun.wait(30)
    yield tmp_path
    process.join()


def test_claims_of_two_folders_do_not_meet_and_one_ends_under_an_exception(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    with pytest.raises(KeyError), claim(tmp_path / "a"), claim(tmp_path / "b"):
        raise KeyError
    with claim(tmp_path / "a"):
        pass


def test_a_folder_that_another_process_holds_is_refused_or_waited_for(held):
    with (
        pytest.raises(ValueError, match=r"another run is writing into .*: wait for it, or stop it"),
        claim(held),
    ):
        pass
    with claim(held, wait_seconds=30):
        pass


def test_a_link_to_a_folder_is_that_folder(held, tmp_path_factory):
    link = tmp_path_factory.mktemp("links") / "link"
    link.symlink_to(held)
    with pytest.raises(ValueError, match="another run is writing into"), claim(link):
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


def test_a_folder_that_is_not_there_is_a_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError), claim(tmp_path / "none", wait_seconds=5):
        pass
