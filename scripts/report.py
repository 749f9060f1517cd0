"""`endotwin report`: make one self-contained HTML page of a run."""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

import tyro

from scripts.command import Summary, run_verb
from scripts.outputs import output_file


@dataclasses.dataclass(frozen=True)
class Report:
    """Make one self-contained HTML page of a run: parameters, loops, tables, figures, frames."""

    folder: tyro.conf.Positional[Path]
    """Run folder, such as out/demo."""
    out: Path | None = None
    """File to write; report.html in the run folder if not given."""
    seed: int = 0
    """Nothing is drawn by chance; here for uniformity."""
    json: bool = False
    """Print the summary as one JSON object."""


def report(args: Report) -> Summary:
    """Write the page."""
    from twin.report.page import write_report

    if not args.folder.is_dir():
        raise FileNotFoundError(f"no folder {args.folder}")
    path = write_report(args.folder, output_file(args.out or args.folder / "report.html", (".html",)))
    return Summary(f"{path}: {path.stat().st_size / 2**20:.1f} MiB", {"out": str(path)})


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Report, report, argv)


if __name__ == "__main__":
    sys.exit(main())
