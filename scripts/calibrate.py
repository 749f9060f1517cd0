"""`endotwin calibrate`: fit the physical parameters of a preset to measured or simulated logs."""

import dataclasses
import sys
from functools import partial
from pathlib import Path
from typing import Literal

import tyro

from scripts.command import Options, Summary, command_line, complain, run_verb
from scripts.outputs import output_file
from scripts.progress import Progress
from twin.errors import require_extra


@dataclasses.dataclass(frozen=True)
class Calibrate(Options):
    """Fit the physical parameters of a preset to logs, several bends of the sheath at once.

    Writes the preset, with NAME_fit.json (errors on each log, uncertainty of each parameter) and
    NAME_fit.png. The same command continues an interrupted calibration.

    Examples:
        endotwin calibrate data/measured --preset ureteroscope --out preset.yaml
        endotwin calibrate data/measured_000 data/measured_090 --out rig.yaml
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files."""
    out: Path = Path("preset.yaml")
    """Preset to write."""
    predict: tuple[Path, ...] = ()
    """Logs that are not fitted but predicted: the report states the errors."""
    preset: str = "vio_com"
    """Preset with the parameters that are not fitted; fitted ones start from estimates out of the logs."""
    set: tuple[str, ...] = ()
    """Change parameters of that preset, in SI units."""
    free: tuple[str, ...] = ()
    """Parameters to fit; if not given, those that the logs can determine."""
    starts: int = 12
    """Starts of the search; more of them may find a better optimum."""
    fraction: float = 1.0
    """Share of each log, from its start, that is fitted; the rest is predicted. For a file of windows
    (`import --window-column`), the share of its windows."""
    pace: float | None = None
    """Play the logs this many times faster than recorded; a log of phases has a pace of its own."""
    sample_time: float | None = None
    """Time between two samples that are compared [s]; if not given, about 900 samples of all logs are
    compared, or four times the number of samples of a sparse log."""
    rivals: tuple[Literal["coleman-hodgdon", "bouc-wen", "prandtl-ishlinskii"], ...] = (
        "coleman-hodgdon",
        "prandtl-ishlinskii",
    )
    """Models without physics that are fitted to the same part of each log, for comparison; bouc-wen takes
    some seconds for each bend of the sheath."""
    seed: int = 0
    """Seed of the search."""


def run_calibration(args: Calibrate) -> Summary:
    """Write the preset and its fit report."""
    require_extra("sim")
    from twin.calibration import calibrate, structures
    from twin.calibration.files import log_summary, read_loops, report_files, write_fit
    from twin.calibration.search import STATE, check_effort, foreseen_seconds
    from twin.files.atomic import MADE_BY
    from twin.files.origin import origin_of
    from twin.files.state_file import remove_state
    from twin.preset.file import load_preset
    from twin.preset.preset import parse_changes

    if not args.data:
        raise ValueError("no data given: name folders of MCAP files, or files")
    check_effort(args.starts, args.seed)
    report, figure = report_files(args.out)
    companions = {figure.name: MADE_BY, report.name: '"standard_deviation"'}
    inputs = [*args.data, *args.predict, Path(args.preset)]
    out = output_file(
        args.out, (".yaml", ".yml"), "`endotwin calibrate`", companions=companions, inputs=inputs
    )
    base = load_preset(args.preset).replace(**parse_changes(args.set)).replace(name=out.stem)
    loops, held_out, base = read_loops(
        args.data, args.predict, base, sample_time=args.sample_time, pace=args.pace, fraction=args.fraction
    )
    tried = structures(base, loops, args.free or None)
    seconds = foreseen_seconds(tried, loops, args.starts)
    samples = sum(len(loop.seen) for loop in loops)
    complain(
        f"calibrate: {len(loops)} logs, {samples} samples of {loops[0].sample_time:g} s, "
        f"{len(tried[0].names)} parameters, {args.starts} starts: about {seconds:.0f} s"
    )
    state_file = out.with_name(f".{out.stem}.calibration")
    progress = Progress("calibrate", "stage")
    fit = calibrate(
        tried,
        loops,
        seed=args.seed,
        starts=args.starts,
        state_file=state_file,
        on_progress=lambda done, total, cost: progress(done, total, f"cost {cost:.3f}"),
    )
    given = [*args.data, *args.predict]
    origin = origin_of(command_line("calibrate", args), given)
    values = write_fit(out, fit, loops, held_out, args.seed, args.rivals, origin)
    remove_state(state_file, STATE)
    for warning in values["warnings"]:
        complain(f"warning: {warning}")
    for condition in values["conditions"]:
        complain(f"note: {condition}")
    errors = ", ".join(map(log_summary, values["logs"]))
    return Summary(f"{out}: {errors}", {"out": str(out), **values})


main = partial(run_verb, Calibrate, run_calibration)

if __name__ == "__main__":
    sys.exit(main())
