"""`endotwin calibrate`: fit the physical parameters of a preset to measured or simulated logs."""

import dataclasses
import json
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import tyro
import yaml

from scripts.command import Progress, Summary, output_file, run_verb
from twin.calibration import calibrate, free_parameters, likely_ranges, measured_loop, uncertainty
from twin.calibration.report import fit_figure, fit_report
from twin.episode import Episode
from twin.files.atomic import write_whole
from twin.preset.file import load_preset
from twin.preset.preset import Preset, parse_changes
from twin.preset.randomization import Ranges
from twin.recording import read_dataset
from twin.report.figures import to_png_bytes


@dataclasses.dataclass(frozen=True)
class Calibrate:
    """Fit the physical parameters of a preset to logs, several bends of the sheath at once.

    Writes the preset, and beside it NAME_fit.json (errors on each log, uncertainty of each parameter) and
    NAME_fit.png. An interrupted calibration goes on where it was when the same command runs again.
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files."""
    out: Path = Path("preset.yaml")
    """Preset to write."""
    predict: tuple[Path, ...] = ()
    """Logs that are not fitted, but predicted and reported: how far the fit carries."""
    preset: str = "vio_com"
    """Preset that gives everything that is not fitted; what is fitted starts from what the logs show."""
    set: tuple[str, ...] = ()
    """Change parameters of that preset: NAME=VALUE ..., in its SI units."""
    free: tuple[str, ...] = ()
    """Parameters to fit; if not given, those that the logs can tell."""
    evaluations: int = 3000
    """Simulations of all logs that the evolution strategy may use, in two starts."""
    fraction: float = 1.0
    """Share of each log, from its start, that is fitted; the rest is predicted."""
    pace: float | None = None
    """Play the logs this many times faster than recorded; a log of phases has a pace of its own."""
    sample_time: float = 0.05
    """Time between two samples that are compared [s]."""
    seed: int = 0
    json: bool = False
    """Print the summary as one JSON object."""


def run_calibration(args: Calibrate) -> Summary:
    """Write the preset and its fit report."""
    if not args.data:
        raise ValueError("no data given: name folders of MCAP files, or files")
    out = output_file(args.out, (".yaml", ".yml"))
    base = load_preset(args.preset).replace(**parse_changes(args.set)).replace(name=out.stem)
    records, unseen = (
        [(path, episode) for path in paths for episode in read_dataset(path)]
        for paths in (args.data, args.predict)
    )
    base = _with_pulley_of(base, [episode for _, episode in records + unseen])
    grid = partial(measured_loop, sample_time=args.sample_time, pace=args.pace)
    loops = [grid(episode, _name(path, episode), fraction=args.fraction) for path, episode in records]
    held_out = [grid(episode, _name(path, episode)).only_predicted() for path, episode in unseen]
    free = free_parameters(base, loops, args.free or None)
    state_file = out.with_name(f".{out.stem}.calibration")
    progress = Progress("calibrate", "sim")
    fit = calibrate(
        free,
        loops,
        seed=args.seed,
        evaluations=args.evaluations,
        state_file=state_file,
        on_progress=lambda done, total, cost: progress(done, total, f"cost {cost:.3f}"),
    )
    known = uncertainty(fit, free)
    shown = loops + held_out
    values, episodes = fit_report(fit, free, known, shown, args.seed)
    write_whole(out.with_name(f"{out.stem}_fit.png"), to_png_bytes(fit_figure(shown, episodes)))
    write_whole(out.with_name(f"{out.stem}_fit.json"), json.dumps(values, indent=2) + "\n")
    write_whole(out, _to_yaml(fit.preset, likely_ranges(fit, free, known), [loop.name for loop in loops]))
    state_file.unlink(missing_ok=True)
    for warning in known.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    errors = ", ".join(_in_words(log) for log in values["logs"])
    return Summary(f"{out}: {errors}", {"out": str(out), **values})


def _with_pulley_of(base: Preset, episodes: Sequence[Episode]) -> Preset:
    """Take over the pulley by which an angle of the drive became a pulling distance.

    Raises:
        ValueError: the logs were read with different ones.
    """
    radii = {radius for episode in episodes if (radius := episode.metadata.get("pulley_radius"))}
    if len(radii) > 1:
        listed = ", ".join(f"{radius * 1e3:g}" for radius in sorted(radii))
        raise ValueError(f"the logs were imported with pulleys of {listed} mm: one preset has one pulley")
    return base.replace(pulley_radius=radii.pop()) if radii else base


def _name(path: Path, episode: Episode) -> str:
    return str(episode.metadata.get("name") or path.name)


def _to_yaml(preset: Preset, ranges: Ranges, logs: Sequence[str]) -> str:
    """Return the preset's file; its ranges for domain randomisation are the uncertainty of the fit."""
    values = {name: value for name, value in preset.to_dict().items() if name != "name"}
    rounded = {name: float(f"{values[name]:.6g}") for name, _, _ in ranges.limits}
    head = (
        f"# Calibrated by `endotwin calibrate` on {', '.join(logs)}. SI units; see twin/preset/preset.py.\n"
    )
    return head + yaml.safe_dump(values | rounded | {"ranges": ranges.to_dict()}, sort_keys=False)


def _in_words(log: dict[str, Any]) -> str:
    fitted, held_out = log["rmse_deg"], log["held_out_rmse_deg"]
    if fitted is None:
        return f"{log['name']} predicted within {held_out:.2f} deg"
    more = "" if held_out is None else f" (held out {held_out:.2f})"
    return f"{log['name']} RMSE {fitted:.2f} deg{more}"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb."""
    return run_verb(Calibrate, run_calibration, argv)


if __name__ == "__main__":
    sys.exit(main())
