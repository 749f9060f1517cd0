"""The page of one training: its learning curve, its configuration, and the file that came of it."""

from pathlib import Path

from twin.errors import InputError
from twin.estimation.registry import trainings
from twin.files.hashes import sha256_of
from twin.files.progress_csv import read_progress
from twin.files.run_folder import CURVE_FILE
from twin.files.yaml_text import read_yaml
from twin.report.facts import MOST_TEXT, flat_facts
from twin.report.figures import training_figure
from twin.report.parts import Facts, Gap, Page, Part, Section, drawn, repeat_section


def training_page(path: Path) -> Page:
    """Return the page of a run folder of `endotwin train`, from its `config.yaml`.

    Raises:
        ValueError: it is no such folder.
    """
    folder, values = path.parent, read_yaml(path, MOST_TEXT)
    known = trainings()
    agent = next((name for name in _agents(values) if name in known), None)
    if agent is None:
        raise InputError(f"{path} names no agent of `endotwin train`; valid: {', '.join(known)}")
    trained = folder / known[agent].file
    made = ((trained.name, sha256_of(trained)),) if trained.is_file() else ()
    groups = [("Configuration", tuple(flat_facts(values)))]
    if made:
        groups.insert(0, ("Trained file, by SHA-256", made))
    return Page(
        verb="report",
        kicker="EndoTwin training: how an estimator learned",
        title=f"{agent}: {known[agent].purpose}",
        headline=_headline(folder, trained),
        sections=(
            Section("Learning curve", (_curve(folder, agent),)),
            Section("What was run", (Facts(tuple(groups)),)),
            repeat_section(
                (
                    f"endotwin train --agent {agent} --help",
                    f"endotwin evaluate data/test --policy {trained} --out results",
                    f"endotwin report {folder}",
                )
            ),
        ),
    )


def _agents(values: dict[str, object]) -> list[str]:
    """Return the words that a configuration may name its agent by, at its top or one level below."""
    inner = [part for part in values.values() if isinstance(part, dict)]
    return [str(part["agent"]) for part in (values, *inner) if "agent" in part]


def _headline(folder: Path, trained: Path) -> str:
    if not trained.is_file():
        return f"This training is not finished: it has left no {trained.name} yet."
    try:
        curve = read_progress(folder / CURVE_FILE)
    except (OSError, ValueError):
        return f"This training is finished; {trained.name} can be run."
    cost = -curve["return"]
    return (
        f"Over {curve['samples'][-1] / 1e3:.4g} thousand samples the cost of a step fell from "
        f"{cost[0]:.3g} to {cost[-1]:.3g} deg²; {trained.name} can be run."
    )


def _curve(folder: Path, agent: str) -> Part:
    try:
        curve = read_progress(folder / CURVE_FILE)
    except (OSError, ValueError) as error:
        return Gap(f"The learning curve cannot be shown: {error}.")
    caption = "What the agent pays per step while it learns, thin as recorded, thick the running median."
    return drawn(training_figure({agent: curve}), caption)
