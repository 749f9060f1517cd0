"""Files of a calibration: the logs that it reads, and the preset, report and figure that it writes."""

import contextlib
import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from twin.calibration.compared import TWIN, Compared, compare, errors_deg, rmse
from twin.calibration.figure import fit_figure
from twin.calibration.logs import (
    MeasuredLoop,
    check_windows,
    file_of_window,
    first_windows,
    measured_loop,
    thinned,
)
from twin.calibration.objective import own_offsets, predict
from twin.calibration.search import Fit, steady
from twin.calibration.uncertainty import Uncertainty, likely_ranges, uncertainty
from twin.episode import Episode
from twin.errors import DivergedError, InputError
from twin.files.atomic import write_whole
from twin.files.shown import cut, printable
from twin.hysteresis.width import without_hysteresis
from twin.preset.preset import Preset, parameter_limits
from twin.preset.randomization import Ranges
from twin.preset.sensor import KEY, SensorModel
from twin.recording import read_dataset
from twin.report.figures import to_png_bytes


def fit_report(fit: Fit, known: Uncertainty, logs: Sequence[Compared], seed: int) -> dict[str, Any]:
    """Return errors on every log, and parameters, as plain values for JSON; an unknown value is None."""
    diverged = [f"the calibrated twin diverges along {log.loop.name}" for log in logs if log.episode is None]
    return {
        "cost": fit.cost,
        "reduced_cost": fit.reduced_cost,
        "optimizer": "trust-region least squares from many starts on the reduced twin, corrected in MuJoCo",
        "seed": seed,
        "logs": [_of_log(log, fit.preset.sensor_zero) for log in logs],
        "parameters": {
            name: {
                "value": getattr(fit.preset, name),
                "standard_deviation": _finite(known.total[name]),
                "standard_deviation_with_the_others_fixed": _finite(sd),
            }
            for name, sd in known.deviation.items()
        },
        "fixed": {name: getattr(fit.preset, name) for name in fit.fixed},
        "conditions": list(known.conditions),
        "sensor": SensorModel.of(fit.preset).to_dict(),
        "warnings": [
            *([fit.unconfirmed] if fit.unconfirmed else []),
            *without_hysteresis((of.loop.name, of.loop.episode.pull, of.loop.episode.bend) for of in logs),
            *known.warnings,
            *diverged,
        ],
    }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _of_log(log: Compared, zero: float) -> dict[str, Any]:
    loop, episode = log.loop, log.episode
    values: dict[str, Any] = {
        "name": loop.name,
        "sheath_bend_deg": None if loop.sheath_bend is None else float(np.degrees(loop.sheath_bend)),
    }
    for plane, errors in enumerate(log.errors):
        prefix = "lateral_" if plane else ""
        known = loop.offset and errors[TWIN] is not None
        offset = (0.0 if plane else zero) - log.offsets[plane]  # reading = angle + offset
        values[f"{prefix}offset_deg"] = float(np.degrees(offset)) if known else None
        for name, error in errors.items():
            whose = prefix if name == TWIN else f"{prefix}{name.replace('-', '_')}_"
            values |= {f"{whose}{key}": value for key, value in errors_deg(error, loop).items()}
    own_start = None if log.own_start is None else rmse(np.degrees(log.own_start[loop.seen]))
    values["held_out_own_start_rmse_deg"] = own_start
    scored = loop.fitted if loop.fitted.any() else loop.seen
    for index, wire in enumerate("ab"[: loop.tension.shape[1]]):
        measured = loop.tension[:, index]
        wire_rmse = None if episode is None else rmse((episode.tension[:, index] - measured)[scored])
        span = float(np.ptp(measured))  # zero for a wire that stays slack
        values[f"tension_{wire}_rmse_n"] = wire_rmse
        values[f"tension_{wire}_rmse_percent_of_range"] = (
            None if wire_rmse is None or span == 0 else 100 * wire_rmse / span
        )
    return values


_LONGEST_NAME = 100  # of a log, on one line, in letters


def read_loops(
    fitted: Sequence[Path],
    predicted: Sequence[Path],
    base: Preset,
    *,
    sample_time: float | None = None,
    pace: float | None = None,
    fraction: float = 1.0,
) -> tuple[list[MeasuredLoop], list[MeasuredLoop], Preset]:
    """Read logs to fit and logs only to predict, and put them on an even grid.

    Of windows that were cut from longer records, the first share of each file's are fitted completely, the
    others are predicted. `sample_time` [s] is that of `thinned` if not given; `pace` and `fraction` are those
    of `measured_loop`.

    Returns:
        The logs to fit, those to predict, and the preset with the pulley of the logs.
    """
    records, unseen = (
        [(path, episode) for path in paths for episode in read_dataset(path)] for paths in (fitted, predicted)
    )
    base = with_pulley_of(base, [episode for _, episode in records + unseen])
    if not 0 < fraction <= 1:
        raise InputError(f"fraction = {fraction}: must be above 0 and at most 1")
    records, last = first_windows(records, fraction)
    unseen = last + unseen
    kept, rest = ([episode for _, episode in some] for some in (records, unseen))
    period = thinned(kept, base, pace, rest) if sample_time is None else sample_time

    def loop_of(path: Path, episode: Episode, share: float = 1.0) -> MeasuredLoop:
        name = printable(str(episode.metadata.get("name") or path.name))[:_LONGEST_NAME]
        return measured_loop(episode, name, period, pace=pace, fraction=share)

    loops = [loop_of(path, one, 1.0 if file_of_window(one) else fraction) for path, one in records]
    check_windows(loops)
    held_out = [loop_of(path, one).only_predicted() for path, one in unseen]
    return loops, held_out, base


