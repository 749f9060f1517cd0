"""Docstrings say in plain English what a thing is, and `help()` of a dataclass what each of its fields is."""

import ast
import inspect
import re

import pytest
from source_tree import documenting_strings, source_files

RIDDLES = ("What", "How", "Where", "Whether", "Which", "Who", "Why", "When", "Neither", "From where")
"""Openings of a sentence that does not name the thing that it describes."""


def faults_of(first_line: str) -> list[str]:
    faults = []
    if first_line.split()[0].rstrip(":,") in RIDDLES or first_line.startswith("From where"):
        faults.append("opens with a riddle")
    if not first_line.endswith("."):
        faults.append("does not end in a period")
    return faults


def fields_without_text(node: ast.ClassDef) -> list[str]:
    """Return the public fields of a dataclass or NamedTuple that its `Attributes:` section does not name."""
    section = inspect.cleandoc(ast.get_docstring(node) or "").partition("\nAttributes:\n")[2]
    told = re.findall(r"^    (\w+): \S", section, re.MULTILINE)
    fields = [
        statement.target.id
        for statement in node.body
        if isinstance(statement, ast.AnnAssign)
        and isinstance(statement.target, ast.Name)
        and "ClassVar" not in ast.unparse(statement.annotation)
    ]
    return [name for name in fields if not name.startswith("_") and name not in told]


def is_record(node: ast.AST) -> bool:
    if not isinstance(node, ast.ClassDef) or node.name.startswith("_"):
        return False
    marks = [ast.unparse(mark) for mark in (*node.decorator_list, *node.bases)]
    return any(re.match(r"(dataclasses\.)?dataclass\b|(typing\.)?NamedTuple$", mark) for mark in marks)


@pytest.mark.parametrize("folder", ["twin", "rl", "scripts"])
def test_a_docstring_names_its_thing_and_ends_in_a_period(folder):
    faults = [
        f"{place}: {fault}: {text.strip().splitlines()[0]}"
        for name, tree in source_files(folder)
        for place, text in documenting_strings(name, tree)
        for fault in faults_of(text.strip().splitlines()[0] if "\n\n" in text else " ".join(text.split()))
    ]
    assert not faults, "\n".join(faults)


def test_help_shows_every_field_of_a_dataclass():
    records = [
        (f"{name}: {node.name}", node)
        for name, tree in source_files("twin", "rl")
        for node in ast.walk(tree)
        if is_record(node)
    ]
    assert len(records) >= 15
    missing = {name: fields_without_text(node) for name, node in records}
    assert not {name: fields for name, fields in missing.items() if fields}


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("SHA-256 of a file.", 0),
        ("What a file is known by.", 1),
        ("Whether: is it so?", 2),
        ("Number of samples", 1),
    ],
)
def test_the_rule_tells_a_riddle_from_a_name(line, count):
    assert len(faults_of(line)) == count


def test_the_rule_misses_no_field():
    told = "class A(NamedTuple):\n    '''Pair.\n\n    Attributes:\n        x: length [m].\n    '''\n"
    (node,) = ast.parse(told + "    x: float\n    y: float\n    _z: float\n").body
    assert is_record(node)
    assert fields_without_text(node) == ["y"]
