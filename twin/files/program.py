"""Programs of the user: a Python file that is named on a command line is run, as `python FILE` would."""

import hashlib
import importlib.util
import sys
import traceback
from pathlib import Path
from types import ModuleType

from twin.errors import InputError


def run_program(path: Path, what: str) -> ModuleType:
    """Run a Python file, once in a process, and return it as a module under which its classes are pickled.

    `what` names it in errors. Raises `ValueError` where it does not exist or fails, with its line.
    """
    if path.suffix != ".py" or not path.is_file():
        raise InputError(f"{what} {path}: must be an existing Python file (.py)")
    file = path.resolve()
    name = f"{what.replace(' ', '_')}_{hashlib.sha256(str(file).encode()).hexdigest()[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None  # a .py file has one
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise program_error(path, what, error) from error
    return module


def program_error(path: Path, what: str, error: Exception) -> InputError:
    """Return an error of a user's program in one line, with the line of the file that it comes from."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path.resolve())]
    line = error.lineno if isinstance(error, SyntaxError) else frames[-1].lineno if frames else None
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    reason = (text.splitlines() or [""])[0][:200]
    if not isinstance(error, InputError):
        reason = f"{type(error).__name__}: {reason}"
    return InputError(f"{what} {path}{f', line {line}' if line else ''}: {reason}")
