"""Command that makes a result again, from the options of the verb that made it."""

import dataclasses
import shlex
import typing
from typing import Any

import tyro

LEFT_OUT = frozenset({"workers", "dask", "json"})
"""Options that no result depends on."""
_POSITIONAL = typing.get_args(tyro.conf.Positional[int])[1]


def command_of(verb: str, args: Any, leave_out: typing.Collection[str] = ()) -> str:
    """Return the command line of a verb: what differs from the defaults, and the seed.

    Args:
        verb: its name.
        args: its dataclass of options.
        leave_out: options that are not stated, such as `out`, which the folder of the result tells.
    """
    positional: list[str] = []
    flags: list[str] = []
    for field in dataclasses.fields(args):
        value = getattr(args, field.name)
        if field.name in LEFT_OUT or field.name in leave_out or value is None:
            continue
        if _POSITIONAL in typing.get_args(field.type)[1:]:
            positional += _words(value)
        elif field.name == "seed" or value != field.default:
            flag = f"--{field.name.replace('_', '-')}"
            flags += [flag] if value is True else [flag, *_words(value)]
    return shlex.join(["endotwin", verb, *positional, *flags])


def _words(value: Any) -> list[str]:
    """Return a value as the words of a command line."""
    if isinstance(value, tuple | list):
        return [word for part in value for word in _words(part)]
    return [repr(value).removesuffix(".0") if isinstance(value, float) else str(value)]
