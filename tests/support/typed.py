"""`endotwin` as a user types it, run in this process: a process of its own would spend seconds on imports."""

import contextlib
import io
import shlex
import sys
from pathlib import Path
from typing import NamedTuple
from unittest import mock

from scripts.__main__ import main


class Typed(NamedTuple):
    """The exit code of a command and what it printed."""

    code: int
    out: str
    err: str


def typed(line: str, cwd: Path, stdin: bytes = b"") -> Typed:
    """Run one command line in a folder."""
    return typed_words(shlex.split(line), cwd, stdin)


def typed_words(words: list[str], cwd: Path, stdin: bytes = b"") -> Typed:
    """Run one command, given as words, in a folder; stdin holds what is given and then ends."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(cwd),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        mock.patch.object(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin))),
        mock.patch.object(sys, "argv", ["endotwin", *words]),
    ):
        code = main()
    return Typed(code, out.getvalue(), err.getvalue())


def done(line: str, cwd: Path) -> str:
    """Run one command line that succeeds; what it prints."""
    code, out, err = typed(line, cwd)
    assert code == 0, f"endotwin {line}\n{err}"
    return out
