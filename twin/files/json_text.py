"""JSON that others wrote, within limits: plain values, or a pydantic model whose faults take one line."""

import json
import math
import re
import types
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.shown import cut, shown

if TYPE_CHECKING:  # plain values are read without it
    from pydantic import BaseModel, ValidationError

MOST_BYTES = 4 * MEBIBYTE
MOST_DIGITS = 300  # of a number: every integer of these is below the largest float

Model = TypeVar("Model", bound="BaseModel")


def read_json(path: str | Path, most_bytes: int = MOST_BYTES) -> dict[str, Any]:
    """Read the JSON object of a file of at most so many bytes; errors name the file."""
    content = read_limited(path, most_bytes)
    try:
        return parse_json_object(content, most_bytes)
    except ValueError as error:
        raise InputError(f"{path} {error}") from error


def parse_json_object(content: str | bytes, most_bytes: int = MOST_BYTES) -> dict[str, Any]:
    """Return a JSON object; see `parse_json`."""
    values = parse_json(content, most_bytes)
    if not isinstance(values, dict):
        raise InputError("is not a JSON object with keys")
    return values


def parse_json(content: str | bytes, most_bytes: int = MOST_BYTES) -> Any:
    """Return the values of JSON text, or of its bytes in UTF-8.

    A key given twice, NaN, infinity and more than `MOST_DIGITS` digits are refused. The message of an error
    continues a line that begins with the name of the text.
    """
    try:
        raw = content if isinstance(content, bytes) else content.encode()
        if len(raw) > most_bytes:
            raise InputError(f"has {len(raw)} bytes: at most {most_bytes} are read")
        text = raw.decode()
        values = json.loads(
            text, object_pairs_hook=_once, parse_constant=_refuse, parse_float=_finite, parse_int=_integer
        )
        if "\\u" in text:
            json.dumps(values, ensure_ascii=False).encode()  # refuses a lone surrogate
        return values
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise InputError(f"is not JSON: {cut(error.msg)}: {place}") from error
    except UnicodeError as error:
        start = getattr(error, "start", 0)
        raise InputError(f"is not JSON: no UTF-8 text, from byte {start} on") from error
    except RecursionError:
        raise InputError("is nested too deeply") from None


def validated(schema: type[Model], values: Mapping[str, Any]) -> Model:
    """Return values of a file as a model; an error names the wrong key, its value and the rule."""
    from pydantic import ValidationError

    try:
        return schema.model_validate(values)
    except ValidationError as error:
        raise InputError(first_fault(schema, error)) from None


def first_fault(schema: "type[BaseModel]", error: "ValidationError") -> str:
    """Name the first wrong key of a file, its value and the rule, in one line."""
    fault = error.errors(include_url=False, include_context=False)[0]
    place = fault["loc"]
    name = key_name(place)
    if fault["type"] == "missing":
        return f"{name} is missing, it must be there"
    if fault["type"] == "extra_forbidden":
        return f"unknown key {name}; valid: {cut(', '.join(_valid_keys(schema, place[:-1])))}"
    return f"{name} = {shown(fault['input'])}: {rule_of(fault['msg'])}"


def rule_of(message: str) -> str:
    """Return a message of pydantic as a rule: what must be."""
    message = message.removeprefix("Value error, ")
    return cut(re.sub(r"^\w+( \w+)? should ", "must ", message))


# Parts of a place that are not of the file: they name the alternative that was tried.
_TRIED = ("float", "int", "str", "bool", "constrained-float", "constrained-int", "constrained-str")


def key_name(path: Sequence[int | str]) -> str:
    """Return a key's place in a file, as in `files[1].statistics.bend_deg.mean`."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in path[:12] if part not in _TRIED)
    return cut("".join(parts).removeprefix("."), 80)


def _valid_keys(schema: Any, path: Sequence[int | str]) -> list[str]:
    """Return the keys of the part of a schema that a path leads to."""
    for part in path:
        if hasattr(schema, "model_fields"):
            schema = schema.model_fields[str(part)].annotation
        else:  # a tuple of one kind, or a mapping from names to one kind
            schema = next(kind for kind in reversed(typing.get_args(schema)) if kind is not Ellipsis)
        if isinstance(schema, types.UnionType):
            schema = typing.get_args(schema)[0]
    return list(schema.model_fields)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        keys = [key for key, _ in pairs]
        raise InputError(f"has the key {shown(next(key for key in keys if keys.count(key) > 1))} twice")
    return values


def _refuse(constant: str) -> None:
    raise InputError(f"holds {constant}, which is no number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise InputError(f"holds {cut(text, 40)}, which is beyond the largest number")
    return value


def _integer(text: str) -> int:
    if len(text) > MOST_DIGITS:
        raise InputError(f"holds a number of more than {MOST_DIGITS} digits")
    return int(text)
