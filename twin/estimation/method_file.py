"""Method file: a Python file of the user's own, whose estimators are compared beside those of the package.

It is a program, not data: who names it on a command line runs it, as `python my_filter.py` would.
"""

import hashlib
import importlib.util
import sys
import traceback
from collections.abc import Iterable
from pathlib import Path

from twin.errors import InputError
from twin.estimation.registry import MethodSpec, find_method, method_specs

_SHOWN = 200  # of the text of an error [characters]
_LOADED: dict[str, list[str]] = {}  # names of the methods of each module that was run


def load_method_files(paths: Iterable[Path]) -> list[MethodSpec]:
    """Run Python files and return the methods that they have registered.

    A file runs once in a process. Worker processes run it too, as they need its classes: what it does beside
    defining and registering is done in each.

    Args:
        paths: of the files; each calls `register_method` at least once.

    Raises:
        ValueError: a file is not there, fails, or registers nothing.
    """
    return [spec for path in paths for spec in _load(path)]


def _load(path: Path) -> list[MethodSpec]:
    if path.suffix != ".py" or not path.is_file():
        raise InputError(f"method file {path}: must be a Python file (.py) that is there")
    whole = path.resolve()
    name = f"method_file_{hashlib.sha256(str(whole).encode()).hexdigest()[:16]}"
    if name not in _LOADED:
        before = {spec.name for spec in method_specs()}  # those of the package first: their names are taken
        _run(path, whole, name)
        _LOADED[name] = [spec.name for spec in method_specs() if spec.name not in before]
    if not _LOADED[name]:
        raise InputError(f"method file {path} registers no method: end it with register_method(...)")
    return [find_method(method) for method in _LOADED[name]]


def _run(path: Path, whole: Path, name: str) -> None:
    """Import a file as a module of this name, under which its classes are pickled."""
    spec = importlib.util.spec_from_file_location(name, whole)
    assert spec is not None  # a .py file has it
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise InputError(f"method file {path}{_line(error, whole)}: {_in_words(error)}") from error


def _line(error: Exception, whole: Path) -> str:
    """Return where in the file an error arose, if it did there."""
    if isinstance(error, SyntaxError):
        return f", line {error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(whole)]
    return f", line {lines[-1]}" if lines else ""


def _in_words(error: Exception) -> str:
    text = (error.msg if isinstance(error, SyntaxError) else str(error)).splitlines()
    said = text[0][:_SHOWN] if text else ""
    return said if isinstance(error, InputError) else f"{type(error).__name__}: {said}"
