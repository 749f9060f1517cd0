"""`python -m scripts.studies.tables`: write the tables and figures of the documents from docs/data.

In a document, a table stands between `<!-- table: NAME.csv -->` and `<!-- end -->`. Parts after ` | ` choose
rows by a pattern of their names (`rows: R = 1.*`), and columns: `RMSE:.2f` (with two decimals), or a heading
with a template (`error: {RMSE:.2f} ({low} to {high})`); `.2f` alone is for all columns. A figure in a
sentence is followed by its place, as in `1.63<!-- rivals.csv, RAM (twins), times the limit -->`: file, row,
column; it keeps its number of decimals.
"""

import csv
import dataclasses
import re
import subprocess
import sys
from collections.abc import Mapping
from decimal import Decimal, InvalidOperation
from functools import cache, partial
from pathlib import Path

from scripts.command import Summary, complain, run_verb
from scripts.studies.comparison_data import write_comparison
from twin.errors import InputError, MissingFileError
from twin.files.atomic import write_whole

ROOT = Path(__file__).resolve().parents[2]
DATA = "docs/data"
STATED = ("commit", "command", "date", "versions")
"""What the first lines of each file state, as `# commit: ...`."""
TABLE = re.compile(r"<!-- table: ([^|\n]+?)((?: \| [^\n]+?)?) -->\n.*?<!-- end -->", re.DOTALL)
FIGURE = re.compile(r"(-?\d+(?:\.\d+)?)(?:\s+(?:%|times|deg))?<!-- (\w+\.csv), ([^>\n]+), ([^,>\n]+) -->")
_FORM = r"\.\d[fg]"
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_FIELD = re.compile(r"\{([^{}:]+):?([^{}]*)\}")
_EMPTY = re.compile(r" \((?: to )?\)")

Row = Mapping[str, str]


@dataclasses.dataclass(frozen=True)
class Tables:
    """Write the tables and figures of the documents from the files of docs/data.

    Examples:
        python -m scripts.studies.tables
        python -m scripts.studies.tables --results results/full
    """

    results: Path | None = None
    """Folder of `evaluate --suite full` or `sealed`, or `control`: write its figures into docs/data first."""

    commit: str = ""
    """Commit of that run; by default the present one."""

    check: bool = False
    """Change nothing; name the documents that would change, with exit code 1."""


def documents() -> list[Path]:
    """Return all documents that may have tables and figures from files."""
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


@cache
def read_data(path: Path) -> dict[str, Row]:
    """Read the rows of a file by the name in their first column; the file states where they are from."""
    if not path.is_file():
        raise MissingFileError(f"{path}: no such file of data")
    lines = path.read_text().splitlines()
    for name, line in zip(STATED, lines, strict=False):
        if not re.match(f"# {name}: .", line):
            raise InputError(f"{path}: its first lines must be # {', # '.join(STATED)}, each with a value")
    rows = list(csv.DictReader(lines[len(STATED) :], strict=True))
    named: dict[str, Row] = {next(iter(row.values())): row for row in rows}
    if len(named) < len(rows):
        raise InputError(f"{path}: the names in the first column must differ")
    return named


def cell(path: Path, row: str, column: str) -> str:
    """Return one cell of a file."""
    rows = read_data(path)
    if row not in rows or column not in rows[row]:
        raise InputError(f"{path} has no row {row!r} with a column {column!r}")
    return rows[row][column]


def shown(value: str, form: str) -> str:
    """Return a cell in a format, such as `.2f`; text, and a cell without format, as it is."""
    try:
        return format(Decimal(value), form) if form else value
    except InvalidOperation:
        return value


def table(path: Path, options: str) -> str:
    """Return rows and columns of a file as a table of Markdown."""
    pattern, form, columns = ".*", "", []
    for part in filter(None, options.split(" | ")):
        if part.startswith("rows: "):
            pattern = part.removeprefix("rows: ")
        elif re.fullmatch(_FORM, part):
            form = part
        else:
            columns.append(_column(part))
    rows = read_data(path)
    columns = columns or [_column(name) for name in next(iter(rows.values()))]
    kept = [name for name in rows if re.fullmatch(pattern, name)]
    if not kept:
        raise InputError(f"{path} has no row like {pattern}")
    lines = [[heading for heading, _ in columns], ["---"] * len(columns)]
    lines += [[_filled(path, name, template, form) for _, template in columns] for name in kept]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _column(text: str) -> tuple[str, str]:
    """Return heading and template of a column."""
    if "{" in text:
        heading, _, template = text.partition(": ")
        return heading, template
    return re.sub(f":{_FORM}$", "", text), f"{{{text}}}"


def _filled(path: Path, row: str, template: str, form: str) -> str:
    """Return a template with the cells of a row; a dash where the first of them is empty."""
    fields = _FIELD.findall(template)
    if fields and not cell(path, row, fields[0][0]):
        return "-"
    text = _FIELD.sub(lambda of: shown(cell(path, row, of[1]), of[2] or form), template)
    return _EMPTY.sub("", text).strip()


def written(text: str, data: Path) -> str:
    """Return a document with all tables and figures as the files have them."""

    def new_table(found: re.Match[str]) -> str:
        head = found[0].partition("\n")[0]
        return f"{head}\n\n{table(data / found[1], found[2])}\n<!-- end -->"

    def new_figure(found: re.Match[str]) -> str:
        value = cell(data / found[2], found[3], found[4])
        if not _NUMBER.fullmatch(value):
            raise InputError(f"{found[2]}, {found[3]}, {found[4]} is no number: {value!r}")
        return shown(value, f".{len(found[1].partition('.')[2])}f") + found[0][len(found[1]) :]

    return FIGURE.sub(new_figure, TABLE.sub(new_table, text))


def head_commit() -> str:
    """Return the hash of the present commit."""
    command = ["git", "rev-parse", "HEAD"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def tables(args: Tables) -> Summary:
    """Write all tables and figures of the documents, or name those that would change."""
    if args.results:
        write_comparison(args.results, ROOT / DATA, args.commit or head_commit())
    changed = []
    for path in documents():
        text = path.read_text()
        try:
            new = written(text, ROOT / DATA)
        except (InputError, MissingFileError) as error:
            raise InputError(f"{path.relative_to(ROOT)}: {error}") from error
        if new != text:
            changed.append(str(path.relative_to(ROOT)))
            if not args.check:
                write_whole(path, new)
    word = "not as docs/data has it" if args.check else "written"
    for name in changed:
        complain(f"{name}: {word}")
    return Summary(
        f"{len(changed)} documents {word}", {"changed": changed}, code=int(args.check and bool(changed))
    )


main = partial(run_verb, Tables, tables)

if __name__ == "__main__":
    sys.exit(main())
