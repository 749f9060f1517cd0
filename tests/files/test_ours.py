"""Files that a command did not make stay: it replaces its own alone."""

import os

import pytest

from twin.files.ours import MADE_BY, refuse_foreign


@pytest.mark.parametrize("size", [0, 100, 70_000, 200_000])
@pytest.mark.parametrize("at_end", [False, True])
def test_a_sign_at_either_end_is_found(tmp_path, size, at_end):
    parts = [b"x" * size, MADE_BY.encode()]
    (tmp_path / "a").write_bytes(b"".join(parts if at_end else reversed(parts)))
    refuse_foreign(tmp_path / "a")


@pytest.mark.parametrize("content", ["thesis", MADE_BY[:-1], f"{'x' * 100_000}{MADE_BY}{'x' * 100_000}"])
def test_another_file_is_refused_by_its_name(tmp_path, content):
    (tmp_path / "a").write_text(content)
    with pytest.raises(ValueError, match=r"/a is there and no such command made it"):
        refuse_foreign(tmp_path / "a")


def test_nothing_and_a_file_without_content_may_be_replaced(tmp_path):
    refuse_foreign(tmp_path / "a")
    (tmp_path / "a").touch()
    refuse_foreign(tmp_path / "a")


def test_what_is_no_file_is_not_even_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    for name in ("pipe", "zero"):
        with pytest.raises(ValueError, match=r"is no file|is a link"):
            refuse_foreign(tmp_path / name)
