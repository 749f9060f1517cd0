"""Separator of the fields of a CSV file: found in its header, where decimals cannot be taken for it."""

import csv
import itertools
from collections.abc import Collection, Iterator

from twin.errors import InputError
from twin.measured.csv_lines import CsvLines

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
"""Separators that are read, and their names; decimals may have a comma where none separates fields."""


def lines_and_separator(lines: CsvLines, names: Collection[str]) -> tuple[Iterator[str], str]:
    """Return the lines of a file, from its first on, and what separates its fields.

    It is the one of `SEPARATORS` that the header holds outside quotes. Of several, it is the one that leaves
    the most of the columns that are asked for.

    Args:
        lines: of the file, none of them read yet.
        names: of the columns that are asked for.

    Raises:
        ValueError: the header does not tell which one it is.
    """
    blank, header = 0, ""
    for header in lines:
        if header.strip():
            break
        blank += 1
    # The blank lines are counted, not kept: there may be millions.
    rest = itertools.chain(itertools.repeat("\n", blank), [header] if header.strip() else [], lines)
    return rest, _separator(lines, header, names)


def _separator(lines: CsvLines, header: str, names: Collection[str]) -> str:
    fields = {separator: _fields(header, separator) for separator in SEPARATORS}
    held = [separator for separator, split in fields.items() if len(split) > 1]
    if len(held) < 2:
        return held[0] if held else ","
    matches = {separator: len(set(fields[separator]) & set(names)) for separator in held}
    best, second = sorted(held, key=lambda separator: -matches[separator])[:2]
    if matches[best] == matches[second]:
        words = " and ".join(SEPARATORS[separator] for separator in held)
        raise InputError(
            f"{lines.path}: its header has {words}, and does not tell which of them separate the columns: "
            "quote the names that hold the others"
        )
    return best


def _fields(header: str, separator: str) -> list[str]:
    """Return the names in the first line of a header by one separator; none where it cannot be."""
    try:
        return [name.strip() for name in next(csv.reader([header], delimiter=separator), [])]
    except csv.Error:
        return []
