"""The estimators, a page each, from the method table: what each knows, its equations, code and figures."""

import csv
import functools
import importlib
import inspect
import re
from pathlib import Path

from twin.estimation.registry import GIVEN, MethodSpec, Training, method_specs
from twin.evaluation.paper import noise_label
from twin.report.run_page import agent_names

EQUATIONS = Path(__file__).with_name("equations.md")
PUBLISHED = Path(__file__).parents[1] / "data"
"""Published scores and costs on the frozen test set, as `endotwin evaluate --suite full` writes them."""
MODELS = ("coleman-hodgdon", "bouc-wen", "prandtl-ishlinskii")


def pages() -> dict[str, str]:
    """Return the page of each method, and their index, by name of the page."""
    specs = method_specs()
    return {"index": _index(specs), **{slug(spec.name): _page(spec) for spec in specs}}


def slug(name: str) -> str:
    """Return the name of a method's page."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def equations() -> dict[str, str]:
    """Return the equations, by name of the method, or by `model NAME`."""
    parts = re.split(r"^## (.+)$", EQUATIONS.read_text(), flags=re.MULTILINE)[1:]
    return {
        name.strip(): text.strip()
        for names, text in zip(parts[::2], parts[1::2], strict=True)
        for name in names.split(";")
    }


def module_of(spec: MethodSpec) -> str:
    """Return the module that declares a method."""
    return spec.build.__module__


def _index(specs: list[MethodSpec]) -> str:
    rows = [
        f"| [{spec.name}]({slug(spec.name)}.md) | {spec.presentation.family} | {spec.knows} "
        f"| {_learned(spec)} |"
        for spec in specs
    ]
    return (
        "# Estimators\n\nEvery method that `endotwin evaluate` compares, in the order of tables. "
        "*Knows*: what it is given (below). [How the angle is estimated](../method.md) states what "
        "each is fitted on; [the full benchmark](../results/benchmark.md) has its errors.\n\n"
        "| method | family | knows | trained by |\n|---|---|---|---|\n"
        + "\n".join(rows)
        + "\n\n"
        + "\n".join(f"- *{word}*: {meaning}." for word, meaning in GIVEN.items())
        + "\n"
    )


def _learned(spec: MethodSpec) -> str:
    if spec.training:
        return f"`train {_agent(spec.training)}`"
    return f"the file of `{spec.trained_as}`" if spec.trained_as else "-"


def _agent(training: Training) -> str:
    """Return the words of `endotwin train` that train a method."""
    words = f"--agent {training.agent}"
    return f"--protocol twins {words}" if training.on_twins else words


def _page(spec: MethodSpec) -> str:
    module = module_of(spec)
    place = module.replace(".", "/") + ".py"
    facts = [("family", spec.presentation.family), ("knows", spec.knows)]
    if spec.models:
        facts.append(("model of hysteresis", ", ".join(spec.models)))
    if spec.fits:
        facts.append(("fitted on the training records", ", ".join(fit.key for fit in spec.fits)))
    if spec.training:
        on = "simulated twins of a preset" if spec.training.on_twins else "training records"
        facts.append(("trained on", f"{on}, by `endotwin train {_agent(spec.training)}`"))
    if spec.trained_as:
        facts.append(("runs on", f"the trained file of {agent_names()[spec.trained_as]}"))
    if spec.oracle or spec.needs_density:
        facts.append(("deployable", "no: it knows what no device tells"))
    if spec.presentation.paper_column is not None:
        facts.append(("in the paper", "Tables II and III"))
    facts += [*_costs(spec), ("code", f"`{place}`")]
    table = "| what | this method |\n|---|---|\n" + "\n".join(
        f"| {name} | {value} |" for name, value in facts
    )
    known = equations()
    formulas = [known[spec.name]]
    formulas += [known[f"model {name}"] for name in MODELS if any(of.startswith(name) for of in spec.models)]
    return (
        f"# {spec.name}\n\n{table}\n\n## Equations\n\n"
        + "\n\n".join(formulas)
        + f"\n\n## In the code\n\n{_text(module)}\n\n## Try it\n\n{_try(spec)}\n\n{_figures(spec)}"
        "[All estimators](index.md) · [What they reach](../results/benchmark.md)\n"
    )


@functools.cache
def _published(name: str) -> dict[str, list[dict[str, str]]]:
    """Return the lines of each method in a published table; none, before it is published."""
    found: dict[str, list[dict[str, str]]] = {}
    path = PUBLISHED / name
    if path.is_file():
        with path.open() as file:
            for row in csv.DictReader(line for line in file if not line.startswith("#")):
                found.setdefault(row["method"], []).append(row)
    return found


def _costs(spec: MethodSpec) -> list[tuple[str, str]]:
    """Return what a method was seen to cost: learned parameters, time of a training and of a sample."""
    costs = _published("costs.csv").get(spec.name, [{}])[0]
    facts = []
    if costs.get("parameters"):
        facts.append(("learned parameters", costs["parameters"]))
    if costs.get("training_s"):
        facts.append(("a training", f"{float(costs['training_s']) / 60:.1f} min of one core"))
    if costs.get("sample_us"):
        facts.append(("a sample", f"{float(costs['sample_us']):.0f} µs of one core, in Python"))
    return facts


def _figures(spec: MethodSpec) -> str:
    """Return what a method reaches on the frozen test set, a line for each noise."""
    scores = _published("scores.csv").get(spec.name, [])
    if not scores:
        return ""
    groups = list(dict.fromkeys(map(_group, scores)))
    lines: dict[str, dict[str, str]] = {}
    for row in scores:
        name = noise_label(row["noise"], float(row["level"]))
        lines.setdefault(name, {})[_group(row)] = f"{float(row['rmse_deg']):.2f}"
    head = f"| RMSE [deg] | {' | '.join(groups)} |\n|---|{'---:|' * len(groups)}\n"
    rows = (
        f"| {name} | {' | '.join(cells.get(group, '-') for group in groups)} |"
        for name, cells in lines.items()
    )
    drawn = f"{scores[0]['trainings']} trainings, " if scores[0]["trainings"] != "1" else ""
    return (
        "## What it reaches\n\nOn [the frozen test set](../benchmark/index.md), "
        f"T = {scores[0]['sample_time_s']} s; {drawn}{scores[0]['seeds']} draws of each noise.\n\n"
        f"{head}" + "\n".join(rows) + "\n\n"
    )


def _group(row: dict[str, str]) -> str:
    return f"{row['twin']}, [{float(row['stroke_low_mm']):g}, {float(row['stroke_high_mm']):g}] mm"


def _text(module: str) -> str:
    """Return the docstring of a module in Markdown; indented equations stay as they are."""
    text = inspect.cleandoc(importlib.import_module(module).__doc__ or "")
    return "\n".join(
        line if line.startswith("    ") else line.replace("<", "&lt;") for line in text.splitlines()
    )


def _try(spec: MethodSpec) -> str:
    if spec.trained_as or spec.ensembles:
        return f"`endotwin evaluate --suite full --methods {_quoted(spec)} --out results` compares it."
    lines = [f"endotwin evaluate data/test --train data/train --methods {_quoted(spec)} --out results"]
    if spec.training:
        data = "" if spec.training.on_twins else "data/train --model coleman_hodgdon.json "
        lines.insert(0, f"endotwin train {data}{_agent(spec.training)} --out runs/{spec.training.agent}")
        lines[1] += f" --policy runs/{spec.training.agent}/{spec.training.file}"
    return "```sh\n" + "\n".join(lines) + "\n```"


def _quoted(spec: MethodSpec) -> str:
    return f"'{spec.name}'" if re.search(r"[^\w-]", spec.name) else spec.name
