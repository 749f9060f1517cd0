"""Reader of YAML that others wrote: plain values alone, with limits of depth and number.

The values are built from the stream of events, one after the other: nothing is composed, resolved or
constructed by PyYAML, so no depth, alias or tag of a file can make it recurse, expand or run something.
Text stands for null, a boolean or a number only where YAML 1.1 and 1.2 agree; a date, `1:30` and `1e6` are
text. `yes`, `no`, `on` and `off` are booleans, as in YAML 1.1.
"""

import re
from pathlib import Path
from typing import Any

import yaml

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.shown import cut, shown

MOST_BYTES = 4 * MEBIBYTE
MOST_DEPTH = 20
MOST_NODES = 120_000
"""Number of values, lists and mappings: a recipe has one for each sample of a given command."""
MOST_DIGITS = 300
"""Characters of a number: every whole number of these is below the largest float."""

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_WORDS: dict[str, bool | None] = {"": None, "~": None}
for _word, _value in {
    "null": None,
    "true": True,
    "yes": True,
    "on": True,
    "false": False,
    "no": False,
    "off": False,
}.items():
    _WORDS |= dict.fromkeys((_word, _word.title(), _word.upper()), _value)
_NUMBER_BEGINS = frozenset("+-.0123456789")
_WHOLE = re.compile(r"[-+]?(?:0|[1-9][0-9_]*)")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9_]+")
_FLOAT = re.compile(r"[-+]?(?:[0-9][0-9_]*\.[0-9_]*|\.[0-9][0-9_]*)(?:[eE][-+][0-9]+)?")
_SPECIAL = re.compile(r"([-+]?)\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")


def read_yaml(path: str | Path, most_bytes: int = MOST_BYTES) -> Any:
    """Read a YAML file.

    Returns:
        Null, a boolean, a number, text, a list, or a mapping from text; null where there are comments alone.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no regular file, is too large, or is no YAML of plain values; the line names it.
    """
    content = read_limited(path, most_bytes)
    try:
        return parse_yaml(content, most_bytes)
    except ValueError as error:
        raise InputError(f"{path} is not a YAML file: {error}") from error


def parse_yaml(content: str | bytes, most_bytes: int = MOST_BYTES) -> Any:
    """Return the values of YAML text; see `read_yaml`.

    Raises:
        ValueError: it is too large, or is no YAML of plain values; the text goes on after the file's name.
    """
    if len(content) > most_bytes:
        raise InputError(f"it has {len(content)} bytes: at most {most_bytes} are read")
    try:
        text = content if isinstance(content, str) else content.decode("utf-8-sig")
        text.encode()
    except UnicodeError as error:
        raise InputError(f"it is no UTF-8 text, from byte {getattr(error, 'start', 0)} on") from error
    builder = _Builder()
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            builder.take(event)
    except yaml.MarkedYAMLError as error:
        place = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise InputError(f"{place}{cut(error.problem or error.context)}") from error
    except yaml.YAMLError as error:
        raise InputError(cut(getattr(error, "reason", error))) from error
    return builder.value


class _Builder:
    """Values that the events so far make."""

    def __init__(self) -> None:
        self.value: Any = None
        self._documents = 0
        self._nodes = 0
        self._open: list[tuple[list[Any] | dict[str, Any], str | None]] = []
        self._key: str | None = None  # of the innermost mapping, while its value is awaited

    def take(self, event: Any) -> None:
        """Add what one event says.

        Raises:
            ValueError: it breaks a rule; the text names the line.
        """
        if isinstance(event, yaml.ScalarEvent):
            self._refuse(event)
            if self._awaits_key():
                self._take_key(event)
            else:
                self._add(_scalar(event))
        elif isinstance(event, (yaml.SequenceStartEvent, yaml.MappingStartEvent)):
            self._refuse(event)
            if self._awaits_key():
                raise InputError(f"{_line(event)}: a key must be text, no list or mapping")
            if len(self._open) >= MOST_DEPTH:
                raise InputError(f"{_line(event)}: it is nested deeper than {MOST_DEPTH} levels")
            made: list[Any] | dict[str, Any] = [] if isinstance(event, yaml.SequenceStartEvent) else {}
            self._add(made)
            self._open.append((made, self._key))
            self._key = None
        elif isinstance(event, (yaml.SequenceEndEvent, yaml.MappingEndEvent)):
            _, self._key = self._open.pop()
        elif isinstance(event, yaml.AliasEvent):
            raise InputError(f"{_line(event)}: an alias (*{cut(event.anchor, 20)}): write the value out")
        elif isinstance(event, yaml.DocumentStartEvent):
            self._documents += 1
            if self._documents > 1:
                raise InputError(f"{_line(event)}: a second document begins: one is read")

    def _refuse(self, event: Any) -> None:
        """Refuse anchors, tags and too many values."""
        self._nodes += 1
        if self._nodes > MOST_NODES:
            raise InputError(f"{_line(event)}: it holds more than {MOST_NODES} values")
        if event.anchor is not None:
            raise InputError(f"{_line(event)}: an anchor (&{cut(event.anchor, 20)}): write each value out")
        if event.tag is not None:
            raise InputError(f"{_line(event)}: the tag {shown(event.tag)}: plain values alone are read")

    def _awaits_key(self) -> bool:
        return bool(self._open) and self._key is None and isinstance(self._open[-1][0], dict)

    def _take_key(self, event: Any) -> None:
        key = _text(event)
        if key in self._open[-1][0]:
            raise InputError(f"{_line(event)}: the key {shown(key)} is there twice")
        self._key = key

    def _add(self, value: Any) -> None:
        if not self._open:
            self.value = value
            return
        holder = self._open[-1][0]
        if isinstance(holder, list):
            holder.append(value)
        else:
            assert self._key is not None
            holder[self._key] = value
            self._key = None


def _scalar(event: Any) -> Any:
    """Return what a scalar stands for; quoted ones are text."""
    text = event.value
    if event.style is not None and event.style != "":
        return _text(event)
    if text in _WORDS:
        return _WORDS[text]
    if text[0] not in _NUMBER_BEGINS:
        return text
    if len(text) > MOST_DIGITS and text[-1] in "0123456789_.":
        raise InputError(f"{_line(event)}: {shown(text)} has more than {MOST_DIGITS} digits")
    if _WHOLE.fullmatch(text):
        return int(text.replace("_", ""))
    if _FLOAT.fullmatch(text):
        return float(text.replace("_", ""))
    if _LEADING_ZERO.fullmatch(text):
        raise InputError(
            f"{_line(event)}: {shown(text)}: octal in one version of YAML, decimal in another: "
            "write no zero in front, or quotes around it"
        )
    special = _SPECIAL.fullmatch(text)
    if special is None:
        return text
    return float(f"{special.group(1) or ''}inf") if text[-1] in "fF" else float("nan")


def _text(event: Any) -> str:
    """Return the text of a scalar, which must be possible in a file."""
    text: str = event.value
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise InputError(f"{_line(event)}: {shown(text)} holds half a character") from error
    return text


def _line(event: Any) -> str:
    return f"line {event.start_mark.line + 1}"
