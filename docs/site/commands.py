"""The command reference: every verb, its purpose, options and examples, as `--help` has them."""

import importlib

from scripts.__main__ import VERBS
from scripts.command import MODULES
from scripts.help_text import Option, options_in_groups, split_examples


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
    options = module.main.args[0]
    groups = options_in_groups(options)
    text, examples = split_examples(options)
    positional = [option for option in groups["Options"] if option.positional]
    usage = " ".join([f"endotwin {verb} [options]", *(option.words for option in positional)])
    rows = ["| option | if not given | what |", "|---|---|---|"]
    for title, group in groups.items():
        rows += [f"| **{title}** | | |"] if len(groups) > 1 else []
        rows += [_row(option) for option in group]
    shown = "\n".join(["```sh", *examples, "```"])
    return "\n\n".join([f"## {verb}", text, f"```text\n{usage}\n```", "\n".join(rows), shown])


def _row(option: Option) -> str:
    default = option.default if option.default in ("", "required") else f"`{option.default}`"
    text = option.text.replace("|", "\\|").replace("<", "&lt;")
    return f"| `{option.words}` | {default} | {text} |"
