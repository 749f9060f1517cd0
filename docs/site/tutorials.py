"""Tutorials: scripts of docs/tutorials, which Jupytext opens as notebooks, run, and turned into pages.

What a cell prints stands below it in lines that begin with `# >`. `python docs/site/tutorials.py` runs all of
them in a folder that is thrown away, and writes these lines again.
"""

import contextlib
import io
import sys
import tempfile
import types
from pathlib import Path
from typing import Any

import jupytext

FOLDER = Path(__file__).resolve().parents[1] / "tutorials"
MARK = "# >"


def pages() -> dict[str, str]:
    """Return the page of each tutorial, by its name."""
    return {path.stem: page(path) for path in sorted(FOLDER.glob("*.py"))}


def page(path: Path) -> str:
    """Return a tutorial in Markdown."""
    parts = []
    for cell in jupytext.read(path).cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        code, printed = split(cell.source)
        parts.append(f"```python\n{code}\n```")
        if printed:
            parts.append("```text\n" + "\n".join(printed) + "\n```")
    parts.append(
        f"*This page is the script `docs/tutorials/{path.name}`. Run it as it is, or open it as a notebook: "
        f"`jupytext --to ipynb docs/tutorials/{path.name}`. The tests run it.*"
    )
    return "\n\n".join(parts) + "\n"


def split(source: str) -> tuple[str, list[str]]:
    """Return the code of a cell, and the lines that it prints."""
    lines = source.splitlines()
    printed = [line.removeprefix(MARK).removeprefix(" ") for line in lines if line.startswith(MARK)]
    return "\n".join(line for line in lines if not line.startswith(MARK)).rstrip(), printed


def run(path: Path) -> list[tuple[list[str], list[str]]]:
    """Run a tutorial in the working folder; returns the lines that each cell states and that it printed."""
    module = types.ModuleType("tutorial")
    sys.modules[module.__name__] = module  # dataclasses look their module up
    found = []
    try:
        for cell in jupytext.read(path).cells:
            if cell.cell_type == "code":
                code, stated = split(cell.source)
                found.append((stated, _printed(code, vars(module), path)))
    finally:
        del sys.modules[module.__name__]
    return found


def _printed(code: str, names: dict[str, Any], path: Path) -> list[str]:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, str(path), "exec"), names)
    return [line.rstrip() for line in out.getvalue().splitlines()]


def refresh(path: Path) -> None:
    """Run a tutorial and write what its cells print."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        outputs = iter(run(path))
    notebook = jupytext.read(path)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            code, (_, printed) = split(cell.source)[0], next(outputs)
            cell.source = "\n".join([code, *(f"{MARK} {line}".rstrip() for line in printed)])
    jupytext.write(notebook, path, fmt="py:percent")


if __name__ == "__main__":
    for tutorial in sorted(FOLDER.glob("*.py")):
        refresh(tutorial)
        print(tutorial.name)
