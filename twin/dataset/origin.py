"""Origin of a file, by its own metadata, against what `dataset.json` says of it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.files.dataset_json import (
    BenchmarkDataset,
    BenchmarkFile,
    BenchmarkRecipe,
    Dataset,
    Entry,
    MeasuredFile,
    SimulatedDataset,
    to_json_values,
)

_STATED = ("seed", "episode", "signal", "stroke_mm", "sheath_bend_deg", "samples", "twin")
"""Keys of a simulated file's entry that its metadata has too, where that kind of file has them."""


def wrong_origin(
    path: Path,
    metadata: Mapping[str, Any],
    file: Entry,
    contents: Dataset,
) -> list[str]:
    """Return in what the metadata of a file differs from `dataset.json`, one line each.

    Args:
        path: of the file.
        metadata: of the episode in it.
        file: its entry.
        contents: of `dataset.json`.
    """
    entry = to_json_values(file)
    if isinstance(file, MeasuredFile):
        stated: dict[str, Any] = {"source": "measured", "file": file.csv, "file_sha256": file.csv_sha256}
    else:
        stated = {name: entry[name] for name in _STATED if name in entry}
        if isinstance(file, BenchmarkFile):
            stated.pop("samples")  # its metadata does not count them
    if isinstance(contents, (SimulatedDataset, BenchmarkDataset)):
        stated |= {"endotwin": contents.endotwin, "mujoco": contents.mujoco}
    if isinstance(contents, BenchmarkDataset):
        stated["seed"] = contents.recipe.seed
    faults = [
        f"{path}: {name} is {metadata.get(name)}, dataset.json says {value}"
        for name, value in stated.items()
        if metadata.get(name) != value
    ]
    if isinstance(file, BenchmarkFile) and isinstance(contents, BenchmarkDataset):
        faults += _wrong_record(path, metadata, file, contents.recipe)
    return faults


def _wrong_record(
    path: Path, metadata: Mapping[str, Any], file: BenchmarkFile, recipe: BenchmarkRecipe
) -> list[str]:
    """Compare a record of the full suite with its recipe: preset, ranges, length."""
    faults = []
    if abs(file.seconds - recipe.seconds) > recipe.sample_time_s:
        faults.append(
            f"{path} lasts {file.seconds:g} s, dataset.json says that a record lasts {recipe.seconds:g} s"
        )
    if abs(file.seconds - file.samples * recipe.sample_time_s) > recipe.sample_time_s / 2:
        step = file.seconds / file.samples
        faults.append(f"{path} has a sample time of {step:g} s, dataset.json says {recipe.sample_time_s:g} s")
    preset = metadata.get("preset")
    if not isinstance(preset, Mapping):
        return [*faults, f"{path} does not say which preset it is of"]
    drawn = recipe.ranges if file.twin == "randomized" else {}
    for name in sorted({*preset, *recipe.preset}):
        value, nominal = preset.get(name), recipe.preset.get(name)
        if name in drawn:
            low, high = drawn[name]
            if not isinstance(value, (int, float)) or not low <= value <= high:
                faults.append(f"{path}: {name} is {value}, drawn from [{low:g}, {high:g}] by dataset.json")
        elif value != nominal:
            faults.append(f"{path}: {name} is {value}, dataset.json says {nominal}")
    return faults
