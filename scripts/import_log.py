"""`endotwin import`: read a measured log into an MCAP file as `generate` writes them."""

import dataclasses
import sys
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import tyro

from scripts.command import SeedIgnored, Summary, complain, options_of, run_verb, with_flags
from scripts.outputs import output_file, output_folder


@dataclasses.dataclass(frozen=True)
class Import(SeedIgnored):
    """Read a measured log into an MCAP file in the form of simulated records.

    Examples:
        endotwin import --look bench.csv
        endotwin import bench.csv --command-column pull_mm --angle-column angle_deg --out data/measured
    """

    GROUPS: ClassVar = {
        "Command of the drive": "command_column",
        "Measured angle": "angle_column",
        "Time": "time_column",
        "Other columns": "lateral_command_column",
        "Several records in one file": "window_column",
    }

    file: tyro.conf.Positional[Path]
    """Log: text with columns, .npz, .mat, .parquet, .xlsx, a ROS bag (.bag, .db3, .mcap or its folder) or
    MCAP of other software. A field of a topic is a column, such as /cmd.data."""
    out: Path | None = None
    """Folder to write into; other measured logs in it stay. With --look: a PNG file with the loop."""
    name: str | None = None
    """Name of the MCAP file without its ending; that of the log, if not given."""
    no_header: bool = False
    """The first line holds numbers: columns are named by their numbers, from 1."""
    look: bool = False
    """Import nothing: show the columns, their likely meaning, and the command that imports the file."""
    command_column: Annotated[str, tyro.conf.arg(aliases=["--command-topic"])] = "command_deg"
    """Column with the command: an angle of the pulley, or a pulling distance."""
    command_unit: Literal["deg", "rad", "mm", "m"] | None = None
    """Its unit, if the column's name does not end in it."""
    command_scale: float = 1.0
    """Size of one count of an encoder, in units of the command: (count - zero) * scale."""
    command_zero: float = 0.0
    """Counts at the command zero."""
    pulley_radius_mm: float = 10.0
    """Radius that turns an angle of the pulley into a pulling distance [mm]; kept in the metadata."""
    angle_column: Annotated[str, tyro.conf.arg(aliases=["--angle-topic"])] = "angle_deg"
    """Column with the measured bending angle; it may be empty in rows where the sensor dropped out."""
    angle_unit: Literal["deg", "rad"] | None = None
    """Its unit, if the column's name does not end in it."""
    unwrap_angle: bool = False
    """The angle jumps by full turns: make it continuous."""
    reverse_angle: bool = False
    """The sensor counts a bend towards wire a, the pulled one, as negative."""
    time_column: tuple[str, ...] = ()
    """Column with time or phase, or two columns whose times are added, such as seconds and nanoseconds; if
    not given, time_s or phase_rad, whichever exists. Dates with times are read too."""
    time_unit: Literal["s", "ms", "us", "ns", "rad"] | None = None
    """Unit of the first, if the column's name does not end in it; rad for a phase."""
    seconds_per_cycle: float = 20.0
    """Duration of 2 pi of a phase [s]."""
    lateral_command_column: str | None = None
    """Command of the second bending plane, of wires c and d, in the unit of the first."""
    lateral_angle_column: str | None = None
    """Measured bending angle in that plane."""
    reverse_lateral_angle: bool = False
    """The sensor counts a bend towards wire c as negative."""
    tension_a_column: str | None = None
    """Tension of wire a at the pulley [N]; if not given, tension_a_n, if it and tension_b_n exist."""
    tension_b_column: str | None = None
    """Tension of wire b at the pulley [N]."""
    sheath_bend_deg: float | None = None
    """Bending angle of the sheath [deg]; if not given, the column of that name, if it exists."""
    window_column: str | None = None
    """The file holds windows cut from longer records: column whose number changes from window to window. Each
    becomes an MCAP file, NAME_window_0000 ..."""
    split_runs: bool = False
    """The file holds several runs: a new one begins where the time restarts or has a gap. Each becomes an
    MCAP file."""


def import_log(args: Import) -> Summary:
    """Write the log as an episode."""
    if args.look:
        return _look(args)
    if args.out is None:
        raise ValueError("give --out, the folder to write into, or --look to see what the file holds")
    import numpy as np

    from twin.files.bounds import check_file_name
    from twin.measured.folder import write_measured, write_windows
    from twin.measured.log import LogFormat, oddities, read_measured_log, read_windows
    from twin.measured.look import look
    from twin.measured.table import MissingColumnError

    name = args.file.stem if args.name is None else args.name
    check_file_name(name)
    if len(args.time_column) > 2:
        raise ValueError(f"--time-column names {len(args.time_column)} columns: at most two are added")
    if args.split_runs and args.window_column is not None:
        raise ValueError("--split-runs and --window-column split a file both: give one of them")
    time_column, fraction = (*args.time_column, None, None)[:2]
    given = options_of(LogFormat, args) | {"time_column": time_column, "time_fraction_column": fraction}
    form = LogFormat(pulley_radius=args.pulley_radius_mm * 1e-3, **given)
    windows = args.window_column is not None or args.split_runs
    try:
        if not windows:
            episodes = [read_measured_log(args.file, form, on_warning=_warn)]
        else:
            episodes = read_windows(args.file, args.window_column, form, on_warning=_warn)
    except MissingColumnError as error:
        raise ValueError(f"{error}; try: {look(args.file).command()}") from error
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


def _look(args: Import) -> Summary:
    from twin.files.atomic import write_whole
    from twin.measured.log import oddities, read_measured_log
    from twin.measured.look import look
    from twin.report.tables import aligned_table

    guess = look(args.file)
    names = ["column", "seems to be", "ranges from", "missing"]
    table = aligned_table(guess.lines(), names, fmt="plain", left=2)
    form = guess.form()
    values: dict[str, Any] = {"file": str(args.file), "command": guess.command(), "roles": dict(guess.roles)}
    if form is not None:
        log = read_measured_log(args.file, form, on_warning=_warn)
        for oddity in oddities(log):
            _warn(f"{args.file}: {oddity}")
        values |= {"samples": len(log.time), "sample_time_s": log.sample_time}
        table += f"\n\n{len(log.time)} samples, {log.time[-1]:g} s at {1 / log.sample_time:.3g} Hz"
        if args.out is not None:
            from twin.dataset.card import loops_figure
            from twin.report.figures import to_png_bytes

            path = output_file(args.out, (".png",), inputs=[args.file])
            write_whole(path, to_png_bytes(loops_figure([log])))
    return Summary(guess.command(), values, table=table + "\n")


def _warn(line: str) -> None:
    complain(f"endotwin import: warning: {with_flags(line, Import)}")


main = partial(run_verb, Import, import_log)

if __name__ == "__main__":
    sys.exit(main())
