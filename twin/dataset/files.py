"""Files of an episode of a dataset: written whole, or kept if they are there already and whole."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.dataset.episodes import diverged, make_episodes, stereo_seed
from twin.dataset.recipe import EpisodeKey, Recipe, of_each_episode
from twin.dataset.recipe_file import load_recipe
from twin.dataset.versions import VERSIONS
from twin.episode import Episode
from twin.errors import DivergedError, InputError
from twin.files.atomic import write_whole
from twin.files.dataset_json import SimulatedFile
from twin.files.hashes import has_sha256, sha256_of
from twin.recording import EpisodeWriter, read_episode, read_metadata
from twin.recording.camera import CAMERA_TOPIC, picture_message
from twin.recording.features import csv_text, wrong_statistics
from twin.recording.listing import describe_file
from twin.recording.messages import to_nanoseconds
from twin.recording.reader import HINT
from twin.rendering.camera import pictures
from twin.vision.rig import StereoRig

Entry = dict[str, Any]
"""Entry of one file in `dataset.json`, as `twin.files.dataset_json.SimulatedFile` describes it."""

_OF_METADATA = ("seed", "episode", "signal", "stroke_mm", "sheath_bend_deg")


@dataclasses.dataclass(frozen=True)
class Made:
    """Result of writing one episode's files.

    Attributes:
        entry: what `dataset.json` says of the file.
        kept: whether it was there already, whole and of this recipe.
        damage: why the file that was there was made anew; empty if none was.
    """

    entry: Entry
    kept: bool = False
    damage: str = ""


def file_name(recipe: Recipe, key: EpisodeKey) -> str:
    """Return the name of the file of an episode, which tells the seed where there are several."""
    seed = f"seed_{key.seed}_" if len(recipe.seeds) > 1 else ""
    return f"{seed}episode_{key.number:04d}.mcap"


def make_files(
    recipe: Recipe,
    keys: Sequence[EpisodeKey],
    folder: Path,
    known: Mapping[str, SimulatedFile],
    csv: bool,
    versions: Mapping[str, str] = VERSIONS,
) -> list[Made]:
    """Write the files of some episodes that are not there, or not whole; the others stay as they are.

    It runs in a worker, and returns descriptions, no arrays.

    Args:
        recipe: what to make.
        keys: which episodes.
        folder: where their files are.
        known: entries of the files in a former `dataset.json`, by name.
        csv: also write each episode as a table.
        versions: of what asks for it; a worker on another machine may have others.

    Raises:
        ValueError: the worker's versions are others, or a table is there that no run made.
        FloatingPointError: a simulation diverged; the other episodes are written.
        OSError: the disk is full, a file cannot be written, or nothing can draw a camera's pictures.
    """
    if versions != VERSIONS:
        raise InputError(f"a worker has {_listed(VERSIONS)}, here is {_listed(versions)}: they must agree")
    paths = {key: folder / file_name(recipe, key) for key in keys}
    made: dict[EpisodeKey, Made] = {}
    damage: dict[EpisodeKey, str] = {}
    for key, path in paths.items():
        if path.exists():
            try:
                metadata = _check_file(recipe, key, path, known.get(path.name))
            except (ValueError, FileNotFoundError) as error:
                damage[key] = str(error).removesuffix(HINT)  # it is made anew
                continue
            damaged = _write_table(path, known.get(path.name)) if csv else ""
            made[key] = Made(_entry(recipe, path, metadata, csv), kept=not damaged, damage=damaged)
    missing = [key for key in keys if key not in made]
    episodes = make_episodes(recipe, missing) if missing else []
    _refuse_if_unwanted(recipe, folder)
    failed = []
    for key, episode in zip(missing, episodes, strict=True):
        if episode is None:
            failed.append(key)
        else:
            _write(recipe, key, paths[key], episode)
            if csv:
                _write_table(paths[key], known.get(paths[key].name))
            made[key] = Made(_entry(recipe, paths[key], episode.metadata, csv), damage=damage.get(key, ""))
    if failed:
        raise DivergedError(diverged(recipe, failed[0]))
    return [made[key] for key in keys]


def _listed(versions: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in versions.items())


def _refuse_if_unwanted(recipe: Recipe, folder: Path) -> None:
    """Refuse to write for a run that is over: a cluster cannot call back what it has begun.

    Raises:
        ValueError: the folder holds another recipe by now.
    """
    path = folder / "recipe.yaml"
    if path.is_file() and of_each_episode(load_recipe(path)) != of_each_episode(recipe):
        raise InputError(f"{folder} is the folder of another dataset by now")


def _write(recipe: Recipe, key: EpisodeKey, path: Path, episode: Episode) -> None:
    nanoseconds = to_nanoseconds(episode.time)
    with EpisodeWriter(path) as writer:
        writer.write(episode)
        if recipe.stereo is not None:
            _add_stereo(writer, recipe.stereo, key, episode, nanoseconds)
        if recipe.camera is not None:
            for sample, picture in pictures(episode, recipe.camera):
                time = nanoseconds[sample]
                writer.add_message(CAMERA_TOPIC, picture_message(picture, time), time)


def _add_stereo(
    writer: EpisodeWriter, rig: StereoRig, key: EpisodeKey, episode: Episode, nanoseconds: list[int]
) -> None:
    """Add the calibration of two cameras, and those of their pictures that are recorded."""
    from twin.vision.messages import calibration_messages, picture_messages
    from twin.vision.sensor import sensor_before

    sensor = sensor_before(episode, rig)
    for topic, message in calibration_messages(sensor.calibration, nanoseconds[0]):
        writer.add_message(topic, message, nanoseconds[0])
    for topic, message, time in picture_messages(sensor, episode, stereo_seed(key), nanoseconds):
        writer.add_message(topic, message, time)


def most_table_bytes(samples: int) -> int:
    """Return the size that no table of so many samples reaches [bytes]: a larger one is not even read."""
    return 1000 + 1000 * samples


def _write_table(path: Path, known: SimulatedFile | None) -> str:
    """Write the table of a file, from the file alone, unless it is known to be there.

    Returns:
        What was wrong with a table whose hash was known.

    Raises:
        ValueError: a table is there that no run made.
    """
    table = path.with_suffix(".csv")
    stated = None if known is None else known.table_sha256
    damage = ""
    if known is not None and stated is not None:
        if table.is_file() and has_sha256(table, stated, most_table_bytes(known.samples)):
            return ""
        damage = f"{table} is not what dataset.json says" if table.is_file() else f"{table} is missing"
    text = csv_text(read_episode(path))
    if stated is None and table.exists():
        # What a run that was killed has made has the same bytes.
        if table.stat().st_size != len(text.encode()) or table.read_bytes() != text.encode():
            raise InputError(f"{table} is there, and `generate` did not make it: move it")
        return ""
    write_whole(table, text)
    return damage


def _check_file(recipe: Recipe, key: EpisodeKey, path: Path, known: SimulatedFile | None) -> dict[str, Any]:
    """Check that a file is what this recipe and this version would make.

    A file whose hash is known is read for its CRCs, any other one for its numbers too.

    Returns:
        Its metadata.

    Raises:
        ValueError: it is damaged, or another file.
        FileNotFoundError: it is not there.
    """
    metadata = read_metadata(path)
    wanted = {
        "seed": key.seed,
        "episode": key.number,
        "recipe_sha256": of_each_episode(recipe)[1],
        **VERSIONS,
    }
    for name, value in wanted.items():
        if metadata.get(name) != value:
            raise InputError(f"{path}: {name} is {metadata.get(name)}, not {value}")
    if known is not None:
        if not has_sha256(path, known.sha256, known.bytes):
            raise InputError(f"{path} is not what dataset.json says")
        return metadata
    episode = read_episode(path)
    if len(episode.time) != metadata.get("samples"):
        stated = metadata.get("samples")
        raise InputError(f"{path} has {len(episode.time)} samples, its metadata says {stated}")
    for fault in wrong_statistics(episode, metadata.get("statistics")):
        raise InputError(f"{path}: {fault}, by its metadata")
    return metadata


def _entry(recipe: Recipe, path: Path, metadata: Mapping[str, Any], csv: bool) -> Entry:
    """Describe a file that is there, and its table."""
    samples = metadata["samples"]
    return {
        **describe_file(path, samples, samples * recipe.sample_time_s, metadata["statistics"]),
        **{name: metadata.get(name) for name in _OF_METADATA},
        "table_sha256": sha256_of(path.with_suffix(".csv")) if csv else None,
    }
