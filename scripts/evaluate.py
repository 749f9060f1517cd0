"""`endotwin evaluate`: compare all methods under noise, as in the paper, or far beyond it."""

import dataclasses
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rl.comparison.settings import Result, Settings, Suite
from rl.options import PAPER_SAMPLE_TIME
from scripts.command import Summary, command_line, complain, run_verb
from scripts.outputs import output_folder
from scripts.progress import Progress, TrainingProgress

if TYPE_CHECKING:
    from twin.evaluation.score import Score
    from twin.hysteresis import HysteresisModel

MODEL = Path("coleman_hodgdon.json")


@dataclasses.dataclass(frozen=True)
class Evaluate(Settings):
    """Compare methods on test records under noise.

    The suite `paper` has the paper's methods and yardsticks. A learned method that is not given is trained on
    --train and kept with the results; without --train it is left out.

    The suite `full` has every estimator here, eleven noises, two sample times and the limit, an ensemble of
    twins. It makes missing records, models and training runs. All is kept; a stopped run continues.

    The suite `sealed` draws 200 conditions by a hash of the given files and --seed, so that a changed policy
    meets others. Learned methods are compared where they are given or named.

    Examples:
        endotwin evaluate data/test --train data/train --model coleman_hodgdon.json --methods AM --out out/am
        endotwin evaluate data/measured --policy runs/device/policy.onnx --measurements recorded --out out/log
    """

    GROUPS: ClassVar = {
        "Methods": "policy",
        "Measurements": "measurements",
        "Protocol": "seeds",
        "Suites full, untrained and sealed": "preset",
    }


def evaluate(args: Evaluate) -> Summary:
    """Write `evaluation.json`, tables, figures and `tracks.npz`."""
    if args.method_file:
        from twin.estimation.registry import load_method_files

        load_method_files(args.method_file)
    return _full(args) if args.is_full else _paper(args)


def _full(args: Evaluate) -> Summary:
    if args.write_estimates:
        raise ValueError("--write-estimates is for --suite paper")
    recorded = args.measurements == "recorded"
    if args.is_sealed and (args.data or recorded):
        raise ValueError("--suite sealed draws its own conditions: name no records")
    if recorded and not args.data:
        raise ValueError(
            "--measurements recorded: the benchmark's own records have none, name folders of records"
        )
    from rl.comparison.full import SAMPLE_TIMES, full_files, run_full_suite
    from rl.comparison.given import given_files
    from rl.comparison.sealed import SEALED_FILES, run_sealed_suite
    from twin.evaluation.reading import chosen_measurements
    from twin.files.bounds import MOST_WORKERS, check_between

    check_between("workers", args.workers, 0, MOST_WORKERS)
    where = Path.cwd() if args.dask else Path()  # other machines work elsewhere
    times = SAMPLE_TIMES[:1] if args.is_sealed else SAMPLE_TIMES
    settings = vars(args) | {
        "out": where / args.out,
        "data": tuple(where / path for path in args.data),
        "train": args.train and where / args.train,
        "method_file": tuple(where / path for path in args.method_file),
        "sample_time": tuple(sorted({*(args.sample_time or times)}, reverse=True)),
        "seeds": 1 if recorded else args.draws,
        "workers": args.workers or os.cpu_count() or 1,
    }
    suite = Suite(
        **settings,
        trained=given_files([where / path for path in args.policy], None, settings["sample_time"]),
        recorded_variance=_variance(args, recorded),
        origin=_origin(args, args.model),
    )
    if args.is_sealed:
        if len(suite.sample_time) > 1:
            raise ValueError("--sample-time: the sealed suite takes one")
        output_folder(args.out, SEALED_FILES)
        sealed = run_sealed_suite(suite, Progress)
        return _summary(suite, sealed, {"rows": len(sealed.scores)})
    output_folder(args.out, full_files())
    if args.data:
        _say(chosen_measurements("recorded" if recorded else "drawn", args.data)[1])
    result = run_full_suite(suite, Progress)
    return _summary(suite, result, {"rows": len(result.scores)})


