"""`endotwin export`: episodes as a LeRobot dataset in Parquet, as CSV tables, or as MCAP files anew."""

import collections
import dataclasses
import importlib.util
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import tyro
from tqdm import tqdm

from scripts.command import Progress, Summary, output_folder, run_verb
from twin.episode import Episode
from twin.export import WholeFolder
from twin.export.even import whole_pieces_in_time
from twin.files.atomic import write_whole
from twin.recording import episode_files, read_episode, recover_episode, write_csv, write_episode


@dataclasses.dataclass(frozen=True)
class Export:
    """Write episodes anew: as a LeRobot dataset (v3.0, Parquet), as CSV tables, or as MCAP files.

    The folder appears when all is written. Each file is named after its record; where records of several
    folders have the same name, all are named after their folders too: run_a/episode_0000.mcap becomes
    run_a_episode_0000.
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files."""
    out: Path
    """Folder to make; one that is there must be empty."""
    format: Literal["parquet", "csv", "mcap"] = "parquet"
    """parquet is a dataset as LeRobot reads it; it needs endotwin[parquet]."""
    columns: Literal["main", "all"] = "main"
    """Of a CSV table: command, true angle and tensions, or also the measured angle and the hidden state."""
    sample_time: float | None = None
    """Thin simulated records to this and put measured logs on an even grid of it [s]; if not given, records
    keep their own samples. MCAP files that are thinned or recovered lose their pictures and estimates."""
    recover: bool = False
    """Take what is whole of damaged files, and say how much is missing; without it, they are refused."""
    seed: int = 0
    """Nothing is drawn by chance; here for uniformity."""
    json: bool = False
    """Print the summary as one JSON object."""


@dataclasses.dataclass
class Tally:
    """What has been read and written so far."""

    episodes: int = 0
    samples: int = 0
    seconds: float = 0.0
    recovered: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    """Of each damaged file: samples that were read, how many there once were, and what is wrong."""
    lost: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    """Each file that nothing is left of, and why."""


@dataclasses.dataclass(frozen=True)
class Piece:
    """A record to write."""

    name: str
    episode: Episode
    file: Path | None
    """Where it is as it is; None where it was thinned or recovered."""


def export(args: Export) -> Summary:
    """Write the folder."""
    if args.format == "parquet" and importlib.util.find_spec("pyarrow") is None:
        raise ValueError("--format parquet needs pyarrow: pip install 'endotwin[parquet]'")
    if args.columns == "all" and args.format != "csv":
        raise ValueError(f"--columns all is for --format csv, not {args.format}, which holds all there is")
    files = _files(args.data)
    whole = WholeFolder(args.out)
    output_folder(whole.path.parent)
    tally = Tally()
    with whole as folder:
        _write(args, folder, _pieces(args, files, tally))
        size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    values = {"out": str(args.out), "format": args.format, "files": len(files), "bytes": size}
    line = (
        f"{args.out}: {tally.episodes} episodes, {tally.seconds:g} s, as {args.format} ({size / 1e6:.1f} MB)"
    )
    return Summary(line + _missing(tally), values | dataclasses.asdict(tally))


def _files(paths: Sequence[Path]) -> dict[str, Path]:
    """Return the MCAP files of folders and files, under names that differ.

    Raises:
        FileNotFoundError: a path does not exist or a folder holds no MCAP file.
        ValueError: there is none, or one is given twice.
    """
    if not paths:
        raise ValueError("no data given: name folders of MCAP files, or files")
    for path in paths:
        if not path.exists():
            raise FileNotFoundError(f"no file or folder {path}")
    files = [file for path in paths for file in episode_files(path)]
    parts = [(*file.resolve().parent.parts, file.name.removesuffix(".mcap")) for file in files]
    twice = [file for file, count in collections.Counter(parts).items() if count > 1]
    if twice:
        raise ValueError(f"{files[parts.index(twice[0])]} is given twice")
    for depth in range(1, max(map(len, parts)) + 1):
        names = ["_".join(part for part in path[-depth:] if part != "/") for path in parts]
        if len(set(names)) == len(names):
            break
    else:
        raise ValueError("two files have the same name in folders of the same names: export them apart")
    return dict(zip(names, files, strict=True))


