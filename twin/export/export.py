"""Exporting records: read or recovered, thinned, and written anew as Parquet, CSV or MCAP files."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from twin.episode import Episode
from twin.errors import InputError, require_extra
from twin.export.tally import Tally
from twin.files.atomic import write_whole
from twin.recording import read_episode, recover_episode, write_csv, write_episode
from twin.recording.camera import Pictures, has_pictures, read_pictures

FORMATS = ("parquet", "csv", "mcap")
"""Format of an export: a LeRobot dataset, one table each, or one MCAP file each."""


@dataclasses.dataclass(frozen=True)
class Plan:
    """Options of an export.

    Attributes:
        form: one of `FORMATS`.
        all_columns: of a CSV table: also the measured angle and the hidden state.
        sample_time: simulated records are thinned to it, measured logs put on an even grid of it [s]; None
            keeps their own samples.
        recover: take what is whole of damaged files; else they are refused.
    """

    form: str = "parquet"
    all_columns: bool = False
    sample_time: float | None = None
    recover: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot be written.

        Raises:
            ValueError: there is no such format, or it has no choice of columns.
            ImportError: what writes it is not installed.
        """
        if self.form not in FORMATS:
            raise InputError(f"unknown format {self.form!r}; valid: {', '.join(FORMATS)}")
        if self.all_columns and self.form != "csv":
            raise InputError(f"all columns are a choice of csv, not of {self.form}, which holds all there is")
        if self.form == "parquet":
            require_extra("parquet", "the format parquet")


@dataclasses.dataclass(frozen=True)
class Piece:
    """A record to write.

    Attributes:
        name: of the record.
        episode: its samples.
        file: where it is as it is; None where it was thinned or recovered.
        source: file that it is from, whole; None where that is damaged.
    """

    name: str
    episode: Episode
    file: Path | None
    source: Path | None


def export_records(
    files: Mapping[str, Path],
    folder: Path,
    plan: Plan,
    *,
    on_progress: Callable[[int, int], None] | None = None,
    on_damage: Callable[[str], None] | None = None,
) -> Tally:
    """Write records into a folder; one is in memory at a time.

    Args:
        files: MCAP files by the names of their records.
        folder: an empty one; under an exception, what is in it is not complete.
        plan: how.
        on_progress: told how many of how many files are done.
        on_damage: told, in one line each, what is wrong with a damaged file.

    Raises:
        ValueError: a file is damaged, nothing is left of any, or a record does not fit the plan.
        OSError: the disk is full or fails.
    """
    tally = Tally()
    pieces = _pieces(files, plan, tally, on_progress or _silent, on_damage or _silent)
    if plan.form == "parquet":
        from twin.export.lerobot import write_lerobot  # pyarrow may not be installed

        write_lerobot(folder, _with_pictures(pieces, tally))
        return tally
    for piece in pieces:
        path = folder / f"{piece.name}.{plan.form}"
        if plan.form == "csv":
            write_csv(path, piece.episode, everything=plan.all_columns)
            tally.pictures_left_out += _has_pictures(piece.source)
        elif piece.file is not None:
            write_whole(path, piece.file.read_bytes())  # with what is not of the episode, such as pictures
        else:
            write_episode(path, _without_recipe(piece.episode))
            tally.pictures_left_out += _has_pictures(piece.source)
    return tally


def _with_pictures(
    pieces: Iterator[Piece], tally: Tally
) -> Iterator[tuple[str, Episode, dict[str, Pictures]]]:
    """Yield records with their pictures, and count those that have some."""
    for piece in pieces:
        pictures = {} if piece.source is None else read_pictures(piece.source)
        tally.pictures += bool(pictures)
        yield piece.name, piece.episode, pictures


def _has_pictures(file: Path | None) -> bool:
    """True for a whole file that holds pictures of a camera."""
    return file is not None and has_pictures(file)


def _pieces(
    files: Mapping[str, Path],
    plan: Plan,
    tally: Tally,
    on_progress: Callable[[int, int], None],
    on_damage: Callable[[str], None],
) -> Iterator[Piece]:
    """Yield one record at a time, and count it."""
    for done, (name, file) in enumerate(files.items()):
        on_progress(done, len(files))
        record, whole = _read(file, plan, tally, on_damage)
        if record is not None:
            episode = _at(record, plan.sample_time, file)
            tally.count(episode)
            same = file if whole and plan.sample_time is None else None
            yield Piece(name, episode, same, file if whole else None)
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
    tally.count_recovered(file, recovered)
    on_damage(f"{file}: {recovered.summary}")
    return recovered.episode, False


def _at(episode: Episode, sample_time: float | None, file: Path) -> Episode:
    """Return the record at a sample time; as it is without one."""
    if sample_time is None:
        return episode
    try:
        return episode.resampled(sample_time)
    except ValueError as error:
        raise InputError(f"{file}: {error}") from error


def _without_recipe(episode: Episode) -> Episode:
    """Return a record that does not claim to be all that a recipe made: it is not taken for a whole file."""
    facts = {
        name: value
        for name, value in episode.metadata.items()
        if name not in ("samples", "statistics", "recipe_sha256")
    }
    files = {name: data for name, data in episode.attachments.items() if name != "recipe.yaml"}
    return dataclasses.replace(episode, metadata=facts, attachments=files)


def _silent(*_: object) -> None:
    """Tell nobody."""