def _paper(args: Evaluate) -> Summary:
    if not args.data:
        raise ValueError("no data given: name folders of MCAP files, or files")
    if len(args.sample_time) > 1:
        raise ValueError("--sample-time: only the full suite takes more than one")
    from rl.comparison.given import given_files
    from rl.comparison.paper import PAPER_FILES, run_paper_suite
    from twin.evaluation.reading import chosen_measurements
    from twin.files.atomic import MADE_BY, write_whole
    from twin.hysteresis import ColemanHodgdon
    from twin.report.tables import paper_tables, score_table

    measurements, of_logs = chosen_measurements(args.measurements, args.data)
    recorded = measurements == "recorded"
    times = args.sample_time or (PAPER_SAMPLE_TIME,)
    model, source = _model(args)
    if not (model is None or isinstance(model, ColemanHodgdon)):
        raise ValueError(f"--model {source} is {model.name}: the paper's suite rests on coleman-hodgdon")
    variance = _variance(args, recorded or args.write_estimates)
    settings = vars(args) | {
        "model": source,
        "sample_time": times,
        "seeds": 1 if recorded else args.draws,
        "sensor_variance": variance,
        "workers": 1,
    }
    suite = Suite(
        **settings,
        trained=given_files(args.policy, model, times),
        reference=model,
        recorded_variance=variance if recorded else None,
        origin=_origin(args, source),
    )
    output_folder(args.out, PAPER_FILES)
    _say(of_logs)
    result = run_paper_suite(suite, Progress("evaluate", "group"), TrainingProgress)
    table = score_table if recorded else paper_tables
    shown, written = (_with_trainings(result.scores, fmt, table) for fmt in ("plain", "markdown"))
    write_whole(args.out / "tables.md", f"{written}\n<!-- {MADE_BY} -->\n")
    return _summary(suite, result, {}, shown)


def _summary(suite: Suite, result: Result, more: dict[str, Any], table: str = "") -> Summary:
    path = suite.out / "evaluation.json"
    methods = list(dict.fromkeys(score.method for score in result.scores))
    draws = "recorded measurements" if suite.recorded_variance else f"{suite.seeds} noise seeds"
    line = f"{path}: {len(methods)} methods, {result.records} records, {draws}{result.remark}"
    return Summary(line, {"out": str(path), "methods": methods} | more, table=table)


def _variance(args: Evaluate, recorded: bool) -> float | None:
    """Return R of recorded measurements, as it is given or as the records state it; None without them."""
    from twin.evaluation.reading import common_variance
    from twin.files.bounds import LARGEST_VARIANCE_DEG2

    variance, deviation = args.sensor_variance, args.sensor_zero_deviation_deg
    if not (deviation is None or recorded):
        raise ValueError(
            "--sensor-zero-deviation-deg is for --measurements recorded or --write-estimates: the mean of a "
            "drawn noise is known by its size"
        )
    usable = variance is None or (0 < variance <= LARGEST_VARIANCE_DEG2)
    if not usable or not (variance is None or recorded):
        raise ValueError(
            f"--sensor-variance {variance:g}: must be positive, at most {LARGEST_VARIANCE_DEG2:g}, and is "
            "for --measurements recorded or --write-estimates"
        )
    if variance is not None or not recorded:
        return variance
    variance, stated = common_variance(args.data)
    if not stated:
        unknown = "not every record states the noise of its sensor"
        _say(f"{unknown}: R = {variance:g} deg^2 (--sensor-variance sets it)")
    return variance


def _with_trainings(scores: "list[Score]", fmt: str, table: "Callable[[list[Score], str], str]") -> str:
    from twin.report.tables import training_table

    return "\n\n".join(part for part in (table(scores, fmt), training_table(scores, fmt)) if part)


def _say(line: str) -> None:
    if line:
        complain(f"endotwin evaluate: {line}")


def _origin(args: Evaluate, model: Path | None) -> dict[str, Any]:
    from twin.files.origin import origin_of

    models = (path for path in (args.train, model) if path is not None)
    given = [*args.data, *models, *args.policy, *args.method_file]
    return origin_of(command_line("evaluate", args), list(dict.fromkeys(given)))


def _model(args: Evaluate) -> "tuple[HysteresisModel | None, Path | None]":
    """Return the reference model and its file: given, in the working folder, or inside the first policy.

    None where every policy predicts by twins instead of a model.
    """
    from twin.estimation.learned.trained_file import read_trained_file
    from twin.estimation.load import model_of
    from twin.estimation.registry import find_training
    from twin.hysteresis import load_model

    if args.model is not None or MODEL.is_file() or not args.policy:
        path = args.model or MODEL
        return load_model(path), path
    for path in args.policy:
        if not find_training(read_trained_file(path).agent).on_twins:
            return model_of(path), path
    return None, None


main = partial(run_verb, Evaluate, evaluate)

if __name__ == "__main__":
    sys.exit(main())
