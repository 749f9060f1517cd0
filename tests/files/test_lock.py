"""Folders that one run at a time writes into."""

import pytest

from twin.files.lock import claim


def test_claims_of_two_folders_do_not_meet_and_one_ends_under_an_exception(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    with pytest.raises(KeyError), claim(tmp_path / "a"), claim(tmp_path / "b"):
        raise KeyError
    with claim(tmp_path / "a"):
        pass
