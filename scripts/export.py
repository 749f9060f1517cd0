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
    """Take what is whole of damaged files, and state how much is missing; without it, they are refused."""


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
