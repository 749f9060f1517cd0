"""Names of exported records: those of their files, with their folders' where two files are called alike."""

import collections
import os
import re
from collections.abc import Sequence
from pathlib import Path

from twin.errors import InputError, MissingFileError
from twin.recording import episode_files

_NOT_ITS_NAME = re.compile(r"\.mcap(\.partial(\.\d+)?)?$")  # a killed recording is NAME.mcap.partial


def named_files(paths: Sequence[Path]) -> dict[str, Path]:
    """Return the MCAP files of folders and files, under names that differ.

    Raises:
        FileNotFoundError: a path does not exist or a folder holds no MCAP file.
        ValueError: there is none, or one is given twice.
    """
    if not paths:
        raise InputError("no data given: name folders of MCAP files, or files")
    for path in paths:
        if not path.exists():
            raise MissingFileError(f"no file or folder {path}")
    files = [file for path in paths for file in episode_files(path)]
    parts = [(*Path(os.path.realpath(file)).parent.parts, _NOT_ITS_NAME.sub("", file.name)) for file in files]
    twice = [file for file, count in collections.Counter(parts).items() if count > 1]
    if twice:
        raise InputError(f"{files[parts.index(twice[0])]} is given twice")
    for depth in range(1, max(map(len, parts)) + 1):
        names = ["_".join(part for part in path[-depth:] if part != "/") for path in parts]
        if len(set(names)) == len(names):
            break
    else:
        raise InputError("two files have the same name in folders of the same names: export them apart")
    return dict(zip(names, files, strict=True))
