"""Values of files in messages: cut before they are written out, so that a message costs little."""

import difflib
import re
import reprlib
from typing import Any

LONGEST = 40  # characters of a value in a message
LONGEST_PATH = 180  # characters of a path in a message
LONGEST_NAME = 120  # characters of a name that are compared with others

_REPR = reprlib.Repr()
_REPR.maxlevel = 2
_REPR.maxstring = _REPR.maxother = _REPR.maxlong = LONGEST
_REPR.maxdict = _REPR.maxlist = _REPR.maxtuple = 3


def shown(value: Any) -> str:
    """Return a value as Python writes it, cut to `LONGEST` characters, however large it is."""
    text = _REPR.repr(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def printable(text: str) -> str:
    """Return a text with a question mark for each character that cannot be printed: it is one line."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def cut(text: object, most: int = 120) -> str:
    """Return a text in one line of printable characters, cut."""
    line = printable(" ".join(str(text)[: 4 * most].split()))
    return line if len(line) <= most else f"{line[: most - 3]}..."


def suggestion(name: str, names: list[str]) -> str:
    """Return a hint for an unknown name: a close match, if there is one, and valid names, cut to a line."""
    close = difflib.get_close_matches(name[:LONGEST_NAME], names, n=1)
    guess = f" (did you mean {close[0]!r}?)" if close else ""
    return f"{guess}; valid: {cut(', '.join(names), 130)}"


def named(path: object) -> str:
    """Return a path for a message: its end, in one line of printable characters."""
    text = printable(str(path)[-LONGEST_PATH:])
    return text if len(str(path)) <= LONGEST_PATH else f"...{text[3:]}"


def in_code(text: str) -> str:
    """Return a text as a code span of Markdown: nothing in it is HTML, a link or an end of the span."""
    runs = re.findall("`+", text)
    fence = "`" * (max(map(len, runs), default=0) + 1)
    space = " " if runs else ""
    return f"{fence}{space}{printable(text)}{space}{fence}"
