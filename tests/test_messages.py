"""The library names its own parameters in messages; flags are the command line's business."""

import ast
import re

from source_tree import documenting_strings, source_files

FLAG = re.compile(r"(?<![\w-])--[a-z]|`endotwin ")

OTHER_TOOLS = {"twin/workers/dask_cluster.py": " --nthreads 1`"}
"""Flags of commands that are not ours."""

PENDING: tuple[str, ...] = (
    "twin/dataset/",
    "twin/hysteresis/model.py",
    "twin/measured/folder.py",
    "twin/report/page.py",
    "twin/suite/scenarios.py",
    "rl/",
)
"""Temporary: what has not been rewritten yet; the page of the report may show commands for good."""


def texts_with_flags(name: str, tree: ast.Module) -> list[str]:
    documenting = {text for _, text in documenting_strings(name, tree)}
    return [
        f"{name}:{node.lineno}: {node.value}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value not in documenting
        and FLAG.search(node.value)
        and node.value != OTHER_TOOLS.get(name)
    ]


def test_no_message_of_the_library_speaks_of_flags():
    found = [
        text
        for name, tree in source_files("twin", "rl", without=PENDING)
        for text in texts_with_flags(name, tree)
    ]
    assert not found, "\n".join(found)


def test_the_rule_finds_a_flag():
    tree = ast.parse(
        '"""Docstring of `endotwin run --out`."""\nraise ValueError(f"{x}: choose another --out")'
    )
    assert len(texts_with_flags("a.py", tree)) == 1
