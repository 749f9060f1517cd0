"""The page of a dataset: what varies in it, its loops, every quantity with its statistics, every file."""

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from twin.dataset.card import FIGURE, varying
from twin.dataset.recipe_file import load_recipe
from twin.files.bounded import sha256_of
from twin.files.dataset_json import Dataset, MeasuredDataset, SimulatedDataset, read_contents, to_json_values
from twin.recording import read_episode
from twin.report import page as html
from twin.report.page import text
from twin.report.player import player

MOST_FILES = 200  # files that the page lists: `dataset.json` has all
_LOOPS = "Loops of some of the episodes. Dark: the true bending angle; grey: what the sensor saw."
_LOADING = """import twin
for episode in twin.read_dataset({folder!r}):
    print(episode)

endotwin export {folder} --format parquet --out {name}_lerobot"""
_SOURCES = {
    "simulated": "simulated, with hidden state, friction and tension along each wire",
    "measured": "measured on an endoscope",
    "benchmark": "simulated for the full comparison",
}


def dataset_page(path: Path) -> html.Page:
    """Return the page of a dataset, from its `dataset.json` and its first file."""
    folder = path.parent
    contents = read_contents(folder)
    first = contents.files[0]
    plural = "s" if contents.episodes > 1 else ""
    sentence = f"{contents.episodes} episode{plural}, {contents.seconds:.4g} s: {_SOURCES[contents.source]}"
    if bend := contents.statistics.get("truth_deg"):
        sentence += _signed(f"; the tip bends from {bend.min:z.0f} to {bend.max:z.0f} deg")
    shown = [text(f"{sentence}.", "headline"), player(read_episode(folder / first.name), first.name)]
    if (folder / FIGURE).is_file():
        shown.append(html.figure(folder / FIGURE, _LOOPS))
    page = html.Page(
        "EndoTwin dataset: hysteresis of a tendon-driven flexible endoscope",
        folder.resolve().name,
        intro=tuple(shown),
    )
    page.add("What varies", html.bullets(_varying(folder, contents)))
    page.add("What each file holds", _features(contents))
    page.add("Files", *_files(contents))
    lines = _LOADING.format(folder=str(folder), name=folder.name).splitlines()
    page.add("How to load it", text("In Python, or as a LeRobot dataset:"), html.commands(lines))
    page.add_origin(_commands(folder, contents), _facts(path, contents))
    return page


def _signed(text: str) -> str:
    return text.replace("-", "\N{MINUS SIGN}")


def _varying(folder: Path, contents: Dataset) -> Sequence[str]:
    if isinstance(contents, SimulatedDataset):
        recipe = load_recipe(folder / "recipe.yaml")
        return [line.replace("`", "") for line in varying(recipe, contents.files)]
    if isinstance(contents, MeasuredDataset):
        return [f"{file.name}, read from {file.csv}" for file in contents.files[:MOST_FILES]]
    return [f"twins: {', '.join(dict.fromkeys(file.twin for file in contents.files))}"]


def _features(contents: Dataset) -> Markup:
    rows = []
    for name, feature in contents.features.items():
        of = contents.statistics[name]
        shape = " x ".join(map(str, feature.shape)) or "1"
        numbers = (_signed(f"{number:.4g}") for number in (of.min, of.max, of.mean, of.std))
        rows.append((name, feature.meaning, feature.unit, feature.topic, shape, *numbers, f"{of.count}"))
    head = ("quantity", "what", "unit", "topic", "per sample", "min", "max", "mean", "std", "count")
    return html.table(head, rows, note="A missing measurement is not counted.", cards=True)


def _files(contents: Dataset) -> Sequence[Markup]:
    files = contents.files
    rows = [
        (file.name, f"{file.samples}", f"{file.seconds:g}", f"{file.bytes / 1e6:.2f}", file.sha256)
        for file in files[:MOST_FILES]
    ]
    listed = html.table(("file", "samples", "s", "MB", "SHA-256"), rows, cards=True)
    if len(files) > MOST_FILES:
        return [text(f"The first {MOST_FILES} of {len(files)}; dataset.json lists all."), listed]
    return [listed] if len(files) <= 10 else [html.folded(f"All {len(files)} files", listed)]


def _facts(path: Path, contents: Dataset) -> dict[str, html.Facts]:
    groups: dict[str, html.Facts] = {
        "Versions": [("endotwin", contents.endotwin)],
        "Data, by SHA-256": [(path.name, sha256_of(path))],
    }
    if not isinstance(contents, MeasuredDataset):
        groups["Versions"] = [*groups["Versions"], ("mujoco", contents.mujoco)]
        recipe = to_json_values(contents.recipe)
        preset = recipe.pop("preset")
        groups |= {"Recipe": html.flat_facts(recipe), "Preset, in SI units": html.flat_facts(preset)}
    return groups


def _commands(folder: Path, contents: Dataset) -> Sequence[str]:
    made: list[str] = []
    if isinstance(contents, SimulatedDataset):
        made = [f"endotwin generate {folder / 'recipe.yaml'} --out again"]
    elif isinstance(contents, MeasuredDataset):
        names = list(dict.fromkeys(file.csv for file in contents.files))
        made = [f"endotwin import {name} --out {folder}" for name in names[:20]]
    return (*made, f"endotwin generate --verify --out {folder}", f"endotwin report {folder}")
