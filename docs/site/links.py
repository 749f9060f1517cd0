"""Links of the documents, so that they hold in the site, and equations as MathML, which needs no script."""

import os
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from latex2mathml.converter import convert

REPOSITORY = Path(__file__).resolve().parents[2]
_LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s]+)(\))")
_MATH = re.compile(r"\$\$(.+?)\$\$|(?<![\w$\\])\$(?=\S)([^$\n]+?)(?<=\S)\$(?![\w$])", re.DOTALL)
_FENCE = re.compile(r"(```.*?```|`[^`\n]+`)", re.DOTALL)


def write_page(text: str, source: Path, target: Path, folder: Path, at_root: Mapping[str, str]) -> None:
    """Write a document of the repository as a page of the site; arguments as for `linked`."""
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(with_math(linked(text, source, target, folder, at_root)))


def linked(
    text: str, source: Path, target: Path, folder: Path, at_root: Mapping[str, str], end: str = ".md"
) -> str:
    """Return a document of the repository with links that hold in the site.

    Args:
        text: of the document.
        source: where it stands in the repository, or would stand.
        target: its file in the site.
        folder: of all pages.
        at_root: documents outside docs/, and their names in the site.
        end: of the names of pages in links.
    """

    def moved(found: re.Match[str]) -> str:
        address, mark, anchor = found[2].partition("#")
        if not address or "://" in address or address.startswith("mailto:"):
            return found[0]
        if (source.parent / address).is_dir():  # folders are no pages: what is said of one stays
            return found[1].strip("[](")
        place = _place(source.parent / address, folder, at_root)
        place = place.with_suffix(end) if place.suffix == ".md" else place
        return f"{found[1]}{os.path.relpath(place, target.parent)}{mark}{anchor}{found[3]}"

    parts = _FENCE.split(text)
    return "".join(part if number % 2 else _LINK.sub(moved, part) for number, part in enumerate(parts))


def _place(path: Path, folder: Path, at_root: Mapping[str, str]) -> Path:
    """Return where a file of the repository is in the site; one that is no page is copied there."""
    name = os.path.relpath(path.resolve(), REPOSITORY)
    if name in at_root:
        return folder / at_root[name]
    if name.startswith("docs/") and not name.startswith(("docs/site", "docs/tutorials")):
        return folder / name.removeprefix("docs/")
    if name.startswith("docs/tutorials/"):
        return folder / name.removeprefix("docs/").replace(".py", ".md")
    copied = folder / "source" / name
    copied.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, copied)
    return copied


def with_math(text: str) -> str:
    """Return a page with its equations, between dollars, as MathML; code stays as it is."""
    parts = _FENCE.split(text)
    return "".join(part if number % 2 else _MATH.sub(_mathml, part) for number, part in enumerate(parts))


def _mathml(found: re.Match[str]) -> str:
    if found[1]:
        inner = convert(" ".join(found[1].split()), display="block")
        return f'\n<div class="equation" markdown="0">{inner}</div>\n'
    return convert(found[2], display="inline")
