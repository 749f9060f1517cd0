"""JSON and YAML whose structure is damaged by chance: keys, types, numbers, texts, depth, size."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import yaml

Generator = np.random.Generator
Raw = Any

NUMBERS = (
    float("nan"),
    float("inf"),
    -float("inf"),
    -1,
    0,
    10**400,
    -(10**30),
    2**63,
    1e308,
    5e-324,
    1.5,
    True,
)
TEXTS = (
    "x" * 100_000,
    "two\nlines",
    "a\rb\x1b[31mred\x07\x00",
    "<script>alert(1)</script><img src=x onerror=alert(2)>",
    "../../outside/precious.txt",
    "/etc/passwd",
    "\u202egnp.exe \ud83d\ude00 \u0000",
    "[link](javascript:alert(1)) | `code` | # head",
    "!!python/object/apply:os.system [true]",
    "",
    "nan",
    "1e400",
    "CON",
)
OTHERS = (None, [], {}, [[]], "text", 0, True, {"a": {"b": 1}}, [None], 3.5)


def places_in(value: Raw, at: tuple = ()) -> list[tuple]:
    """Ways to every value inside, that of the whole left out."""
    found = []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inside in items:
        found += [(*at, key), *places_in(inside, (*at, key))]
    return found


def edited(
    value: Raw, rng: Generator, edit: Callable[[Raw, Any], None], only: Callable[[Raw], bool] = bool
) -> Raw:
    """Call `edit(container, key)` at a random place; `only` says which values are places."""
    places = [way for way in places_in(value) if only is bool or only(value_at(value, way))]
    if not places:
        return value
    way = places[rng.integers(len(places))]
    edit(value_at(value, way[:-1]), way[-1])
    return value


def value_at(value: Raw, way: tuple) -> Raw:
    for key in way:
        value = value[key]
    return value


def delete(rng: Generator, value: Raw) -> Raw:
    return edited(value, rng, lambda inside, key: inside.__delitem__(key))


def retype(rng: Generator, value: Raw) -> Raw:
    other = OTHERS[rng.integers(len(OTHERS))]
    return edited(value, rng, lambda inside, key: inside.__setitem__(key, other))


def rename(rng: Generator, value: Raw) -> Raw:
    def edit(inside: Raw, key: Any) -> None:
        if isinstance(inside, dict):
            inside[TEXTS[rng.integers(len(TEXTS))] if rng.random() < 0.5 else f"{key}_"] = inside.pop(key)

    return edited(value, rng, edit)


def is_number(value: Raw) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def renumber(rng: Generator, value: Raw) -> Raw:
    number = NUMBERS[rng.integers(len(NUMBERS))]
    return edited(value, rng, lambda inside, key: inside.__setitem__(key, number), is_number)


def retext(rng: Generator, value: Raw) -> Raw:
    text = TEXTS[rng.integers(len(TEXTS))]
    return edited(
        value, rng, lambda inside, key: inside.__setitem__(key, text), lambda old: isinstance(old, str)
    )


def lengthen(rng: Generator, value: Raw) -> Raw:
    """Repeat a list or a text a hundred times."""

    def edit(inside: Raw, key: Any) -> None:
        inside[key] = inside[key] * 100

    return edited(value, rng, edit, lambda old: isinstance(old, str | list) and len(old) > 0)


def empty(rng: Generator, value: Raw) -> Raw:
    return edited(
        value,
        rng,
        lambda inside, key: inside.__setitem__(key, type(inside[key])()),
        lambda old: isinstance(old, dict | list | str),
    )


def other_top(rng: Generator, value: Raw) -> Raw:
    return (*OTHERS, *NUMBERS)[rng.integers(len(OTHERS) + len(NUMBERS))]


EDITS = {
    "delete": delete, "retype": retype, "rename": rename, "number": renumber, "text": retext,
    "lengthen": lengthen, "empty part": empty, "other top": other_top,
}  # fmt: skip


def marked(value: Raw, rng: Generator) -> tuple[Raw, str]:
    """The same with one value replaced by a mark, for texts that no writer would write."""
    mark = "MARK0123"
    if not places_in(value):
        return mark, mark
    return edited(value, rng, lambda inside, key: inside.__setitem__(key, mark)), mark


def deep(levels: int) -> Callable[[Generator, str], str]:
    def nested(rng: Generator, mark: str) -> str:
        opened, closed = [("[", "]"), ('{"a":', "}")][rng.integers(2)]
        end = closed * levels if rng.random() < 0.7 else ""
        return opened * levels + "1" + end

    return nested


def many(rng: Generator, mark: str) -> str:
    return "[" + ",".join(["1"] * 1_000_000) + "]"


def digits(rng: Generator, mark: str) -> str:
    return "9" * 200_000


INSERTS: dict[str, Callable[[Generator, str], str]] = {
    "50 deep": deep(50),
    "10,000 deep": deep(10_000),
    "200,000 deep": deep(200_000),
    "a million values": many,
    "200,000 digits": digits,
}
"""Texts that are put where a value stood."""


def json_edits() -> dict[str, Callable[[Generator, bytes], bytes]]:
    """Damage to JSON: bytes to bytes."""

    def by_value(edit: Callable) -> Callable[[Generator, bytes], bytes]:
        return lambda rng, data: json.dumps(edit(rng, json.loads(data)), indent=1).encode()

    def by_text(insert: Callable) -> Callable[[Generator, bytes], bytes]:
        def change(rng: Generator, data: bytes) -> bytes:
            value, mark = marked(json.loads(data), rng)
            return json.dumps(value).replace(f'"{mark}"', insert(rng, mark)).encode()

        return change

    def twice(rng: Generator, data: bytes) -> bytes:
        value = json.loads(data)
        if not isinstance(value, dict) or not value:
            return data
        key = list(value)[rng.integers(len(value))]
        text = json.dumps(value)
        return (
            text[:-1] + f", {json.dumps(key)}: {json.dumps(OTHERS[rng.integers(len(OTHERS))])}}}"
        ).encode()

    edits = {f"json: {name}": by_value(edit) for name, edit in EDITS.items()}
    edits |= {f"json: {name}": by_text(insert) for name, insert in INSERTS.items()}
    return edits | {"json: key twice": twice}


def yaml_edits() -> dict[str, Callable[[Generator, bytes], bytes]]:
    """Damage to YAML: bytes to bytes."""

    def by_value(edit: Callable) -> Callable[[Generator, bytes], bytes]:
        def change(rng: Generator, data: bytes) -> bytes:
            return yaml.safe_dump(edit(rng, yaml.safe_load(data)), allow_unicode=True).encode(
                errors="replace"
            )

        return change

    def by_text(insert: Callable) -> Callable[[Generator, bytes], bytes]:
        def change(rng: Generator, data: bytes) -> bytes:
            value, mark = marked(yaml.safe_load(data), rng)
            return yaml.safe_dump(value).replace(mark, insert(rng, mark)).encode()

        return change

    edits = {f"yaml: {name}": by_value(edit) for name, edit in EDITS.items()}
    edits |= {f"yaml: {name}": by_text(insert) for name, insert in INSERTS.items()}
    return edits | {
        "yaml: key twice": key_twice,
        "yaml: alias bomb": alias_bomb,
        "yaml: alias of itself": lambda rng, data: data + b"\nextra: &a [*a]\n",
        "yaml: two documents": lambda rng, data: data + b"\n---\n" + data,
        "yaml: merge": lambda rng, data: b"x: &x {episodes: 3}\n" + data + b"\n<<: *x\n",
        "yaml: tag": lambda rng, data: (
            data + b"\nextra: !!binary aGk=\nother: !unknown {a: 1}\nset: !!set {a}\n"
        ),
        "yaml: date": lambda rng, data: data + b"\nextra: 2026-13-45\n2026-99-99: 1\n",
        "yaml: tab": lambda rng, data: data.replace(b": ", b":\t", 1) + b"\n\t- a\n",
        "yaml: sexagesimal": lambda rng, data: data + b"\nextra: 190:20:30:99:99999999999999\n",
    }


def key_twice(rng: Generator, data: bytes) -> bytes:
    lines = [line for line in data.splitlines() if line[:1].isalpha() and b":" in line]
    if not lines:
        return data
    key = lines[rng.integers(len(lines))].split(b":")[0]
    return data + b"\n" + key + b": " + [b"1", b"text", b"[1, 2]", b"null"][rng.integers(4)] + b"\n"


def alias_bomb(rng: Generator, data: bytes) -> bytes:
    depth = int(rng.choice([6, 9, 30]))
    rows = [b"a0: &a0 [lol, lol, lol, lol, lol, lol, lol, lol, lol]"]
    for level in range(1, depth):
        rows.append(b"a%d: &a%d [" % (level, level) + b", ".join([b"*a%d" % (level - 1)] * 9) + b"]")
    value = b"*a%d" % (depth - 1)
    lines = data.splitlines()
    keyed = [index for index, line in enumerate(lines) if line[:1].isalpha() and b":" in line]
    if keyed and rng.random() < 0.7:  # where a value is expected, so that a message would show it
        at = keyed[rng.integers(len(keyed))]
        lines[at] = lines[at].split(b":")[0] + b": " + value
        lines = lines[: at + 1] + [line for line in lines[at + 1 :] if line[:1] not in (b" ", b"-")]
    return b"\n".join([*rows, *lines]) + b"\n"
