"""Names of presets, records and their files: one rule for them, and how other formats hold them."""

import re

from twin.errors import InputError
from twin.files.shown import printable, shown

LONGEST_NAME = 120
"""Characters of a name: longer ones do not fit into the names of files."""

_MOST_BYTES = 200  # of a file's name in UTF-8, without its ending: file systems take 255 with endings
# Read as more than a letter by a page or a shell. Colons are free: loggers put times into names.
_RESERVED = '<>"|?*'


def wrong_name(name: object) -> str:
    """Return the rule that a name breaks, in words; empty if it breaks none."""
    if not isinstance(name, str):
        return "must be text"
    if len(name) > LONGEST_NAME:
        return f"must have at most {LONGEST_NAME} characters"
    if not name.isprintable():
        return "must be one line of printable characters"
    return ""


def check_name(what: str, name: object) -> None:
    """Refuse a name that no file may give.

    Raises:
        ValueError: it is no text, is too long, or holds a line break or another control character.
    """
    if rule := wrong_name(name):
        raise InputError(f"{what} = {shown(name)}: {rule}")


def check_file_name(name: str, parameter: str = "name") -> None:
    """Refuse a name that is no plain name of a file, without folder and ending.

    Args:
        name: what the user chose.
        parameter: where, for the message.

    Raises:
        ValueError: it is empty, hidden, a path, too long, or has characters that cannot be printed or that
            some file system reserves.
    """
    rule = wrong_name(name)
    if not name or name.startswith(".") or "/" in name or "\\" in name:
        rule = "must be the name of a file, without folder and ending"
    elif name != name.strip():
        rule = "must be without blanks around"
    elif any(character in _RESERVED for character in name):
        rule = f"must be without any of {' '.join(_RESERVED)}"
    elif not rule and len(name.encode()) > _MOST_BYTES:
        rule = f"must have at most {_MOST_BYTES} bytes"
    if rule:
        raise InputError(f"{parameter} = {shown(name)}: {rule}")


def in_code(text: str) -> str:
    """Return a text as a code span of Markdown: nothing in it is HTML, a link or an end of the span."""
    runs = re.findall("`+", text)
    fence = "`" * (max(map(len, runs), default=0) + 1)
    space = " " if runs else ""
    return f"{fence}{space}{printable(text)}{space}{fence}"
