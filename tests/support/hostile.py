"""Hostile versions of a valid file: any key deleted, retyped, deepened or enlarged, at any depth."""

import copy
from typing import Any

from hypothesis import strategies as st

from twin.errors import InputError, MissingFileError

LONGEST = 300
"""Characters of a message, besides the folder that a test works in."""


def deep(levels: int) -> list[Any]:
    """A list in a list in a list."""
    value: list[Any] = []
    for _ in range(levels):
        value = [value]
    return value


PLAIN = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=30)
NESTED = st.recursive(
    PLAIN, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=9), inner, max_size=3)
)
HOSTILE = NESTED | st.sampled_from(
    [
        10**299,
        -1,
        1e300,
        "x" * 5000,
        "a\nb",
        "\x1b[31m",
        "<script>",
        "../../x",
        [1] * 2000,
        {"a": {}},
        deep(60),
    ]
)


@st.composite
def mutated(draw: st.DrawFn, valid: Any) -> Any:
    """A value whose parts at one or two places are deleted, replaced or nested."""
    value = copy.deepcopy(valid)
    for _ in range(draw(st.integers(1, 2))):
        holder, key = None, None
        here = value
        while isinstance(here, (dict, list)) and here and (holder is None or draw(st.integers(0, 3))):
            holder = here
            key = draw(st.sampled_from(sorted(here) if isinstance(here, dict) else range(len(here))))
            here = holder[key]
        if holder is None:
            return copy.deepcopy(draw(HOSTILE))
        kind = draw(st.sampled_from(["delete", "replace", "deepen", "add"]))
        if kind == "delete":
            del holder[key]
        elif kind == "add" and isinstance(holder, dict):
            holder[draw(st.text(max_size=9))] = copy.deepcopy(draw(HOSTILE))
        else:
            holder[key] = [here] if kind == "deepen" else copy.deepcopy(draw(HOSTILE))
    return value


def refusal(read, path) -> str | None:
    """Message of a reader that refuses a file, in one line that names it; None if it takes it."""
    try:
        read(path)
    except (InputError, MissingFileError) as error:
        text = str(error)
        assert len(text.splitlines()) == 1
        assert text.isprintable()
        assert path.name in text
        assert len(text.replace(str(path.parent), "")) <= LONGEST
        return text
    return None
