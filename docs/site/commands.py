"""The command reference: every verb, its purpose and its options, from the dataclasses that parse them."""

import dataclasses
import importlib
import inspect
from typing import Any

from scripts.__main__ import VERBS
from scripts.command import MODULES
from scripts.help_text import is_positional


def page() -> str:
    """Return the page."""
    parts = [
        "# Commands",
        "`endotwin VERB --help` prints the same. Verbs that draw random numbers take `--seed`. With `--json` "
        "a verb prints its summary as one JSON object. [Files](../files.md) states what commands read, "
        "write and refuse.",
        "| verb | purpose |\n|---|---|\n"
        + "\n".join(f"| [`{verb}`](#{verb}) | {purpose} |" for verb, purpose in VERBS.items()),
    ]
    return "\n\n".join([*parts, *(_verb(verb) for verb in VERBS)]) + "\n"


def _verb(verb: str) -> str:
    module = importlib.import_module(f"scripts.{MODULES.get(verb, verb)}")
    options = next(
        value
        for value in vars(module).values()
        if dataclasses.is_dataclass(value) and isinstance(value, type) and value.__module__ == module.__name__
    )
    texts = _strings(options)
    rows = ["| option | if not given | what |", "|---|---|---|"]
    usage = [f"endotwin {verb}"]
    for field in dataclasses.fields(options):
        positional = is_positional(field.type)
        name = field.name.upper() if positional else f"--{field.name.replace('_', '-')}"
        if positional:
            usage.append(name)
        rows.append(f"| `{name}` | {_default(field)} | {_cell(texts.get(field.name, ''))} |")
    text = inspect.cleandoc(options.__doc__ or "")
    return f"## {verb}\n\n{text}\n\n```text\n{' '.join(usage)} [options]\n```\n\n" + "\n".join(rows)


def _strings(options: type) -> dict[str, str]:
    """Return the string below each field, which `--help` prints."""
    import ast

    found, last = {}, ""
    kinds = [kind for kind in reversed(options.__mro__) if dataclasses.is_dataclass(kind)]
    trees = [ast.parse(inspect.cleandoc(inspect.getsource(kind))).body[0] for kind in kinds]
    for node in [node for tree in trees if isinstance(tree, ast.ClassDef) for node in tree.body]:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            last = node.target.id
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and last:
            found[last] = " ".join(str(node.value.value).split())
    return found


def _default(field: "dataclasses.Field[Any]") -> str:
    if field.default is dataclasses.MISSING:
        return "required"
    value = field.default
    if value is None or value == ():
        return ""
    if isinstance(value, bool):
        return "no" if not value else "yes"
    shown = (
        " ".join(map(str, value))
        if isinstance(value, tuple)
        else f"{value:g}"
        if isinstance(value, float)
        else value
    )
    return f"`{shown}`"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")
