"""Facts of a run for its report: what each of its files states, by name and value."""

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from twin.errors import MissingFileError
from twin.estimation.registry import method_specs
from twin.evaluation.score import read_scores
from twin.files.bounded import MEBIBYTE
from twin.files.dataset_json import NAME, MeasuredDataset, read_contents, to_json_values
from twin.files.hashes import sha256_of
from twin.files.json_text import read_json
from twin.files.origin import Origin
from twin.files.shown import cut
from twin.files.yaml_text import read_yaml

MOST_TEXT = MEBIBYTE
"""Size that is read of files of settings and curves [bytes]."""
MOST_FACTS = 200
"""Facts that the page lists of one file."""


def agent_names() -> dict[str, str]:
    """Return the names of the methods that can be trained, by the folder of their run."""
    return {spec.training.agent: spec.name for spec in method_specs() if spec.training}


def run_facts(folder: Path) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the facts of a run, as (title, [(name, value)]), from every file that states some."""
    sources: dict[str, tuple[str, Callable[[Path], Any]]] = {
        "Run": ("demo.json", _without_commands),
        "Training records": ("data/train/dataset.json", _recipe),
        "Test records": ("data/test/dataset.json", _recipe),
        "Identified Coleman-Hodgdon model": ("coleman_hodgdon.json", lambda path: read_json(path, MOST_TEXT)),
        "Evaluation protocol": ("results/evaluation.json", lambda path: read_scores(path)[1]),
    }
    sources |= {
        agent: (f"runs/{name}/config.yaml", lambda path: read_yaml(path, MOST_TEXT))
        for name, agent in agent_names().items()
    }
    facts = []
    for title, (name, read) in sources.items():
        try:
            entries = flat_facts(read(folder / name))
        except (OSError, ValueError, TypeError, AttributeError):
            continue  # a damaged file is reported by the part that needs it
        if entries:
            facts.append((title, entries[:MOST_FACTS]))
    return facts


def _without_commands(path: Path) -> dict[str, Any]:
    """Return what `demo.json` states, but for the commands, which end the page."""
    return {name: value for name, value in read_json(path, MOST_TEXT).items() if name != "commands"}


def _recipe(path: Path) -> dict[str, Any]:
    """Return what a dataset was made from; of a measured one, what it holds; or what is wrong with it."""
    try:
        contents = read_contents(path.parent)
    except MissingFileError:
        return {}
    except ValueError as error:
        reason = str(error).rpartition("is damaged or of an older version: ")[2]
        return {NAME: f"cannot be shown: {reason}"}
    told: dict[str, Any] = {f"SHA-256 of {NAME}": sha256_of(path), "endotwin": contents.endotwin}
    if isinstance(contents, MeasuredDataset):
        files = {"source": contents.source, "files": len(contents.files), "seconds": contents.seconds}
        return told | files
    return told | {"mujoco": contents.mujoco} | to_json_values(contents.recipe)


def origin_groups(origin: Origin | None) -> tuple[tuple[str, tuple[tuple[str, str], ...]], ...]:
    """Return versions and hashes of the data as groups of facts; none where a file states no origin."""
    if origin is None:
        return ()
    groups = [("Versions", tuple(origin.versions.items()))]
    if origin.data:
        groups.append(("Data, by SHA-256", tuple((data.path, data.sha256) for data in origin.data)))
    return tuple(groups)


def origin_command(origin: Origin | None, out: str) -> tuple[str, ...]:
    """Return the command that makes a result again at a place; none where its file states no origin."""
    return () if origin is None else (f"{origin.command} --out {shlex.quote(out)}",)


def flat_facts(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Return names and values of nested mappings; a list of mappings, as of files, by its length."""
    entries = []
    for key, value in values.items():
        name = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, dict):
            entries += flat_facts(value, f"{name}, ")
        elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
            entries.append((name, f"{len(value)}"))
        elif isinstance(value, list) and value and all(isinstance(item, list) for item in value):
            pairs = (", ".join(_text(part) for part in item) for item in value)
            entries.append((name, ", ".join(f"[{pair}]" for pair in pairs)))
        elif isinstance(value, list):
            entries.append((name, ", ".join(_text(item) for item in value)))
        else:
            entries.append((name, _text(value)))
    return entries


def _text(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    return f"{value:.6g}" if isinstance(value, float) else cut(value, 300)
