"""The page of a dataset: what varies in it, its loops, every quantity with its statistics, every file."""

from collections.abc import Sequence
from pathlib import Path

from twin.dataset.card import FIGURE, varying
from twin.dataset.recipe_file import load_recipe
from twin.files.dataset_json import Dataset, Entry, MeasuredDataset, SimulatedDataset, read_contents
from twin.files.hashes import sha256_of
from twin.recording import read_episode
from twin.report.facts import flat_facts
from twin.report.parts import (
    Facts,
    Folded,
    Lines,
    Page,
    Part,
    Section,
    ShownCommands,
    Table,
    Text,
    png_picture,
    repeat_section,
)
from twin.report.player import record_player

MOST_FILES = 200
"""Files that the page lists: `dataset.json` has all."""


def dataset_page(path: Path) -> Page:
    """Return the page of a dataset, from its `dataset.json` and its first file.

    Raises:
        ValueError: it is damaged.
        FileNotFoundError: its first file is missing.
    """
    folder = path.parent
    contents = read_contents(folder)
    first = contents.files[0]
    episode = read_episode(folder / first.name)
    seen: list[Part] = [record_player(episode, first.name)]
    if (folder / FIGURE).is_file():
        caption = "Loops of some of the episodes. Dark: the true bending angle; grey: what the sensor saw."
        seen.append(png_picture(folder / FIGURE, caption))
    sections = [
        Section("What it looks like", tuple(seen)),
        Section("What varies", _varying(folder, contents)),
        Section("What each file holds", (_features(contents),)),
        Section("Files", _files(contents.files)),
        Section(
            "How to load it", (Text("In Python, or as a LeRobot dataset:"), ShownCommands(_loading(folder)))
        ),
        Section("What was run", (Facts(_facts(path, contents)),)),
        repeat_section(_commands(folder, contents)),
    ]
    return Page(
        verb="report",
        kicker="EndoTwin dataset: hysteresis of a tendon-driven flexible endoscope",
        title=folder.resolve().name,
        headline=_headline(contents),
        sections=tuple(sections),
    )


def _headline(contents: Dataset) -> str:
    bend = contents.statistics["truth_deg"]
    count = f"{contents.episodes} record" + ("s" if contents.episodes > 1 else "")
    made = {
        "simulated": "simulated with its hidden state, friction and tension along each wire",
        "measured": "measured on an endoscope",
        "benchmark": "simulated for the full benchmark",
    }[contents.source]
    return (
        f"{count}, {contents.seconds:.4g} s in all, {made}; the tip bends from "
        f"{_whole(bend.min)} to {_whole(bend.max)} deg."
    )


def _whole(angle: float) -> str:
    """Return a number without its decimals, and without the sign of a zero."""
    return f"{round(angle)}".replace("-", "\N{MINUS SIGN}")


def _varying(folder: Path, contents: Dataset) -> tuple[Part, ...]:
    if isinstance(contents, SimulatedDataset):
        recipe = load_recipe(folder / "recipe.yaml")
        return (Lines(tuple(line.replace("`", "") for line in varying(recipe, contents.files))),)
    if isinstance(contents, MeasuredDataset):
        return (Lines(tuple(f"{file.name}, read from {file.csv}" for file in contents.files[:MOST_FILES])),)
    twins = dict.fromkeys(file.twin for file in contents.files)
    return (Lines((f"twins: {', '.join(twins)}",)),)


def _features(contents: Dataset) -> Table:
    rows = []
    for name, feature in contents.features.items():
        held = contents.statistics[name]
        shape = " x ".join(map(str, feature.shape)) or "1"
        figures = (f"{figure:.4g}" for figure in (held.min, held.max, held.mean, held.std))
        numbers = (figure.replace("-", "\N{MINUS SIGN}") for figure in figures)
        rows.append((name, feature.meaning, feature.unit, feature.topic, shape, *numbers, f"{held.count}"))
    head = ("quantity", "what", "unit", "topic", "per sample", "min", "max", "mean", "std", "count")
    note = "A measurement that is missing is not counted."
    return Table(head, tuple(rows), note=note, cards=True)


def _files(files: Sequence[Entry]) -> tuple[Part, ...]:
    rows = tuple(
        (file.name, f"{file.samples}", f"{file.seconds:g}", f"{file.bytes / 1e6:.2f}", file.sha256)
        for file in files[:MOST_FILES]
    )
    table = Table(("file", "samples", "s", "MB", "SHA-256"), rows, cards=True)
    if len(files) > MOST_FILES:
        return (Text(f"The first {MOST_FILES} of {len(files)}; dataset.json lists all."), table)
    return (table,) if len(files) <= 10 else (Folded(f"All {len(files)} files", (table,)),)


def _loading(folder: Path) -> tuple[str, ...]:
    return (
        "import twin",
        f"for episode in twin.read_dataset({str(folder)!r}):",
        "    print(episode)",
        "",
        f"endotwin export {folder} --format parquet --out {folder.name}_lerobot",
    )


def _facts(path: Path, contents: Dataset) -> tuple[tuple[str, tuple[tuple[str, str], ...]], ...]:
    versions = [("endotwin", contents.endotwin)]
    if not isinstance(contents, MeasuredDataset):
        versions.append(("mujoco", contents.mujoco))
    groups = [
        ("Versions", tuple(versions)),
        ("Data, by SHA-256", ((path.name, sha256_of(path)),)),
    ]
    if not isinstance(contents, MeasuredDataset):
        recipe = contents.recipe.model_dump(mode="json", exclude_unset=True)
        preset = recipe.pop("preset")
        groups.append(("Recipe", tuple(flat_facts(recipe))))
        groups.append(("Preset, in SI units", tuple(flat_facts(preset))))
    return tuple(groups)


def _commands(folder: Path, contents: Dataset) -> tuple[str, ...]:
    verify = f"endotwin generate --verify --out {folder}"
    if isinstance(contents, SimulatedDataset):
        return (
            f"endotwin generate {folder / 'recipe.yaml'} --out again",
            verify,
            f"endotwin report {folder}",
        )
    if isinstance(contents, MeasuredDataset):
        names = dict.fromkeys(file.csv for file in contents.files)
        imports = tuple(f"endotwin import {name} --out {folder}" for name in list(names)[:20])
        return (*imports, verify, f"endotwin report {folder}")
    return (verify, f"endotwin report {folder}")
