"""YAML that others wrote, within limits: plain values, without aliases, tags or a key given twice.

Words are null, a boolean or a number as in YAML 1.2, `1e6` too, and `yes`, `no`, `on`, `off` as in 1.1.
Dates, `1:30` and `010` are text.
"""

import re
from pathlib import Path
from typing import Any, ClassVar

import yaml

from twin.errors import InputError
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.shown import cut, shown

MOST_BYTES = 4 * MEBIBYTE
MOST_DEPTH = 20
MOST_NODES = 120_000
"""Number of values, lists and mappings: a recipe has one for each sample of a given command."""

_BASE: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(_BASE):  # type: ignore[misc]
    """Loader of plain values, all of whose keys are text, each given once."""

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.MarkedYAMLError(problem="a key must be text", problem_mark=key.start_mark)
            if key.value in values:
                problem = f"the key {shown(key.value)} is there twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            values[key.value] = self.construct_object(value, deep=True)
        return values


_EXPONENT = r"[eE][-+]?[0-9]+"
for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"(?i:true|false|yes|no|on|off)", list("tTfFyYnNoO")),
    ("int", r"[-+]?(?:0|[1-9][0-9_]{0,299})", list("-+0123456789")),
    (
        "float",
        rf"[-+]?(?:[0-9][0-9_]*\.[0-9_]*|\.[0-9][0-9_]*)(?:{_EXPONENT})?|[-+]?[0-9]+{_EXPONENT}"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), _first)


def read_yaml(path: str | Path, most_bytes: int = MOST_BYTES) -> Any:
    """Read the values of a YAML file; null where there are only comments. Errors name the file."""
    content = read_limited(path, most_bytes)
    try:
        return parse_yaml(content, most_bytes)
    except ValueError as error:
        raise InputError(f"{path} is not a YAML file: {error}") from error


def parse_yaml(content: str | bytes, most_bytes: int = MOST_BYTES) -> Any:
    """Return the values of YAML text; see `read_yaml`."""
    if len(content) > most_bytes:
        raise InputError(f"it has {len(content)} bytes: at most {most_bytes} are read")
    try:
        text = content if isinstance(content, str) else content.decode("utf-8-sig")
        text.encode()
    except UnicodeError as error:
        raise InputError(f"it is no UTF-8 text, from byte {getattr(error, 'start', 0)} on") from error
    try:
        _check_events(text)
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        place = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise InputError(f"{place}{cut(error.problem or error.context)}") from error
    except yaml.YAMLError as error:
        raise InputError(cut(getattr(error, "reason", error))) from error


def _check_events(text: str) -> None:
    """Refuse what would expand, recurse or be constructed, before any value is made."""
    depth = nodes = documents = 0
    for event in yaml.parse(text, Loader=_BASE):
        mark: Any = event.start_mark
        problem = ""
        if isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        elif isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            problem = "a second document begins: one is read" if documents > 1 else ""
        elif isinstance(event, yaml.NodeEvent):
            nodes += 1
            depth += isinstance(event, yaml.CollectionStartEvent)
            if event.anchor is not None:
                problem = f"an anchor or alias ({cut(event.anchor, 20)}): write each value out"
            elif (tag := getattr(event, "tag", None)) is not None:
                problem = f"the tag {shown(tag)}: plain values alone are read"
            elif depth > MOST_DEPTH:
                problem = f"it is nested deeper than {MOST_DEPTH} levels"
            elif nodes > MOST_NODES:
                problem = f"it holds more than {MOST_NODES} values"
        if problem:
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=mark)
