"""`endotwin identify`: fit a model of hysteresis to records."""

import dataclasses
import json
import math
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from scripts.command import Options, Summary, run_verb
from scripts.outputs import output_file
from scripts.progress import Progress

if TYPE_CHECKING:
    from twin.episode import Episode
    from twin.hysteresis import HysteresisModel
    from twin.identification.nuisances import Log, Nuisances


@dataclasses.dataclass(frozen=True)
class Identify(Options):
    """Fit a model of hysteresis to the measured angle of records.

    Examples:
        endotwin identify data/train --out coleman_hodgdon.json
        endotwin identify data/train --model prandtl-ishlinskii --out plays.json
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of MCAP files, or files."""
    model: str = "coleman-hodgdon"
    """coleman-hodgdon, bouc-wen or prandtl-ishlinskii."""
    out: Path | None = None
    """File to write; if not given, named after the model, as coleman_hodgdon.json."""
    sample_time: float = 0.1
    """Sample time of the filters that use the model [s]; records are thinned to it."""
    monotone: bool = False
    """Constrain a coleman-hodgdon model to c >= b / 2, so that loops of any size are monotone."""
    thresholds_mm: tuple[float, ...] = ()
    """Thresholds of the plays of a prandtl-ishlinskii model [mm]; if not given, eight over the stroke."""
    population: int = 80
    """Candidates of the genetic algorithm; prandtl-ishlinskii needs none."""
    generations: int = 150
    """Number of generations."""
    fraction: float = 1.0
    """Share of each record, from its start, that is fitted; the rest is predicted, and its error stated."""
    offset: Literal["auto", "on", "off"] = "auto"
    """Fit a zero of the angle for each record with the model: auto does for measured logs. A
    prandtl-ishlinskii model has no zero."""
    delay: Literal["auto", "on", "off"] = "auto"
    """Fit a delay of the command with the model: auto does for measured logs with a clock and a command of
    more than one speed."""
    seed: int = 0
    """Seed of the genetic algorithm."""


def identify(args: Identify) -> Summary:
    """Write the model's file, `coleman_hodgdon.json` or its like."""
    from twin.evaluation.reading import read_episodes
    from twin.files.atomic import write_whole
    from twin.files.bounds import SAMPLE_TIMES, check_between
    from twin.hysteresis import IdentifiedModel, PrandtlIshlinskii
    from twin.identification import OPTIMIZERS, check_options
    from twin.identification import identify as fit
    from twin.identification.nuisances import Nuisances, fit_nuisances, records_of

    if not args.data:
        raise ValueError("no data given: name folders of MCAP files, or files")
    check_options(
        args.model,
        monotone=args.monotone,
        thresholds_mm=args.thresholds_mm,
        population=args.population,
        generations=args.generations,
    )
    check_between("sample_time", args.sample_time, *SAMPLE_TIMES, "s")
    if not 0 < args.fraction <= 1:
        raise ValueError(f"--fraction {args.fraction:g}: must be above 0, at most 1")
    if args.offset == "on" and args.model == PrandtlIshlinskii.name:
        raise ValueError(f"--offset on: a {args.model} model has no zero of the angle")
    episodes = read_episodes(args.data, args.sample_time)
    out = args.out or Path(args.model.replace("-", "_") + ".json")
    output_file(out, (".json",), '"rmse_deg"', inputs=args.data)
    progress = Progress("identify", "gen")
    logs = [_log(episode, number, args) for number, episode in enumerate(episodes)]
    model, rmse = fit(
        records_of(logs, Nuisances((0.0,) * len(logs)), args.sample_time),
        args.seed,
        args.model,
        monotone=args.monotone,
        thresholds_mm=args.thresholds_mm,
        population=args.population,
        generations=args.generations,
        on_generation=lambda done, rmse: progress(done, args.generations, f"RMSE {rmse:.3f} deg"),
    )
    how = OPTIMIZERS[args.model].format(population=args.population, generations=args.generations)
    nuisances = Nuisances((0.0,) * len(logs))
    if any(log.has_offset or log.has_delay for log in logs):
        model, rmse, nuisances = fit_nuisances(
            model, logs, args.sample_time, monotone=args.monotone, thresholds_mm=args.thresholds_mm
        )
        how += ", then scipy least_squares with the nuisances"
    values = IdentifiedModel(
        model=model,
        rmse_deg=rmse,
        optimizer=how,
        seed=args.seed,
        source=", ".join(str(path) for path in args.data),
    ).to_dict()
    values |= _further_entries(args, model, episodes, logs, nuisances)
    write_whole(out, json.dumps(values, indent=2) + "\n")
    parameters = ", ".join(f"{name} = {_text(value)}" for name, value in model.to_dict().items())
    line = f"{out}: {parameters}, RMSE {rmse:.3f} deg over {len(episodes)} records{_in_words(values)}"
    return Summary(line, {"out": str(out), **values})


