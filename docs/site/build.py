"""Builds the site of the documents, without a network: `python docs/site/build.py [FOLDER]`, or `make docs`.

Pages are gathered in FOLDER/docs: the documents as they are, tutorials from their scripts with their
notebooks, and the reference, made from the code. Then Zensical builds FOLDER/site of them; a warning, such as
a dead link, ends the build.
"""

import functools
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import yaml

SITE = Path(__file__).resolve().parent
REPOSITORY = SITE.parents[1]
sys.path[:0] = [str(REPOSITORY), str(SITE)]

import apidoc
import commands
import estimators
import links
import tutorials

AT_ROOT = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Documents outside docs/, and their names in the site."""
COLOURS = re.compile(r"\x1b\[[0-9;]*m")
NOT_PAGES = {"site", "tutorials"}
"""Folders of docs/ that are no pages."""


def gather(folder: Path) -> None:
    """Write all pages, and the files that they show or link to, into a new folder."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    documents = REPOSITORY / "docs"
    for path in sorted(documents.rglob("*")):
        name = path.relative_to(documents)
        if path.is_dir() or name.parts[0] in NOT_PAGES or "__pycache__" in name.parts:
            continue
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".md":
            links.write_page(path.read_text(), path, folder / name, folder, AT_ROOT)
        else:
            shutil.copy(path, folder / name)
    for name, page in AT_ROOT.items():
        source = REPOSITORY / name
        links.write_page(source.read_text(), source, folder / page, folder, AT_ROOT)
    made = {
        "reference/commands.md": commands.page(),
        "reference/python.md": apidoc.page(),
        **{f"estimators/{name}.md": text for name, text in estimators.pages().items()},
        **{f"tutorials/{name}.md": text for name, text in tutorials.pages().items()},
    }
    for name, text in made.items():
        links.write_page(text, documents / name, folder / name, folder, AT_ROOT)
    for path in tutorials.FOLDER.glob("*.py"):
        target = folder / "tutorials" / f"{path.stem}.ipynb"
        place = {"source": path, "target": target, "folder": folder, "at_root": AT_ROOT, "end": ".html"}
        target.write_text(tutorials.notebook(path, functools.partial(links.linked, **place)))
    for name in ("site.css", "site.js"):
        shutil.copy(SITE / name, folder / name)


def build(out: Path) -> int:
    """Gather the pages and build the site; returns Zensical's exit code."""
    gather(out / "docs")
    shutil.rmtree(out / "site", ignore_errors=True)
    configuration = (REPOSITORY / "mkdocs.yml").read_text()
    for name in ("docs", "site"):
        configuration = configuration.replace(f"_dir: out/{name}", f"_dir: {name}")
    (out / "mkdocs.yml").write_text(configuration)
    command = [
        sys.executable,
        "-m",
        "zensical",
        "build",
        "--strict",
        "--clean",
        "-f",
        str(out / "mkdocs.yml"),
    ]
    done = subprocess.run(
        command, cwd=out, capture_output=True, text=True, env=os.environ | {"NO_COLOR": "1"}
    )
    pages = count(out / "site")
    print(COLOURS.sub("", done.stdout) if done.returncode else f"{out}/site/index.html: {pages} pages")
    return done.returncode


def count(site: Path) -> int:
    """Return how many pages a site has."""
    return len([*site.rglob("*.html")])


def nav_pages() -> list[str]:
    """Return the pages that the navigation names."""
    return _leaves(yaml.safe_load((REPOSITORY / "mkdocs.yml").read_text())["nav"])


def _leaves(part: object) -> list[str]:
    if isinstance(part, str):
        return [part]
    inner = part.values() if isinstance(part, dict) else part
    return [leaf for each in inner for leaf in _leaves(each)]


if __name__ == "__main__":
    sys.exit(build(Path(sys.argv[1] if len(sys.argv) > 1 else "out").resolve()))
