"""Names that files give to presets and records: one rule for them, and how other formats hold them."""

import re

from twin.errors import InputError
from twin.files.shown import shown

LONGEST_NAME = 120
"""Characters of a name: longer ones do not fit into the names of files."""


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


def in_code(text: str) -> str:
    """Return a text as a code span of Markdown: nothing in it is HTML, a link or an end of the span."""
    runs = re.findall("`+", text)
    fence = "`" * (max(map(len, runs), default=0) + 1)
    space = " " if runs else ""
    return f"{fence}{space}{in_comment(text)}{space}{fence}"


def in_comment(text: str) -> str:
    """Return a text for a comment of one line: what is no printable character becomes a question mark."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
