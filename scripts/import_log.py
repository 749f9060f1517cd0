"""`endotwin import`: read a measured log, a CSV file, into an MCAP file as `generate` writes them."""

import dataclasses
import sys
from functools import partial
from pathlib import Path
from typing import Literal

import tyro

from scripts.command import SeedIgnored, Summary, complain, options_of, run_verb, with_flags
from scripts.outputs import output_folder


@dataclasses.dataclass(frozen=True)
class Import(SeedIgnored):
    """Read a measured log, a CSV file, into an MCAP file in the form of simulated records."""

    file: tyro.conf.Positional[Path]
    """CSV file with a header."""
    out: Path
    """Folder to write into; other measured logs in it stay."""
    command_column: str = "command_deg"
    """Command of the drive: an angle of the pulley, or a pulling distance."""
    command_unit: Literal["deg", "rad", "mm", "m"] | None = None
    """Its unit, if the column's name does not end in it."""
    pulley_radius_mm: float = 10.0
    """An angle of the pulley becomes a pulling distance by this; kept in the metadata, to undo it."""
    angle_column: str = "angle_deg"
    """Measured bending angle; a row may lack it, as where a sensor dropped out."""
    angle_unit: Literal["deg", "rad"] | None = None
    """Its unit, if the column's name does not end in it."""
    reverse_angle: bool = False
    """The sensor counts a bend towards wire a, the pulled one, as negative."""
    lateral_command_column: str | None = None
    """Command of the second bending plane, of wires c and d, in a log of two; units as those of the first."""
    lateral_angle_column: str | None = None
    """Measured bending angle in that plane."""
    reverse_lateral_angle: bool = False
    """The sensor counts a bend towards wire c as negative."""
    time_column: str | None = None
    """Time or phase; if not given, time_s or phase_rad, whichever there is."""
    time_unit: Literal["s", "ms", "us", "rad"] | None = None
    """Its unit, if the column's name does not end in it; rad for a phase."""
    seconds_per_cycle: float = 20.0
    """Time that 2 pi of a phase take [s]."""
    tension_a_column: str | None = None
    """Tension of wire a at the pulley [N]; if not given, tension_a_n, where there are it and tension_b_n."""
    tension_b_column: str | None = None
    """Tension of wire b at the pulley [N]."""
    sheath_bend_deg: float | None = None
    """Angle that the sheath was bent by; if not given, the column of that name, where there is one."""
    window_column: str | None = None
    """Column of numbers that change from window to window, of a file of pieces cut from longer records
    without what came before them; each window becomes an MCAP file of its own, NAME_window_0000 ..."""
    name: str | None = None
    """Name of the MCAP file without its ending; that of the CSV file if not given."""


def import_log(args: Import) -> Summary:
    """Write the log as an episode."""
    import numpy as np

    from twin.files.bounds import check_file_name
    from twin.measured.folder import write_measured, write_windows
    from twin.measured.log import LogFormat, oddities, read_measured_log, read_windows

    name = args.file.stem if args.name is None else args.name
    check_file_name(name)
    form = LogFormat(pulley_radius=args.pulley_radius_mm * 1e-3, **options_of(LogFormat, args))
    windows = args.window_column is not None
    if args.window_column is None:
        episodes = [read_measured_log(args.file, form, on_warning=_warn)]
    else:
        episodes = read_windows(args.file, args.window_column, form, on_warning=_warn)
    for oddity in oddities(*episodes):
        _warn(f"{args.file}: {oddity}")
    folder = output_folder(args.out)
    paths = write_windows(folder, name, episodes) if windows else [write_measured(folder, name, episodes[0])]
    pull_mm, bend_deg, measured = (
        np.concatenate([getattr(one, field) for one in episodes])
        for field in ("pull_mm", "truth_deg", "measured_bend")
    )
    low, high, least, most = map(float, (bend_deg.min(), bend_deg.max(), pull_mm.min(), pull_mm.max()))
    missing = int(np.isnan(measured).sum())
    without = f" ({missing} without a measurement)" if missing else ""
    seconds = float(sum(one.time[-1] for one in episodes))
    sample_time = float(np.median([one.sample_time for one in episodes]))
    lateral = np.degrees(np.concatenate([one.lateral_bend for one in episodes]))
    lateral_deg = [float(lateral.min()), float(lateral.max())] if lateral.size else None
    sideways = f", sideways from {lateral_deg[0]:.1f} to {lateral_deg[1]:.1f} deg" if lateral_deg else ""
    what = f"{args.out}: {len(paths)} windows, " if windows else f"{paths[0]}: "
    values = {
        "out": str(args.out),
        "file": str(paths[0]),
        "samples": len(pull_mm),
        "missing": missing,
        "seconds": seconds,
        "sample_time_s": sample_time,
        "pull_mm": [least, most],
        "bend_deg": [low, high],
        **({"lateral_bend_deg": lateral_deg} if lateral_deg else {}),
        **({"files": [str(path) for path in paths]} if windows else {}),
    }
    line = f"{what}{len(pull_mm)} samples{without}, {seconds:g} s at {1 / sample_time:.3g} Hz, "
    line += f"pulled from {least:.3g} to {most:.3g} mm, bent from {low:.1f} to {high:.1f} deg{sideways}"
    return Summary(line, values)


def _warn(line: str) -> None:
    complain(f"endotwin import: warning: {with_flags(line, Import)}")


main = partial(run_verb, Import, import_log)

if __name__ == "__main__":
    sys.exit(main())
