"""The Python reference: what `import twin` offers, from signatures and docstrings."""

import inspect
import re

import twin

HEADINGS = ("Args", "Returns", "Raises", "Attributes", "Yields")
DATA = ("preset", "simulate", "episode", "dataset", "identify", "estimator")


def page() -> str:
    """Return the page."""
    names = sorted(twin.__all__, key=str.lower)
    table = "\n".join(
        f"| [`twin.{name}`](#twin-{name.lower()}) | {_first(getattr(twin, name))} |" for name in names
    )
    head = (
        "# Python\n\n`import twin` offers what a notebook needs, and loads it when it is first used. All "
        "else is importable from its module, and `help()` shows it; names that begin with an underscore are "
        f"private.\n\n| name | what |\n|---|---|\n{table}"
    )
    return "\n\n".join([head, *(_entry(name) for name in names)]) + "\n"


def _entry(name: str) -> str:
    value = getattr(twin, name)
    try:
        signature = _wrapped(f"twin.{name}", str(inspect.signature(value)))
    except (TypeError, ValueError):
        signature = f"twin.{name}"
    parts = [f"## twin.{name} {{#twin-{name.lower()}}}", f"```python\n{signature}\n```", _docstring(value)]
    if inspect.isclass(value):
        members = [
            (member, of)
            for member, of in vars(value).items()
            if not member.startswith("_")
            and (inspect.isfunction(of) or isinstance(of, property | classmethod | staticmethod))
        ]
        rows = [f"| `{member}{_short(of)}` | {_first(of)} |" for member, of in members]
        if rows:
            parts.append("| member | what |\n|---|---|\n" + "\n".join(rows))
    module = value.__module__
    parts.append(f"*In `{module.replace('.', '/')}.py`.*" if not module.endswith("__init__") else "")
    return "\n\n".join(part for part in parts if part)


def _wrapped(name: str, signature: str) -> str:
    """Return a signature, each parameter on its line where it is long."""
    signature = re.sub(r"<[^>]*>", "...", signature.replace("NoneType", "None"))
    signature = re.sub(
        r"\b(?:numpy\.)?ndarray\[tuple\[Any, \.\.\.\], (?:numpy\.)?dtype\[(?:numpy\.)?float64\]\]",
        "Array",
        signature,
    )
    signature = re.sub(
        r"\b(?:twin\.(?:\w+\.)+|pathlib\.|collections\.abc\.|typing\.)(?=[A-Z])", "", signature
    )
    if len(name + signature) < 100:
        return name + signature
    inner, _, after = signature[1:].rpartition(")")
    depth, parts, current = 0, [], ""
    for letter in inner:
        depth += (letter in "[(") - (letter in "])")
        if letter == "," and depth == 0:
            parts.append(current.strip())
            current = ""
        else:
            current += letter
    parts.append(current.strip())
    return f"{name}(\n    " + ",\n    ".join(part for part in parts if part) + f",\n){after}"


def _short(of: object) -> str:
    return "" if isinstance(of, property) else "()"


def _first(of: object) -> str:
    text = inspect.cleandoc(getattr(of, "__doc__", None) or "").partition("\n\n")[0]
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")


def _docstring(of: object) -> str:
    """Return a docstring in Markdown: its sections as lists."""
    lines, text, section = inspect.cleandoc(of.__doc__ or "").splitlines(), [], ""
    for line in lines:
        heading = line.rstrip(":")
        if heading in HEADINGS and line.endswith(":"):
            section = heading
            text.append(f"\n**{heading}**\n")
        elif section and line.startswith("    ") and not line.startswith("     "):
            name, colon, rest = line.strip().partition(": ")
            listed = section in ("Args", "Attributes", "Raises") and colon
            text.append(f"- `{name}`: {rest}" if listed else line.strip())
        elif section and line.startswith("     "):
            text[-1] += " " + line.strip()
        else:
            section = section if line.startswith(" ") or not line else ""
            text.append(line)
    return "\n".join(text).replace("<", "&lt;")
