"""A folder at one moment: names, contents, targets of links, modes and times of all that is in it."""

import hashlib
import os
import stat
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple


class Entry(NamedTuple):
    """One name in a folder, as it can be compared.

    Attributes:
        kind: file, folder, link or other.
        mode: permissions.
        content: hash of a file, target of a link.
        modified: when a file was written [ns]; of a folder 0, as a temporary file that has gone changes it.
        number: the file's own number: a file that is written anew, with the same bytes, has another.
    """

    kind: str
    mode: int
    content: str
    modified: int
    number: int


Snapshot = dict[str, Entry]


def taken(folder: Path) -> Snapshot:
    """Everything below a folder; nothing is followed, and no pipe is opened."""
    found = {}
    for above, names, files in os.walk(folder):
        for name in (*names, *files):
            path = Path(above, name)
            found[path.relative_to(folder).as_posix()] = entry(path)
    return found


def entry(path: Path) -> Entry:
    facts = path.lstat()
    mode = stat.S_IMODE(facts.st_mode)
    if stat.S_ISLNK(facts.st_mode):
        return Entry("link", mode, os.readlink(path), facts.st_mtime_ns, facts.st_ino)
    if stat.S_ISDIR(facts.st_mode):
        return Entry("folder", mode, "", 0, facts.st_ino)
    if not stat.S_ISREG(facts.st_mode):
        return Entry("other", mode, "", 0, facts.st_ino)
    return Entry("file", mode, digest(path), facts.st_mtime_ns, facts.st_ino)


def digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        return type(error).__name__


def differences(before: Snapshot, after: Snapshot) -> dict[str, str]:
    """Names that differ, each with how."""
    found = {}
    for name in sorted({*before, *after}):
        old, new = before.get(name), after.get(name)
        if old is None:
            found[name] = f"new {new.kind}"
        elif new is None:
            found[name] = f"{old.kind} removed"
        elif old != new:
            changed = [field for field in Entry._fields if getattr(old, field) != getattr(new, field)]
            found[name] = f"{old.kind} changed in {', '.join(changed)}"
    return found


def matches(name: str, patterns: tuple[str, ...]) -> bool:
    """Whether a name is one of these; a star stays within a folder."""
    depth = name.count("/")
    return any(pattern.count("/") == depth and fnmatchcase(name, pattern) for pattern in patterns)


def contents(folder: Path) -> dict[str, str]:
    """Hashes of files, and targets of links, by name; for anything else its kind."""
    return {name: found.content or found.kind for name, found in taken(folder).items()}