def with_pulley_of(base: Preset, episodes: Sequence[Episode]) -> Preset:
    """Return the preset with the pulley by which an angle of the drive became a pulling distance."""
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
    """Write a calibrated preset, then NAME_fit.json, which it returns, and NAME_fit.png."""
    shown = [*loops, *held_out]
    with contextlib.suppress(DivergedError):  # the report states along which log
        fit = dataclasses.replace(fit, preset=steady(fit.preset, shown))
    known = uncertainty(fit)
    fit = dataclasses.replace(fit, preset=with_sensor(fit, loops, known))
    preset, ranges = with_sheaths_of(fit.preset, likely_ranges(fit, known), loops)
    write_whole(out, preset_yaml(preset, ranges, [loop.name for loop in loops]))
    logs = compare(fit.preset, shown, seed, rivals)
    values = fit_report(fit, known, logs, seed) | ({"origin": dict(origin)} if origin else {})
    report, figure = report_files(out)
    write_whole(report, json.dumps(values, indent=2) + "\n")
    write_whole(figure, to_png_bytes(fit_figure(logs)))
    return values


def with_sheaths_of(preset: Preset, ranges: Ranges, loops: Sequence[MeasuredLoop]) -> tuple[Preset, Ranges]:
    """Return a fitted preset and its ranges with the sheath bends of the logs: their middle, and all between.

    Where a log does not state its bend, the fit rests on that of the preset, which stays.
    """
    bends = [loop.sheath_bend for loop in loops if loop.sheath_bend is not None]
    if len(bends) < len(loops):
        return preset, ranges
    low, high = min(bends), max(bends)
    limits = (*ranges.limits, ("sheath_bend", low, high)) if low < high else ranges.limits
    return preset.replace(sheath_bend=(low + high) / 2), Ranges(limits)


def with_sensor(fit: Fit, loops: Sequence[MeasuredLoop], known: Uncertainty) -> Preset:
    """Return a fitted preset with the zero, the noise and the rate of the sensor of measured logs.

    Logs of one mounting share a zero: it is the mean of theirs, as uncertain as they differ.
    """
    preset, measured = fit.preset, [loop for loop in loops if loop.offset and loop.reading_step]
    if not measured:
        return preset
    episodes = predict([preset], measured, "reduced" if fit.unconfirmed else "mujoco")[0]
    each = own_offsets(episodes, measured)
    spread = float(np.std(each, ddof=1)) if len(each) > 1 else 0.0
    deviation = float(np.hypot(spread, np.nan_to_num(known.zero_deviation)))
    _, widest = parameter_limits("sensor_zero_deviation")
    steps = {loop.reading_step for loop in measured if loop.timed}
    return preset.replace(
        sensor_zero=preset.sensor_zero - float(each.mean()),
        sensor_zero_deviation=min(deviation, widest),  # a wider one is as unknown
        sensor_noise=float(np.sqrt(np.mean([loop.reading_noise[0] for loop in measured]))),
        sensor_period=min(steps) if steps else preset.sensor_period,
    )


def report_files(out: Path) -> tuple[Path, Path]:
    """Return the report and the figure that go with a calibrated preset."""
    return out.with_name(f"{out.stem}_fit.json"), out.with_name(f"{out.stem}_fit.png")


def preset_yaml(preset: Preset, ranges: Ranges, logs: Sequence[str]) -> str:
    """Return a calibrated preset as YAML, with the uncertainty of the fit as its ranges."""
    sensor = SensorModel.of(preset)
    values = {
        name: value
        for name, value in preset.to_dict().items()
        if name != "name" and name not in sensor.parameters()
    }
    rounded = {name: float(f"{values[name]:.6g}") for name, _, _ in ranges.limits}
    stated = {name: float(f"{value:.6g}") for name, value in sensor.to_dict().items()}
    named_logs = cut(", ".join(logs), 400)
    head = f"# Calibrated by `endotwin calibrate` on {named_logs}. SI units; see twin/preset/preset.py.\n"
    return head + yaml.safe_dump(
        values | rounded | {KEY: stated, "ranges": ranges.to_dict()}, sort_keys=False
    )


def log_summary(log: dict[str, Any]) -> str:
    """Return in words how well a log is fitted or predicted, from its entry in NAME_fit.json."""
    fitted, held_out = log["rmse_deg"], log["held_out_rmse_deg"]
    if fitted is None and held_out is None:
        return f"{log['name']} diverges"
    if fitted is None:
        sideways = _sideways(log, "held_out_rmse_deg")
        return f"{log['name']} predicted within {held_out:.2f} deg{sideways}{_less(log)}"
    more = "" if held_out is None else f" (held out {held_out:.2f}{_sideways(log, 'held_out_rmse_deg')})"
    return f"{log['name']} RMSE {fitted:.2f} deg{_sideways(log, 'rmse_deg')}{more}"


def _less(log: dict[str, Any]) -> str:
    """Return the error of a predicted log less what it does not tell, in words."""
    centred, own_start = log["held_out_centred_rmse_deg"], log["held_out_own_start_rmse_deg"]
    if own_start is None:
        return ""
    return f" ({centred:.2f} less its offset, {own_start:.2f} also from the pose it began in)"


def _sideways(log: dict[str, Any], name: str) -> str:
    lateral = log.get(f"lateral_{name}")
    return "" if lateral is None else f", sideways {lateral:.2f}"
