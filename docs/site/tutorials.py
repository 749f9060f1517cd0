"""Tutorials: scripts of docs/tutorials, run, and turned into pages and notebooks with their outputs.

What a cell prints stands below it in lines that begin with `# >`, and so does the link to the figure that it
shows, in docs/images/tutorials. `python docs/site/tutorials.py` runs all of them in a folder that is thrown
away, and writes these lines and figures again.
"""

import ast
import base64
import contextlib
import io
import re
import shutil
import sys
import tempfile
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jupytext
from nbformat.v4 import new_output

FOLDER = Path(__file__).resolve().parents[1] / "tutorials"
FIGURES = Path("../images/tutorials")  # from a tutorial
MARK = "# >"
_FIGURE = re.compile(r"!\[.*\]\((.*)\)")


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
        if text := [line for line in printed if not _FIGURE.fullmatch(line)]:
            parts.append("```text\n" + "\n".join(text) + "\n```")
        parts += [line for line in printed if _FIGURE.fullmatch(line)]
    parts.append(
        f"*This page is the script `docs/tutorials/{path.name}`, which runs as it is, and also a "
        f"[notebook]({path.stem}.ipynb) with these outputs. The tests run it.*"
    )
    return "\n\n".join(parts) + "\n"


def notebook(path: Path, linked: Callable[[str], str] = str) -> str:
    """Return a tutorial as a Jupyter notebook, with what its cells print and show.

    `linked` returns the text of a cell with links that hold where the notebook is written.
    """
    content = jupytext.read(path)
    for cell in content.cells:
        if cell.cell_type == "markdown":
            cell.source = linked(cell.source)
        if cell.cell_type == "code":
            cell.source, printed = split(cell.source)
            if text := [f"{line}\n" for line in printed if not _FIGURE.fullmatch(line)]:
                cell.outputs.append(new_output("stream", text="".join(text)))
            for figure in filter(None, map(_FIGURE.fullmatch, printed)):
                png = base64.b64encode((path.parent / figure[1]).read_bytes()).decode()
                cell.outputs.append(new_output("display_data", {"image/png": png}))
    return str(jupytext.writes(content, fmt="ipynb"))


def split(source: str) -> tuple[str, list[str]]:
    """Return the code of a cell, and the lines that it prints."""
    lines = source.splitlines()
    printed = [line.removeprefix(MARK).removeprefix(" ") for line in lines if line.startswith(MARK)]
    return "\n".join(line for line in lines if not line.startswith(MARK)).rstrip(), printed


def run(path: Path) -> list[tuple[list[str], list[str]]]:
    """Run a tutorial in the working folder; returns the lines that each cell states and that it printed.

    The figures that they show are written into the working folder, `TUTORIAL_0.png` and so on.
    """
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
    """Run a cell; return the lines that it printed, and one for the figure that its last expression is."""
    out, tree, value = io.StringIO(), ast.parse(code), None
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(out):
        exec(compile(tree, str(path), "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), str(path), "eval"), names)
    lines = [line.rstrip() for line in out.getvalue().splitlines()]
    if hasattr(value, "_repr_png_"):
        figure = Path(f"{path.stem}_{len([*Path().glob(f'{path.stem}_*.png')])}.png")
        figure.write_bytes(value._repr_png_())
        lines.append(f"![{value.get_suptitle()}]({FIGURES / figure})")
    return lines


def refresh(path: Path) -> None:
    """Run a tutorial and write what its cells print and show."""
    figures = FOLDER / FIGURES
    for old in figures.glob(f"{path.stem}_*"):
        old.unlink()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        outputs = iter(run(path))
        for figure in Path().glob(f"{path.stem}_*.png"):
            shutil.copy(figure, figures)
    content = jupytext.read(path)
    for cell in content.cells:
        if cell.cell_type == "code":
            code, (_, printed) = split(cell.source)[0], next(outputs)
            cell.source = "\n".join([code, *(f"{MARK} {line}".rstrip() for line in printed)])
    jupytext.write(content, path, fmt="py:percent")


if __name__ == "__main__":
    for tutorial in sorted(FOLDER.glob("*.py")):
        refresh(tutorial)
        print(tutorial.name)
