"""Exporting records: read or recovered, thinned, written as a LeRobot dataset, CSV tables or MCAP files."""

import collections
import dataclasses
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.episode import Episode
from twin.errors import InputError, MissingFileError
from twin.files.atomic import write_whole
from twin.recording import episode_files, read_episode, recover_episode, write_csv, write_episode
from twin.recording.camera import Pictures, has_pictures, read_pictures

Piece = tuple[str, Episode, Path | None]  # name, record, and its file; None where that is damaged
_NOT_ITS_NAME = re.compile(r"\.mcap(\.partial(\.\d+)?)?$")  # a killed recording is NAME.mcap.partial


@dataclasses.dataclass(frozen=True)
class Plan:
    """Options of an export."""

    form: str = "parquet"  # a LeRobot dataset; csv, a table each; or mcap, an MCAP file each
    all_columns: bool = False  # of a CSV table: also the measured angle and the hidden state
    # simulated records are thinned to it, measured logs put on an even grid of it [s]; None keeps their own
    # samples
    sample_time: float | None = None
    recover: bool = False  # keep the complete part of damaged files, which are refused otherwise


@dataclasses.dataclass
class Tally:
    """Counts of an export, and losses of damaged files."""

    episodes: int = 0
    samples: int = 0  # in all episodes
    seconds: float = 0.0  # in all episodes
    recovered: list[dict[str, Any]] = dataclasses.field(default_factory=list)  # samples and faults of each
    lost: list[dict[str, Any]] = dataclasses.field(default_factory=list)  # files that nothing is left of
    lerobot_episodes: int = 0  # of a LeRobot dataset, where a long record is several
    pictures: int = 0  # records whose pictures are written
    pictures_left_out: int = 0  # records whose pictures are not, as the format has none

    @property
    def damage(self) -> str:
        """What became of long records, pictures and damaged files, as the end of a sentence; may be empty."""
        line = ""
        if self.lerobot_episodes > self.episodes:
            line += f"; long ones are split: {self.lerobot_episodes} LeRobot episodes"
        if self.pictures:
            line += f"; with the pictures of {self.pictures} as video"
        if self.pictures_left_out:
            line += f"; without the pictures of {self.pictures_left_out}, which parquet would hold as video"
        if self.recovered:
            whole = sum(file["samples"] for file in self.recovered)
            expected = [file["samples_expected"] for file in self.recovered]
            if None in expected:
                missing = f"{whole} samples are complete of an unknown number"
            else:
                gone, all_ = sum(expected) - whole, sum(expected)
                missing = f"{gone} of {all_} samples ({100 * gone / all_:.1f} %) are missing"
            line += f"; damaged files: {len(self.recovered)}, {missing}"
        if self.lost:
            line += f"; files of which nothing is left: {len(self.lost)}"
        return line


def named_files(paths: Sequence[Path]) -> dict[str, Path]:
    """Return the MCAP files of folders and files by name, with their folders' names where needed."""
    if not paths:
        raise InputError("no data given: name folders of MCAP files, or files")
    for path in paths:
        if not path.exists():
            raise MissingFileError(f"no file or folder {path}")
    files = [file for path in paths for file in episode_files(path)]
    parts = [(*Path(os.path.realpath(file)).parent.parts, _NOT_ITS_NAME.sub("", file.name)) for file in files]
    twice = [file for file, count in collections.Counter(parts).items() if count > 1]
    if twice:
        raise InputError(f"{files[parts.index(twice[0])]} is given twice")
    for depth in range(1, max(map(len, parts)) + 1):
        names = ["_".join(part for part in path[-depth:] if part != "/") for path in parts]
        if len(set(names)) == len(names):
            break
    else:
        raise InputError("two files have the same name in folders of the same names: export them apart")
    return dict(zip(names, files, strict=True))


def export_records(
    files: Mapping[str, Path],
    folder: Path,
    plan: Plan,
    *,
    on_progress: Callable[[int, int], None] | None = None,
    on_damage: Callable[[str], None] | None = None,
) -> Tally:
    """Write records into a folder; one is in memory at a time."""
    tally = Tally()
    pieces = _pieces(files, plan, tally, on_progress or (lambda *_: None), on_damage or (lambda _: None))
    if plan.form == "parquet":
        from twin.export.lerobot import write_lerobot  # pyarrow may not be installed

        tally.lerobot_episodes = write_lerobot(folder, _with_pictures(pieces, tally))["total_episodes"]
        return tally
    for name, episode, source in pieces:
        path = folder / f"{name}.{plan.form}"
        if plan.form == "mcap" and source is not None and plan.sample_time is None:
            write_whole(path, source.read_bytes())  # with pictures and all else
            continue
        if plan.form == "csv":
            write_csv(path, episode, everything=plan.all_columns)
        else:
            write_episode(path, _without_recipe(episode))
        tally.pictures_left_out += source is not None and has_pictures(source)
    return tally


def _with_pictures(
    pieces: Iterator[Piece], tally: Tally
) -> Iterator[tuple[str, Episode, dict[str, Pictures]]]:
    for name, episode, source in pieces:
        pictures = {} if source is None else read_pictures(source)
        tally.pictures += bool(pictures)
        yield name, episode, pictures


def _pieces(
    files: Mapping[str, Path],
    plan: Plan,
    tally: Tally,
    on_progress: Callable[[int, int], None],
    on_damage: Callable[[str], None],
) -> Iterator[Piece]:
    for done, (name, file) in enumerate(files.items()):
        on_progress(done, len(files))
        record, whole = _read(file, plan, tally, on_damage)
        if record is None:
            continue
        if plan.sample_time is not None:
            try:
                record = record.resampled(plan.sample_time)
            except ValueError as error:
                raise InputError(f"{file}: {error}") from error
        tally.episodes += 1
        tally.samples += len(record.time)
        tally.seconds = round(tally.seconds + len(record.time) * record.sample_time, 9)
        yield name, record, file if whole else None
    on_progress(len(files), len(files))
    if tally.episodes == 0:
        raise InputError("nothing is left of any file")


def _read(
    file: Path, plan: Plan, tally: Tally, on_damage: Callable[[str], None]
) -> tuple[Episode | None, bool]:
    """Return the record of a file, or what is left of it, and whether the file is whole."""
    if not plan.recover:
        return read_episode(file), True
    try:
        recovered = recover_episode(file)
    except ValueError as error:
        tally.lost.append({"file": str(file), "fault": str(error)})
        on_damage(str(error))
        return None, False
    if not recovered.faults:
        return recovered.episode, True
    samples = {"samples": recovered.samples, "samples_expected": recovered.samples_expected}
    tally.recovered.append({"file": str(file), **samples, "faults": list(recovered.faults)})
    on_damage(f"{file}: {recovered.summary}")
    return recovered.episode, False


def _without_recipe(episode: Episode) -> Episode:
    """Return a record without its recipe: it is no longer all that the recipe made."""
    without = {"samples", "statistics", "recipe_sha256"}
    facts = {name: value for name, value in episode.metadata.items() if name not in without}
    files = {name: data for name, data in episode.attachments.items() if name != "recipe.yaml"}
    return dataclasses.replace(episode, metadata=facts, attachments=files)