def _fitted_samples(samples: int, fraction: float) -> int:
    return max(math.ceil(fraction * samples), 2)


def _log(episode: "Episode", number: int, args: Identify) -> "Log":
    from twin.evaluation.reading import complete_ranges
    from twin.hysteresis import PrandtlIshlinskii
    from twin.identification.nuisances import Log, determines_delay

    has_zero = args.model != PrandtlIshlinskii.name
    # A phase is played at a rate of our choice: a delay has no meaning there.
    has_clock = episode.is_measured and episode.metadata.get("seconds_per_cycle") is None
    has_offset, has_delay = (setting == "on" for setting in (args.offset, args.delay))
    if args.offset == "auto":
        has_offset = episode.is_measured and has_zero
    if args.delay == "auto":
        has_delay = has_clock and determines_delay(episode.pull_mm)
    pieces = complete_ranges(episode, _fitted_samples(len(episode.time), args.fraction))
    return Log(episode.record(number), tuple(pieces), has_offset, has_delay)


def _further_entries(
    args: Identify,
    model: "HysteresisModel",
    episodes: "Sequence[Episode]",
    logs: "Sequence[Log]",
    nuisances: "Nuisances",
) -> dict[str, Any]:
    from twin.evaluation.reading import complete_ranges
    from twin.identification.nuisances import rmse_from

    entries: dict[str, Any] = {}
    if any(log.has_offset for log in logs):
        entries["offsets_deg"] = [
            {"record": log.record.name, "offset_deg": offset if log.has_offset else None}
            for log, offset in zip(logs, nuisances.offsets_deg, strict=True)
        ]
    if any(log.has_delay for log in logs):
        entries["delay_s"] = nuisances.delay_s
    if args.fraction < 1:
        complete = [
            dataclasses.replace(log, pieces=tuple(complete_ranges(episode)))
            for log, episode in zip(logs, episodes, strict=True)
        ]
        first = [_fitted_samples(len(log.record.time), args.fraction) for log in logs]
        entries["fraction"] = args.fraction
        entries["predicted_rmse_deg"] = rmse_from(model, complete, first, nuisances, args.sample_time)
    return entries


def _in_words(values: dict[str, Any]) -> str:
    words = ""
    if "fraction" in values:
        rest = f"{values['predicted_rmse_deg']:.3f} deg where it was not fitted"
        words += f" ({values['fraction']:.0%} of each), {rest}"
    offsets = [one["offset_deg"] for one in values.get("offsets_deg", []) if one["offset_deg"] is not None]
    if offsets:
        low, high = f"{min(offsets):.2f}", f"{max(offsets):.2f}"
        words += f"; offsets from {low} to {high} deg" if len(offsets) > 1 else f"; offset {low} deg"
    if "delay_s" in values:
        words += f"; the command acts {1e3 * values['delay_s']:.0f} ms late"
    return words


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "(" + ", ".join(map(_text, value)) + ")" if isinstance(value, list) else f"{value:.4g}"


main = partial(run_verb, Identify, identify)

if __name__ == "__main__":
    sys.exit(main())
