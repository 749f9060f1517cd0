"""`endotwin report`: make one self-contained HTML page of a run of any kind."""

import dataclasses
import sys
from functools import partial
from pathlib import Path

import tyro

from scripts.command import SeedIgnored, Summary, run_verb
from scripts.outputs import output_file
from twin.errors import require_extra


@dataclasses.dataclass(frozen=True)
class Report(SeedIgnored):
    """Make one self-contained HTML page of a result: tables, figures, parameters, commands.

    Run folders (out/demo), datasets, evaluations, training runs, calibrations, gates and comparisons of
    controllers are recognised by their files.

    Examples:
        endotwin report dataset
        endotwin report . --out report.html
    """

    path: tyro.conf.Positional[Path]
    """Folder of the run, such as out/demo, or a calibrated preset."""
    out: Path | None = None
    """File to write; report.html in the folder, or NAME_report.html next to a preset, if not given."""


def report(args: Report) -> Summary:
    """Write the page."""
    require_extra("viz")
    from twin.report.report import known_file, write_report

    known_file(args.path)  # before its output is checked
    name = f"{args.path.stem}_report.html"
    out = args.out or (args.path.parent / name if args.path.is_file() else args.path / "report.html")
    path = write_report(args.path, output_file(out, (".html",), inputs=(args.path,)))
    return Summary(f"{path}: {path.stat().st_size / 2**20:.1f} MiB", {"out": str(path)})


main = partial(run_verb, Report, report)

if __name__ == "__main__":
    sys.exit(main())
