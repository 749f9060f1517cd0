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
    """What a command left."""

    code: int
    out: str
    err: str


def typed(line: str, cwd: Path) -> Typed:
    """Run one command line in a folder."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(cwd),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        mock.patch.object(sys, "argv", ["endotwin", *shlex.split(line)]),
    ):
        code = main()
    return Typed(code, out.getvalue(), err.getvalue())


def done(line: str, cwd: Path) -> str:
    """Run one command line that succeeds; what it prints."""
    code, out, err = typed(line, cwd)
    assert code == 0, f"endotwin {line}\n{err}"
    return out
