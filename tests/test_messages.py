"""The library names its own parameters in messages; flags are the command line's business."""

import ast
import re

from source_tree import documenting_strings, source_files

FLAG = re.compile(r"(?<![\w-])--[a-z]")

ALLOWED = {
    "twin/workers/dask_cluster.py": " --nthreads 1`",  # of a command that is not ours
    "twin/benchmark/start.py": "--help",  # which it measures
    "twin/benchmark/stream.py": "--",  # of the command that it measures
    **dict.fromkeys(  # commands that made a run, which its page shows
        (f"twin/report/{name}.py" for name in ("run_page", "dataset_page", "training_page", "facts")), "--"
    ),
    "twin/report/evaluation_page.py": "--help",
}
"""Parts of texts that hold a flag and are no message."""


def texts_with_flags(name: str, tree: ast.Module) -> list[str]:
    documenting = {text for _, text in documenting_strings(name, tree)}
    return [
        f"{name}:{node.lineno}: {node.value}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value not in documenting
        and FLAG.search(node.value)
        and ALLOWED.get(name, "\0") not in node.value
    ]


def test_no_message_of_the_library_speaks_of_flags():
    found = [text for name, tree in source_files("twin", "rl") for text in texts_with_flags(name, tree)]
    assert not found, "\n".join(found)


def test_the_rule_finds_a_flag():
    tree = ast.parse(
        '"""Docstring of `endotwin run --out`."""\nraise ValueError(f"{x}: choose another --out")'
    )
    assert len(texts_with_flags("a.py", tree)) == 1