def _pieces(args: Export, files: dict[str, Path], tally: Tally) -> Iterator[Piece]:
    """Yield one record at a time; count them and show how far it is."""
    progress = Progress("export", "ep")
    for done, (name, file) in enumerate(files.items()):
        progress(done, len(files))
        records, whole = _read(args, file, tally)
        for number, record in enumerate(records, start=1):
            episode = _at(record, args.sample_time, file)
            tally.episodes += 1
            tally.samples += len(episode.time)
            tally.seconds = round(tally.seconds + len(episode.time) * episode.sample_time, 9)
            same = file if whole and args.sample_time is None else None
            yield Piece(name if len(records) == 1 else f"{name}_part_{number}", episode, same)
    progress(len(files), len(files))
    if tally.episodes == 0:
        raise ValueError("nothing is left of any file")


def _read(args: Export, file: Path, tally: Tally) -> tuple[list[Episode], bool]:
    """Return the record of a file, or what is left of it in pieces, and whether the file is whole."""
    if not args.recover:
        return [read_episode(file)], True
    try:
        recovered = recover_episode(file)
    except ValueError as error:
        tally.lost.append({"file": str(file), "fault": str(error)})
        _say(str(error))
        return [], False
    if not recovered.faults:
        return [recovered.episode], True
    tally.recovered.append(
        {
            "file": str(file),
            "samples": recovered.samples,
            "samples_expected": recovered.samples_expected,
            "faults": list(recovered.faults),
        }
    )
    _say(f"{file}: {recovered.summary}")
    # A table may have a hole in time, frames may not. On the grid of a measured log, a hole is NaN.
    on_grid = args.sample_time is not None and recovered.episode.is_measured
    if args.format == "parquet" and not on_grid:
        return whole_pieces_in_time(recovered.episode, args.sample_time or 0.0), False
    return [recovered.episode], False


def _at(episode: Episode, sample_time: float | None, file: Path) -> Episode:
    if sample_time is None:
        return episode
    try:
        return episode.on_grid(sample_time) if episode.is_measured else episode.every(sample_time)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error


def _write(args: Export, folder: Path, pieces: Iterator[Piece]) -> None:
    if args.format == "parquet":
        from twin.export.lerobot import write_lerobot  # pyarrow may not be installed

        write_lerobot(folder, ((piece.name, piece.episode) for piece in pieces))
        return
    for piece in pieces:
        path = folder / f"{piece.name}.{args.format}"
        if args.format == "csv":
            write_csv(path, piece.episode, everything=args.columns == "all")
        elif piece.file is not None:
            write_whole(path, piece.file.read_bytes())  # with what is not of the episode, such as pictures
        else:
            write_episode(path, _without_recipe(piece.episode))


def _without_recipe(episode: Episode) -> Episode:
    """What is no more all that a recipe made does not say that it is; nobody takes it for a whole file."""
    facts = {
        name: value
        for name, value in episode.metadata.items()
        if name not in ("samples", "statistics", "recipe_sha256")
    }
    files = {name: data for name, data in episode.attachments.items() if name != "recipe.yaml"}
    return dataclasses.replace(episode, metadata=facts, attachments=files)


def _missing(tally: Tally) -> str:
    """Return what the summary says of files that were damaged."""
    said = ""
    if tally.recovered:
        got = sum(file["samples"] for file in tally.recovered)
        expected = [file["samples_expected"] for file in tally.recovered]
        if None in expected:
            missing = f"{got} samples are whole of an unknown number"
        else:
            gone = sum(expected) - got
            missing = f"{gone} of {sum(expected)} samples ({100 * gone / sum(expected):.1f} %) are missing"
        said += f"; damaged files: {len(tally.recovered)}, {missing}"
    if tally.lost:
        said += f"; files of which nothing is left: {len(tally.lost)}"
    return said


def _say(line: str) -> None:
    tqdm.write(f"endotwin export: {line}", file=sys.stderr)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Export, export, argv)


if __name__ == "__main__":
    sys.exit(main())
