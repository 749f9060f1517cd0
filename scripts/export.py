"""`endotwin export`: episodes as a LeRobot dataset in Parquet, as CSV tables, or as rewritten MCAP files."""

import dataclasses
import sys
from functools import partial
from pathlib import Path
from typing import Literal

import tyro

from scripts.command import SeedIgnored, Summary, complain, run_verb
from scripts.outputs import output_folder
from scripts.progress import Progress


@dataclasses.dataclass(frozen=True)
class Export(SeedIgnored):
    """Write episodes as a LeRobot dataset (v3.0, Parquet), as CSV tables, or as MCAP files.

    The folder appears when everything is written. Each file is named after its record; if records of several
    folders have the same name, all names start with that of the folder: run_a/episode_0000.mcap becomes
    run_a_episode_0000.

    Examples:
        endotwin export data/train --format parquet --out lerobot
        endotwin export data/train --format csv --columns all --out tables
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files."""
    out: Path
    """Folder to write; an existing one must be empty."""
    format: Literal["parquet", "csv", "mcap"] = "parquet"
    """parquet is a dataset as LeRobot reads it; it needs endotwin[parquet]."""
    columns: Literal["main", "all"] = "main"
    """Columns of CSV. main: command, true angle and tensions; all: also measured angle and hidden state."""
    sample_time: float | None = None
    """Time between two samples [s]: simulated records are thinned to it, measured logs resampled; if not
    given, records keep their samples. Thinned or recovered MCAP files lose their pictures and estimates."""
    recover: bool = False
    """Recover the complete part of damaged files, and state how much is missing; else they are refused."""


def export(args: Export) -> Summary:
    """Write the folder."""
    from twin.errors import require_extra
    from twin.export.export import Plan, export_records, named_files
    from twin.files.atomic import WholeFolder

    if args.columns == "all" and args.format != "csv":
        raise ValueError(f"--columns all is for --format csv, not {args.format}, which holds all there is")
    if args.format == "parquet":
        require_extra("parquet", "the format parquet")
    plan = Plan(args.format, args.columns == "all", args.sample_time, args.recover)
    files = named_files(args.data)
    whole = WholeFolder(args.out)
    output_folder(whole.path.parent)
    with whole as folder:
        progress = Progress("export", "ep")
        tally = export_records(files, folder, plan, on_progress=progress, on_damage=_warn)
    size = sum(path.stat().st_size for path in whole.path.rglob("*") if path.is_file())
    values = {"out": str(args.out), "format": args.format, "files": len(files), "bytes": size}
    written = f"{tally.episodes} episodes, {tally.seconds:g} s, as {args.format} ({size / 1e6:.1f} MB)"
    return Summary(f"{args.out}: {written}{tally.damage}", values | dataclasses.asdict(tally))


def _warn(line: str) -> None:
    from tqdm import tqdm

    with tqdm.external_write_mode(file=sys.stderr):  # above the bar
        complain(f"endotwin export: {line}")


main = partial(run_verb, Export, export)

if __name__ == "__main__":
    sys.exit(main())
