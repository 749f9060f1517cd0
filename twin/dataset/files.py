"""Files of an episode of a dataset: written completely, or kept if they exist and are complete."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from twin.dataset.episodes import VERSIONS, diverged, make_episodes, stereo_seed
from twin.dataset.recipe import EpisodeKey, Recipe, of_each_episode
from twin.dataset.recipe_file import load_recipe
from twin.episode import Episode
from twin.errors import DivergedError, InputError
from twin.files.atomic import write_whole
from twin.files.bounded import sha256_of
from twin.files.dataset_json import SimulatedFile
from twin.recording import EpisodeWriter, read_episode, read_metadata
from twin.recording.camera import CAMERA_TOPIC, picture_message
from twin.recording.features import csv_text, wrong_statistics
from twin.recording.listing import describe_file
from twin.recording.messages import to_nanoseconds
from twin.recording.reader import HINT
from twin.rendering.camera import pictures

Entry = dict[str, Any]
"""Entry of one file in `dataset.json`, as `twin.files.dataset_json.SimulatedFile` describes it."""

_OF_METADATA = ("seed", "episode", "signal", "stroke_mm", "sheath_bend_deg")


class Made(NamedTuple):
    """Result of writing one episode's files."""

    entry: Entry
    kept: bool = False  # it existed already, complete and of this recipe
    damage: str = ""  # why the existing file was replaced


def make_files(
    recipe: Recipe,
    keys: Sequence[EpisodeKey],
    folder: Path,
    known: Mapping[str, SimulatedFile],
    csv: bool,
    versions: Mapping[str, str] = VERSIONS,
) -> list[Made]:
    """Write the missing or incomplete files of some episodes; the others stay as they are.

    It runs in a worker, and returns descriptions, no arrays. If an episode diverges, the others are written
    before `DivergedError` is raised.
    """
    if versions != VERSIONS:
        here, there = (
            ", ".join(" ".join(one) for one in versions.items()) for versions in (versions, VERSIONS)
        )
        raise InputError(f"a worker has {there}, here is {here}: they must agree")
    made: dict[EpisodeKey, Made] = {}
    damage: dict[EpisodeKey, str] = {}
    for key in keys:
        path = folder / recipe.file_name(key)
        former = known.get(path.name)
        if path.exists():
            try:
                metadata = _check_file(recipe, key, path, former)
            except (ValueError, FileNotFoundError) as error:
                damage[key] = str(error).removesuffix(HINT)  # it is made again
                continue
            damaged = _write_table(path, former) if csv else ""
            made[key] = Made(_entry(recipe, path, metadata, csv), kept=not damaged, damage=damaged)
    missing = [key for key in keys if key not in made]
    episodes = make_episodes(recipe, missing) if missing else []
    path = folder / "recipe.yaml"  # a cluster cannot cancel a task of a run that has ended
    if path.is_file() and of_each_episode(load_recipe(path)) != of_each_episode(recipe):
        raise InputError(f"{folder} is the folder of another dataset by now")
    failed = [key for key, episode in zip(missing, episodes, strict=True) if episode is None]
    for key, episode in zip(missing, episodes, strict=True):
        if episode is not None:
            path = folder / recipe.file_name(key)
            _write(recipe, key, path, episode)
            if csv:
                _write_table(path, known.get(path.name))
            made[key] = Made(_entry(recipe, path, episode.metadata, csv), damage=damage.get(key, ""))
    if failed:
        raise DivergedError(diverged(recipe, failed[0]))
    return [made[key] for key in keys]


def _write(recipe: Recipe, key: EpisodeKey, path: Path, episode: Episode) -> None:
    nanoseconds = to_nanoseconds(episode.time)
    with EpisodeWriter(path) as writer:
        writer.write(episode)
        if recipe.stereo is not None:
            from twin.vision.sensor import calibration_messages, picture_messages, sensor_before

            sensor = sensor_before(episode, recipe.stereo)
            for topic, message in calibration_messages(sensor.calibration, nanoseconds[0]):
                writer.add_message(topic, message, nanoseconds[0])
            for topic, message, time in picture_messages(sensor, episode, stereo_seed(key), nanoseconds):
                writer.add_message(topic, message, time)
        if recipe.camera is not None:
            for sample, picture in pictures(episode, recipe.camera):
                time = nanoseconds[sample]
                writer.add_message(CAMERA_TOPIC, picture_message(picture, time), time)


def is_table(path: Path, file: SimulatedFile) -> bool:
    """Return whether a file is the CSV table that `dataset.json` states; a larger one is not read."""
    most = 1000 + 1000 * file.samples  # bytes
    return path.is_file() and path.stat().st_size <= most and sha256_of(path) == file.table_sha256


def _write_table(path: Path, known: SimulatedFile | None) -> str:
    """Write the table of a file, from the file alone, unless it is known to be there.

    Returns the fault of a table whose hash was known.
    """
    table, damage = path.with_suffix(".csv"), ""
    if known is not None and known.table_sha256 is not None:
        if is_table(table, known):
            return ""
        damage = f"{table} is {'not as dataset.json states' if table.is_file() else 'missing'}"
    text = csv_text(read_episode(path)).encode()
    if not damage and table.exists():
        # A run that was killed has made the same bytes.
        if table.stat().st_size != len(text) or table.read_bytes() != text:
            raise InputError(f"{table} is there, and `generate` did not make it: move it")
        return ""
    write_whole(table, text)
    return damage


def _check_file(recipe: Recipe, key: EpisodeKey, path: Path, known: SimulatedFile | None) -> dict[str, Any]:
    """Check that this recipe and this version would write the same file; returns its metadata.

    A file whose hash is known is read for its CRCs, any other one for its numbers too.
    """
    metadata = read_metadata(path)
    ours = {"seed": key.seed, "episode": key.number, "recipe_sha256": of_each_episode(recipe)[1]}
    for name, value in (ours | VERSIONS).items():
        if metadata.get(name) != value:
            raise InputError(f"{path}: {name} is {metadata.get(name)}, not {value}")
    if known is not None:
        if path.stat().st_size != known.bytes or sha256_of(path) != known.sha256:
            raise InputError(f"{path} is not as dataset.json states")
        return metadata
    episode = read_episode(path)
    if len(episode.time) != metadata.get("samples"):
        stated = metadata.get("samples")
        raise InputError(f"{path} has {len(episode.time)} samples, its metadata states {stated}")
    for fault in wrong_statistics(episode, metadata.get("statistics")):
        raise InputError(f"{path}: {fault}, by its metadata")
    return metadata


def _entry(recipe: Recipe, path: Path, metadata: Mapping[str, Any], csv: bool) -> Entry:
    samples = metadata["samples"]
    return {
        **describe_file(path, samples, samples * recipe.sample_time_s, metadata["statistics"]),
        **{name: metadata.get(name) for name in _OF_METADATA},
        "table_sha256": sha256_of(path.with_suffix(".csv")) if csv else None,
    }
