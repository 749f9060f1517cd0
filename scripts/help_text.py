"""Help of a verb: plain names for the values of options, and no default that is empty."""

import dataclasses
import types
import typing
from pathlib import Path
from typing import Annotated, Any, Literal

WORDS = {Path: "FILE", str: "TEXT", int: "N", float: "NUMBER"}
UNITS = {"_mm": "MM", "_deg": "DEG", "_s": "SECONDS", "_mm_s": "MM/S", "_deg2": "DEG2"}
"""Name of a value by the end of its option's name."""
NAMED = {"seconds": "SECONDS", "sample_time": "SECONDS", "stroke": "MM MM", "lateral_stroke": "MM MM"}
NAMED |= {"out": "PATH", "data": "PATH", "logs": "PATH", "train": "PATH", "noise_variance": "DEG2"}
NAMED |= {"speed": "MM/S", "size": "WIDTH HEIGHT", "preset": "NAME"}
"""Name of the values of an option by its name."""


def is_positional(hint: Any) -> bool:
    """Return whether the annotation of an option makes it a positional argument."""
    import tyro

    return typing.get_args(tyro.conf.Positional[int])[1] in typing.get_args(hint)[1:]


def with_readable_help(options: type) -> None:
    """Annotate the fields of a dataclass of options for tyro, once."""
    import tyro

    hints = typing.get_type_hints(options, include_extras=True)
    shown: dict[str, Any] = {}
    for field in dataclasses.fields(options):
        hint = hints[field.name]
        markers = hint.__metadata__ if typing.get_origin(hint) is Annotated else ()
        if any(type(marker).__name__ == "_ArgConfig" for marker in markers):
            continue
        plain = hint.__origin__ if markers else hint
        metavar = _metavar(field.name, plain) or None
        if is_positional(hint) and field.default is not dataclasses.MISSING:
            metavar = f"[{metavar}]"
        arg = tyro.conf.arg(metavar=metavar, help_behavior_hint=_default)
        if plain is bool and field.default is False:
            hint = Annotated[hint, typing.get_args(tyro.conf.FlagCreatePairsOff[bool])[1]]
        shown[field.name] = Annotated[hint, arg]
    options.__annotations__ = {**vars(options).get("__annotations__", {}), **shown}


def _default(default: str) -> str:
    return "" if default in ("None", "", "False") else f"(default: {default})"


def _metavar(name: str, hint: Any) -> str:
    """Return what stands for the values of an option; empty for a switch."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        kinds = [kind for kind in typing.get_args(hint) if kind is not type(None)]
        return _metavar(name, kinds[0]) if len(kinds) == 1 else ""
    if typing.get_origin(hint) is Literal:
        return "{" + ",".join(map(str, typing.get_args(hint))) + "}"
    if typing.get_origin(hint) is tuple:
        kinds = list(typing.get_args(hint))
        if name in NAMED and Ellipsis not in kinds:
            return NAMED[name]
        words = [_metavar(name, kind) for kind in kinds if kind is not Ellipsis]
        return " ".join(words) + (" ..." if Ellipsis in kinds else "") if all(words) else ""
    if name in NAMED:
        return NAMED[name]
    unit = max((end for end in UNITS if name.endswith(end) and hint is float), key=len, default="")
    return UNITS[unit] if unit else WORDS.get(hint, "")
