"""The files that a run opens, found by watching it: what a verb reads is no list by hand.

Two watchers, as each sees what the other does not: the kernel's inotify sees native code and child processes
open files that are there; an audit hook of Python sees the names of files that are not there.
"""

import contextlib
import ctypes
import os
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

ACCESS, CLOSE_NOWRITE, OPEN = 0x1, 0x10, 0x20
IS_FOLDER = 0x40000000


def log_opened(log: Path) -> None:
    """Write the name of every file that this process tries to open for reading, from now on."""
    # Written through to the file: the process may be killed.
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)

    def hook(event: str, arguments: tuple) -> None:
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            flags = arguments[2] if isinstance(arguments[2], int) else 0
            if flags & (os.O_WRONLY | os.O_CREAT) == 0:
                with contextlib.suppress(OSError, ValueError):
                    name = os.path.abspath(os.fsdecode(arguments[0]))
                    os.write(descriptor, os.fsencode(name) + b"\n")

    sys.addaudithook(hook)


@contextlib.contextmanager
def watched(folder: Path) -> Iterator[set[str]]:
    """Context manager: a set that holds, in the end, every file below a folder that was opened to be read."""
    library = ctypes.CDLL(None, use_errno=True)
    descriptor = library.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    assert descriptor >= 0, os.strerror(ctypes.get_errno())
    folders = {}
    for above, _, _ in os.walk(folder):
        number = library.inotify_add_watch(descriptor, os.fsencode(above), ACCESS | CLOSE_NOWRITE | OPEN)
        folders[number] = Path(above)
    found: set[str] = set()
    try:
        yield found
        found |= {
            (folders[number] / name).relative_to(folder).as_posix()
            for number, mask, name in events(descriptor)
            if name and not mask & IS_FOLDER and mask & (ACCESS | CLOSE_NOWRITE)
        }
    finally:
        os.close(descriptor)


def events(descriptor: int) -> Iterator[tuple[int, int, str]]:
    """Number of the watch, mask and name of each event that waits."""
    while True:
        try:
            data = os.read(descriptor, 2**20)
        except BlockingIOError:
            return
        at = 0
        while at < len(data):
            number, mask, _, size = struct.unpack_from("iIII", data, at)
            yield number, mask, os.fsdecode(data[at + 16 : at + 16 + size].rstrip(b"\0"))
            at += 16 + size


def attempted(log: Path, folder: Path) -> set[str]:
    """Names below a folder that the hook has seen, whether there was such a file or not."""
    if not log.exists():
        return set()
    lines = {Path(line) for line in log.read_text(errors="replace").splitlines()}
    return {path.relative_to(folder).as_posix() for path in lines if path.is_relative_to(folder)}
