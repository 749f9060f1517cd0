"""Help of a verb: its purpose, its options in groups with plain names of their values, and examples.

All of it stands in the dataclass of options: its docstring, whose part `Examples:` comes last, the string
below each field, and `GROUPS`, the first option of each group by the group's title.
"""

import ast
import dataclasses
import inspect
import itertools
import re
import shutil
import textwrap
import types
import typing
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

WORDS = {Path: "PATH", str: "NAME", int: "N", float: "NUMBER"}
"""Name of a value by its type."""
UNITS = {"mm": "MM", "deg": "DEG", "deg^2": "DEG2", "s": "SECONDS", "mm/s": "MM/S"}
"""Name of a number by the unit that its text states first, as in `[mm]`."""
NAMED = {"set": "NAME=VALUE", "stereo": "NAME=VALUE", "size": "WIDTH HEIGHT", "ghost": "PATH"}
NAMED |= {"dask": "ADDRESS", "live_host": "ADDRESS", "live_origin": "URL"}
"""Name of a value by the name of its option."""
WIDEST = 110  # characters of a line
COLUMN = 26  # character at which texts begin


class Option(NamedTuple):
    """An option as help shows it."""

    words: str  # with its values, as `--stroke MM MM`
    text: str
    default: str  # empty where it says nothing
    positional: bool


def is_positional(hint: Any) -> bool:
    """Return whether the annotation of an option makes it a positional argument."""
    import tyro

    return typing.get_args(tyro.conf.Positional[int])[1] in typing.get_args(hint)[1:]


def split_examples(options: type) -> tuple[str, list[str]]:
    """Return the docstring of a dataclass of options without its examples, and these, a command each."""
    text, _, examples = inspect.cleandoc(options.__doc__ or "").partition("\n\nExamples:\n")
    return text, [line.strip() for line in examples.splitlines()]


def options_in_groups(options: type) -> dict[str, list[Option]]:
    """Return the options of a verb by the title of their group; the first one holds what all verbs have."""
    hints, texts = typing.get_type_hints(options, include_extras=True), _texts(options)
    titles = {first: title for title, first in getattr(options, "GROUPS", {}).items()}
    title = "Options"
    groups: dict[str, list[Option]] = {title: []}
    shared = ("seed", "json")
    for field in sorted(dataclasses.fields(options), key=lambda field: field.name in shared):
        title = "Options" if field.name in shared else titles.get(field.name, title)
        option = _option(field, hints[field.name], texts.get(field.name, ""))
        groups.setdefault(title, []).append(option)
    return groups


def help_of(options: type, command: str) -> str:
    """Return the help of a verb."""
    text, examples = split_examples(options)
    width = min(shutil.get_terminal_size().columns, WIDEST)
    groups = options_in_groups(options)
    positional = [option for option in groups["Options"] if option.positional]
    parts = [" ".join([f"usage: {command} [options]", *(option.words for option in positional)])]
    parts += ["\n".join(_wrapped(part, width)) for part in text.split("\n\n")]
    parts += ["\n".join(_lines(option, width) for option in positional)] if positional else []
    for title, group in groups.items():
        parts.append("\n".join([f"{title}:", *(_lines(o, width) for o in group if not o.positional)]))
    return "\n\n".join([*parts, "\n".join(["Examples:", *(f"  {example}" for example in examples)])])


def _lines(option: Option, width: int) -> str:
    """Return an option with its text in the column to its right, or below it where its words are long."""
    hint = {"": "", "required": " (required)"}.get(option.default, f" (default: {option.default})")
    lines = _wrapped(option.text + hint, width - COLUMN)
    words = f"  {option.words}"
    fits = len(words) <= COLUMN - 2
    return f"\n{'':{COLUMN}}".join([f"{words:{COLUMN}}{lines[0]}", *lines[1:]] if fits else [words, *lines])


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, max(width, COLUMN), break_long_words=False, break_on_hyphens=False)


def _option(field: "dataclasses.Field[Any]", hint: Any, text: str) -> Option:
    markers = hint.__metadata__ if typing.get_origin(hint) is Annotated else ()
    plain = hint.__origin__ if markers else hint
    for marker in markers:  # of `tyro.conf.arg`
        if callable(more := getattr(marker, "help_behavior_hint", None)):
            text = f"{text} {more('')}"
    values = _values(field.name, plain, text)
    required = field.default is dataclasses.MISSING
    if is_positional(hint):
        return Option(values if required else f"[{values}]", text, "", True)
    flags = [f"--{field.name.replace('_', '-')}"]
    flags += [alias for marker in markers for alias in getattr(marker, "aliases", None) or ()]
    default = "required" if required else _shown(field.default)
    return Option(f"{', '.join(flags)} {values}".strip(), text, default, False)


def _shown(default: Any) -> str:
    if default is None or default is False:
        return ""
    return " ".join(map(str, default)) if isinstance(default, tuple) else str(default)


def _values(name: str, hint: Any, text: str) -> str:
    """Return what stands for the values of an option; empty for a switch."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        kinds = [kind for kind in typing.get_args(hint) if kind is not type(None)]
        return _values(name, kinds[0], text)
    if typing.get_origin(hint) is Literal:
        return "{" + ",".join(map(str, typing.get_args(hint))) + "}"
    if typing.get_origin(hint) is tuple:
        kinds = list(typing.get_args(hint))
        if name in NAMED and Ellipsis not in kinds:
            return NAMED[name]
        return " ".join("..." if kind is Ellipsis else _values(name, kind, text) for kind in kinds)
    unit = re.search(r"\[(\S+?)\]", text) if hint is float else None
    return NAMED.get(name) or UNITS.get(unit[1] if unit else "") or WORDS.get(hint, "")


def _texts(options: type) -> dict[str, str]:
    """Return the string below each field, also of the classes that it is derived from."""
    found = {}
    for kind in filter(dataclasses.is_dataclass, reversed(options.__mro__)):
        (tree,) = ast.parse(inspect.cleandoc(inspect.getsource(kind))).body
        assert isinstance(tree, ast.ClassDef)
        for pair in itertools.pairwise(tree.body):
            match pair:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                    found[name] = " ".join(text.split())
    return found
