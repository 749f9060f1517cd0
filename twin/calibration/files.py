"""Files of a calibration: the logs that it reads, and the preset, report and figure that it writes."""

import contextlib
import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from twin.calibration.compared import compare
from twin.calibration.confirm import steady
from twin.calibration.figure import fit_figure
from twin.calibration.fit import Fit
from twin.calibration.measured import MeasuredLoop, file_of_window, measured_loop, thinned
from twin.calibration.report import fit_report
from twin.calibration.uncertainty import likely_ranges, uncertainty
from twin.calibration.windows import check_windows, first_windows
from twin.episode import Episode
from twin.errors import DivergedError, InputError
from twin.files.atomic import write_whole
from twin.files.shown import cut, printable
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.recording import read_dataset
from twin.report.figures import to_png_bytes

_LONGEST_NAME = 100  # of a log, in letters


def read_loops(
    fitted: Sequence[Path],
    predicted: Sequence[Path],
    base: Preset,
    *,
    sample_time: float | None = None,
    pace: float | None = None,
    fraction: float = 1.0,
) -> tuple[list[MeasuredLoop], list[MeasuredLoop], Preset]:
    """Read logs and put them on an even grid.

    Args:
        fitted: folders of MCAP files, or files, to fit.
        predicted: the same, only to be predicted.
        base: the preset that the calibration starts from.
        sample_time: of the grid [s]; without one, that of `thinned`.
        pace: how many times faster than recorded logs are played, as in `measured_loop`.
        fraction: share of each log in `fitted`, from its start, that is fitted. Of windows that were cut from
            longer records, the first share of each file's are fitted whole; the others are predicted.

    Returns:
        The logs to fit, those to predict, and the preset with the pulley of the logs.

    Raises:
        FileNotFoundError: a path does not exist or a folder holds no MCAP file.
        ValueError: a file is damaged, a log cannot be calibrated on, the logs have different pulleys, or
            `fraction` is out of range.
    """
    records, unseen = (
        [(path, episode) for path in paths for episode in read_dataset(path)] for paths in (fitted, predicted)
    )
    base = with_pulley_of(base, [episode for _, episode in records + unseen])
    if not 0 < fraction <= 1:
        raise InputError(f"fraction = {fraction}: must be above 0 and at most 1")
    records, last = first_windows(records, fraction)
    unseen = last + unseen
    if sample_time is None:
        kept, rest = ([episode for _, episode in some] for some in (records, unseen))
        sample_time = thinned(kept, base, pace, rest)
    loops = [
        measured_loop(
            episode,
            _name(path, episode),
            sample_time,
            pace=pace,
            fraction=1.0 if file_of_window(episode) else fraction,
        )
        for path, episode in records
    ]
    check_windows(loops)
    held_out = [
        measured_loop(episode, _name(path, episode), sample_time, pace=pace).only_predicted()
        for path, episode in unseen
    ]
    return loops, held_out, base


def with_pulley_of(base: Preset, episodes: Sequence[Episode]) -> Preset:
    """Return the preset with the pulley by which an angle of the drive became a pulling distance.

    Raises:
        ValueError: the logs were read with different ones.
    """
    radii = {radius for episode in episodes if (radius := episode.metadata.get("pulley_radius"))}
    if len(radii) > 1:
        listed = ", ".join(f"{radius * 1e3:g}" for radius in sorted(radii))
        raise InputError(f"the logs were imported with pulleys of {listed} mm: one preset has one pulley")
    return base.replace(pulley_radius=radii.pop()) if radii else base


def write_fit(
    out: Path,
    fit: Fit,
    loops: Sequence[MeasuredLoop],
    held_out: Sequence[MeasuredLoop],
    seed: int,
    rivals: Sequence[str] = (),
    origin: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Write a calibrated preset, and beside it NAME_fit.json and NAME_fit.png.

    The preset is the first, so that no trouble with a report loses a fit.

    Args:
        out: the preset's file.
        fit: what was found.
        loops: the logs that were fitted.
        held_out: the logs that are only predicted.
        seed: of the calibration.
        rivals: models without physics that are fitted to the same samples, as in `compare`.
        origin: command, versions and hashes of the logs, for the report.

    Returns:
        What NAME_fit.json holds: the errors on each log, the uncertainty of each parameter, warnings.
    """
    shown = [*loops, *held_out]
    with contextlib.suppress(DivergedError):  # the report says along which log
        fit = dataclasses.replace(fit, preset=steady(fit.preset, shown))
    known = uncertainty(fit)
    write_whole(out, preset_yaml(fit.preset, likely_ranges(fit, known), [loop.name for loop in loops]))
    logs = compare(fit.preset, shown, seed, rivals)
    values = fit_report(fit, known, logs, seed) | ({"origin": dict(origin)} if origin else {})
    report, figure = report_files(out)
    write_whole(report, json.dumps(values, indent=2) + "\n")
    write_whole(figure, to_png_bytes(fit_figure(logs)))
    return values


def report_files(out: Path) -> tuple[Path, Path]:
    """Return the report and the figure that stand beside a calibrated preset."""
    return out.with_name(f"{out.stem}_fit.json"), out.with_name(f"{out.stem}_fit.png")


def preset_yaml(preset: Preset, ranges: Ranges, logs: Sequence[str]) -> str:
    """Return a calibrated preset as YAML; its ranges for domain randomisation are the uncertainty of the fit.

    Args:
        preset: as fitted.
        ranges: of the fitted parameters.
        logs: names of the logs that it was fitted to.
    """
    values = {name: value for name, value in preset.to_dict().items() if name != "name"}
    rounded = {name: float(f"{values[name]:.6g}") for name, _, _ in ranges.limits}
    named_logs = cut(", ".join(logs), 400)
    head = f"# Calibrated by `endotwin calibrate` on {named_logs}. SI units; see twin/preset/preset.py.\n"
    return head + yaml.safe_dump(values | rounded | {"ranges": ranges.to_dict()}, sort_keys=False)


def log_summary(log: dict[str, Any]) -> str:
    """Return in words how well a log is fitted or predicted, from its entry in NAME_fit.json."""
    fitted, held_out = log["rmse_deg"], log["held_out_rmse_deg"]
    if fitted is None and held_out is None:
        return f"{log['name']} diverges"
    if fitted is None:
        return f"{log['name']} predicted within {held_out:.2f} deg{_sideways(log, 'held_out_rmse_deg')}"
    more = "" if held_out is None else f" (held out {held_out:.2f}{_sideways(log, 'held_out_rmse_deg')})"
    return f"{log['name']} RMSE {fitted:.2f} deg{_sideways(log, 'rmse_deg')}{more}"


def _sideways(log: dict[str, Any], name: str) -> str:
    lateral = log.get(f"lateral_{name}")
    return "" if lateral is None else f", sideways {lateral:.2f}"


def _name(path: Path, episode: Episode) -> str:
    """Return the name of a log, on one line and without what a YAML file cannot hold."""
    name = str(episode.metadata.get("name") or path.name)
    return printable(name)[:_LONGEST_NAME]
