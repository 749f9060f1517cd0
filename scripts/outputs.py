"""The files and folders that a command writes: checked before its work, and made only as far as needed."""

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from twin.errors import InputError
from twin.files.lock import claim
from twin.files.ours import MADE_BY, refuse_foreign

_made: list[Path] = []
"""Folders that this command has made."""


def output_folder(path: Path, files: Mapping[str, str] | None = None) -> Path:
    """Make a folder and prove that it can be written, before any long work.

    Args:
        path: of the folder.
        files: names of the files that will be written into it, and the sign of each (`twin.files.ours`): what
            is there without it is not replaced.

    Raises:
        ValueError: it is a link, cannot be made or written, or holds a file that would be replaced and is not
            ours.
    """
    if path.is_symlink():
        raise InputError(f"--out {path} is a link, which is not followed: name the folder itself")
    return _writable(path, files or {})


def _writable(path: Path, files: Mapping[str, str]) -> Path:
    try:
        _make(path)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise InputError(f"cannot write to the folder {path}: {os.strerror(error.errno or 0)}") from error
    for name, sign in files.items():
        refuse_foreign(path / name, sign)
    return path


def output_file(
    path: Path,
    suffixes: Sequence[str] = (),
    sign: str = MADE_BY,
    *,
    beside: Mapping[str, str] | None = None,
    inputs: Iterable[Path] = (),
) -> Path:
    """Make the folder of a file and prove that the file can be written there.

    Args:
        path: of the file.
        suffixes: valid endings; any, if not given.
        sign: of such a file (`twin.files.ours`): what is there without it is not replaced.
        beside: names of the files that are written with it, and the sign of each.
        inputs: files and folders that the command reads.

    Raises:
        ValueError: the folder cannot be written, the path is a folder or has another ending, the file is one
            of the inputs, or it is there and is not ours.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise InputError(f"--out {path}: must end in {' or '.join(suffixes)}")
    if path.is_dir():
        raise InputError(f"--out {path} is a folder: name a file")
    for given in inputs:
        if _same(path, given):
            raise InputError(f"--out {path} is what is read: name another file")
    _writable(path.parent, {path.name: sign, **(beside or {})})
    return path


def remove_empty_folders() -> None:
    """Remove the folders that this command has made and left empty; those that others write into stay."""
    while _made:
        folder = _made.pop()
        with contextlib.suppress(OSError, InputError), claim(folder):
            folder.rmdir()


def keep_folders() -> None:
    """Keep the folders that this command has made: it has come to its end."""
    _made.clear()


def _make(path: Path) -> None:
    for folder in [*reversed(path.parents), path]:
        if not folder.is_dir():
            if folder.exists():
                raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
            try:
                folder.mkdir()
            except FileExistsError:  # another process may have made it since
                if not folder.is_dir():
                    raise
            else:
                _made.append(folder)


def _same(one: Path, other: Path) -> bool:
    with contextlib.suppress(OSError):
        return os.path.samefile(one, other)
    return False
