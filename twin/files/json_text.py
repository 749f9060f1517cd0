"""Reader of JSON that others wrote, with limits of size, depth and number."""

import itertools
import json
import math
import re
from pathlib import Path
from typing import Any

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.shown import cut, shown

MOST_BYTES = 4 * MEBIBYTE
MOST_DEPTH = 20
MOST_VALUES = 1_000_000
MOST_DIGITS = 300
"""Digits of a number: every whole number of these is below the largest float."""

_STRING = re.compile(rb'"[^"\\]*(?:\\.[^"\\]*)*(?:"|\\?\Z)', re.DOTALL)
_DIGITS = re.compile(rb"[0-9]{%d}" % (MOST_DIGITS + 1))
_NOT_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
_STEP = [0] * 256
for _opening, _closing in (b"[]", b"{}"):
    _STEP[_opening], _STEP[_closing] = 1, -1


def read_json(
    path: str | Path, most_bytes: int = MOST_BYTES, most_values: int = MOST_VALUES
) -> dict[str, Any]:
    """Read the JSON object of a file.

    Args:
        path: of the file.
        most_bytes: limit of its size.
        most_values: limit of the number of values in it, at any depth.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no regular file, is too large, or holds no object of plain values; it is named.
    """
    content = read_limited(path, most_bytes)
    try:
        return parse_json_object(content, most_bytes, most_values)
    except ValueError as error:
        raise InputError(f"{path} {error}") from error


def parse_json_object(
    content: str | bytes, most_bytes: int = MOST_BYTES, most_values: int = MOST_VALUES
) -> dict[str, Any]:
    """Return a JSON object; see `parse_json`.

    Raises:
        ValueError: it is something else.
    """
    values = parse_json(content, most_bytes, most_values)
    if not isinstance(values, dict):
        raise InputError("is not a JSON object with keys")
    return values


def parse_json(content: str | bytes, most_bytes: int = MOST_BYTES, most_values: int = MOST_VALUES) -> Any:
    """Return what JSON text says; a key given twice, NaN, infinity and half a character are refused.

    Args:
        content: the text, or its bytes in UTF-8.
        most_bytes: limit of its size.
        most_values: limit of the number of values in it, at any depth.

    Raises:
        ValueError: it is not JSON, or beyond a limit; the text goes on after what it is of.
    """
    try:
        text = content if isinstance(content, str) else content.decode()
        raw = text.encode()
    except UnicodeError as error:
        raise InputError(f"is not JSON: no UTF-8 text, from byte {getattr(error, 'start', 0)} on") from error
    if len(raw) > most_bytes:
        raise InputError(f"has {len(raw)} bytes: at most {most_bytes} are read")
    _check_limits(raw, most_values)
    try:
        values = json.loads(
            text, object_pairs_hook=_once, parse_constant=_refuse_constant, parse_float=_finite
        )
    except json.JSONDecodeError as error:
        raise InputError(
            f"is not JSON: {cut(error.msg)}: line {error.lineno}, column {error.colno}"
        ) from error
    if "\\u" in text:
        _refuse_half_characters(values)
    return values


def _check_limits(raw: bytes, most_values: int) -> None:
    """Count values and levels before any is made: the decoder recurses, and each value costs memory."""
    bare = _STRING.sub(b"", raw)
    brackets = bare.translate(None, _NOT_BRACKETS)
    if bare.count(b",") + len(brackets) > most_values:
        raise InputError(f"holds more than {most_values} values")
    if max(itertools.accumulate(map(_STEP.__getitem__, brackets)), default=0) > MOST_DEPTH:
        raise InputError(f"is nested deeper than {MOST_DEPTH} levels")
    if _DIGITS.search(bare):
        raise InputError(f"holds a number of more than {MOST_DIGITS} digits")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise InputError(f"has the key {shown(key)} twice")
            seen.add(key)
    return values


def _refuse_constant(constant: str) -> None:
    raise InputError(f"holds {constant}, which is no number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise InputError(f"holds {cut(text, 40)}, which is beyond the largest number")
    return value


def _refuse_half_characters(values: Any) -> None:
    try:
        json.dumps(values, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        raise InputError("holds half a character (a lone surrogate)") from error
