"""Faults that pydantic finds in what a file says, each in one line."""

import re
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from twin.errors import InputError
from twin.files.shown import cut, shown

_TRIED = ("float", "int", "str", "bool", "constrained-float", "constrained-int", "constrained-str")
"""Parts of a place that are of no file: they tell which of several kinds was tried."""

Model = TypeVar("Model", bound=BaseModel)


def validated(schema: type[Model], values: Mapping[str, Any]) -> Model:
    """Return values of a file as its schema has them.

    Raises:
        ValueError: they do not fit; the line says which key is wrong, its value and the rule.
    """
    try:
        return schema.model_validate(values)
    except ValidationError as error:
        raise InputError(first_fault(schema, error)) from None


def first_fault(schema: type[BaseModel], error: ValidationError) -> str:
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


def key_name(path: Sequence[int | str]) -> str:
    """Return a key's place in a file, as in `files[1].statistics.bend_deg.mean`."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in path[:12] if part not in _TRIED)
    return cut("".join(parts).removeprefix("."), 80)


def _valid_keys(schema: Any, path: Sequence[int | str]) -> list[str]:
    """Return the keys of the part of a schema that a path leads to."""
    for part in path:
        if isinstance(schema, type) and issubclass(schema, BaseModel):
            schema = schema.model_fields[str(part)].annotation
        else:  # a tuple of one kind, or a mapping from names to one kind
            schema = next(kind for kind in reversed(typing.get_args(schema)) if kind is not Ellipsis)
        if isinstance(schema, types.UnionType):
            schema = typing.get_args(schema)[0]
    return list(schema.model_fields)
