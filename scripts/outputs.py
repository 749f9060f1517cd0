"""Outputs of a command: checked before its work, made only as far as needed, removed again if it fails."""

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from twin.errors import InputError
from twin.files.atomic import MADE_BY, check_overwritable, claim

_made: list[Path] = []  # folders that this command has made


def output_folder(path: Path, files: Mapping[str, str] | None = None) -> Path:
    """Make a folder and check that it can be written, before any long work.

    `files` maps the names that will be written into it to the sign of each: an existing file without that
    sign is not ours and is not replaced.
    """
    if path.is_symlink():
        raise InputError(f"--out {path} is a link, which is not followed: name the folder itself")
    try:
        for folder in [*reversed(path.parents), path]:
            _make(folder)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise InputError(f"cannot write to the folder {path}: {os.strerror(error.errno or 0)}") from error
    for name, sign in (files or {}).items():
        check_overwritable(path / name, sign)
    return path


def output_file(
    path: Path,
    suffixes: Sequence[str] = (),
    sign: str = MADE_BY,
    *,
    companions: Mapping[str, str] | None = None,
    inputs: Iterable[Path] = (),
) -> Path:
    """Make the folder of a file and check that the file can be written there.

    `companions` maps the names of files that are written with it to their signs; none of the `inputs` may be
    the file itself.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise InputError(f"--out {path}: must end in {' or '.join(suffixes)}")
    if path.is_dir():
        raise InputError(f"--out {path} is a folder: name a file")
    for source in inputs:
        with contextlib.suppress(OSError):
            if os.path.samefile(path, source):
                raise InputError(f"--out {path} is what is read: name another file")
    folder = path.parent if not path.parent.is_symlink() else path.parent.resolve()
    output_folder(folder, {path.name: sign, **(companions or {})})
    return path


def remove_empty_folders() -> None:
    """Remove the folders that this command has made and left empty; those that others write into stay."""
    while _made:
        folder = _made.pop()
        with contextlib.suppress(OSError, InputError), claim(folder):
            folder.rmdir()


def keep_folders() -> None:
    """Keep the folders that this command has made: it has succeeded."""
    _made.clear()


def _make(folder: Path) -> None:
    try:
        folder.mkdir()
    except OSError:
        if folder.is_dir():
            return
        if folder.exists():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder)) from None
        raise
    _made.append(folder)
