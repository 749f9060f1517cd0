"""The source files of the packages as syntax trees, for tests of house rules."""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]


class Text(NamedTuple):
    """A documenting string: of a module, class or function, or below an assignment."""

    place: str
    text: str


def source_files(*folders: str, without: tuple[str, ...] = ()) -> Iterator[tuple[str, ast.Module]]:
    """Yield the path, relative to the root, and the tree of each file that is written by hand."""
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if not name.endswith("_pb2.py") and not name.startswith(without or ("\0",)):
                yield name, ast.parse(path.read_text())


def documenting_strings(name: str, tree: ast.Module) -> Iterator[Text]:
    """Yield every string that stands alone as a statement, with where it stands."""
    for node in ast.walk(tree):
        for statement in getattr(node, "body", ()) if not isinstance(node, ast.Lambda | ast.IfExp) else ():
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                value = statement.value.value
                if isinstance(value, str):
                    yield Text(f"{name}:{statement.lineno}", value)
