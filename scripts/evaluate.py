"""`endotwin evaluate`: compare all methods under noise, as in the paper, or far beyond it."""

import dataclasses
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from rl.options import TrainingOptions
from scripts.command import Options, Summary, command_line, complain, options_of, run_verb
from scripts.outputs import output_folder
from scripts.progress import Progress, TrainingProgress

if TYPE_CHECKING:
    from twin.evaluation.score import Score
    from twin.hysteresis import HysteresisModel

MODEL = Path("coleman_hodgdon.json")
PAPER_SAMPLE_TIME = 0.1


@dataclasses.dataclass(frozen=True)
class Evaluate(Options):
    """Compare methods on test records under noise.

    The suite `paper` has the paper's methods and yardsticks. A learned method that is not given is trained on
    --train and kept with the results; without --train it is left out.

    The suite `full` has every estimator here, eleven noises, two sample times and the limit, an ensemble of
    twins. It makes missing records, models and training runs. All is kept; a stopped run continues.
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Test set: folders of MCAP files, or files. The full suite simulates its own without them."""
    out: Path
    """Folder for evaluation.json, tables, figures and tracks."""
    model: Path | None = None
    """Reference model, as `endotwin identify` writes it; if not given, coleman_hodgdon.json, or the model
    that the first policy was trained with. The full suite identifies its own."""
    train: Path | None = None
    """Training set, to train what is not given and to tune the yardsticks."""
    policy: tuple[Path, ...] = ()
    """Trained files of any method, as `endotwin train` writes them: policy.onnx, lstm.onnx ... One that was
    trained at one sample time runs at that one alone (--sample-time). Several of one method that differ in
    their seed alone are one row: the mean over them, and their spread."""
    methods: tuple[str, ...] = ()
    """Names of the methods to compare, as in the tables; all of the suite, if not given. In the full suite,
    `all` has those too that it otherwise has on request, and trains what is not given."""
    method_file: tuple[Path, ...] = ()
    """Python files that register estimators of your own (`register_method`), to compare them too; each is
    run."""
    suite: str = "paper"
    """paper: its five noises, and the Poisson ones with dither; paper-only: its five; full;
    untrained: as full, with faults of the sensor and twins that no training meets."""
    measurements: Literal["auto", "drawn", "recorded"] = "auto"
    """drawn: the truth with drawn noise; recorded: what the sensor of the record saw, once. auto:
    recorded where all records are measured logs, else drawn; the full suite draws, unless given."""
    sensor_variance: float | None = None
    """R of recorded measurements [deg^2]; if not given, as the records state it, else 0.1."""
    write_estimates: tyro.conf.FlagCreatePairsOff[bool] = False
    """Also write each record into OUT/estimates with /estimate/METHOD: what methods make of its recorded
    measurements."""
    seeds: int = 20
    """Draws of the noise."""
    sample_time: tuple[float, ...] = ()
    """T [s]; records are thinned to it. Without it, 0.1, and in the full suite 0.1 and 0.02."""
    initial_error_deg: float = 20.0
    """Error of the initial estimate [deg]."""
    episodes: int = TrainingOptions.episodes
    """Episodes of PPO for a policy that is not given (full suite: at T = 0.1; as many samples at others)."""
    preset: str = "ureteroscope"
    """Full suite: the twin of records and ensembles, and the ranges that they are drawn from."""
    trainings: int = 1
    """Full suite: trainings of each learned method that is not given, with --seed and those that follow; a
    row is the mean over them, with the spread."""
    members: int = 256
    """Full suite: twins in an ensemble."""
    ensembles: int = 1
    """Full suite: ensembles of other twins, each; their rows are means over them, with the spread."""
    member_physics: Literal["reduced", "mujoco"] = "reduced"
    """Full suite: what they are; the records are always of the twin in MuJoCo."""
    seconds: float = 60.0
    """Full suite: length of the records that it simulates."""
    workers: int = 0
    """Full suite: processes; 0 for one per core. The results do not depend on it."""
    dask: str | None = None
    """Full suite: address of a Dask scheduler, whose workers see all files under the same path."""
    seed: int = 0
    """Of everything that is drawn."""


def evaluate(args: Evaluate) -> Summary:
    """Write `evaluation.json`, tables, figures and `tracks.npz`."""
    if args.method_file:
        from twin.estimation.registry import load_method_files

        load_method_files(args.method_file)
    return _full(args) if args.suite in ("full", "untrained") else _paper(args)


def _full(args: Evaluate) -> Summary:
    if args.write_estimates:
        raise ValueError("--write-estimates is for --suite paper")
    recorded = args.measurements == "recorded"
    if recorded and not args.data:
        raise ValueError(
            "--measurements recorded: the benchmark's own records have none, name folders of records"
        )
    from rl.comparison.full import SAMPLE_TIMES, FullSuite, full_files, run_full_suite
    from rl.comparison.given import given_files
    from twin.evaluation.reading import chosen_measurements
    from twin.files.bounds import MOST_WORKERS, check_between

    check_between("workers", args.workers, 0, MOST_WORKERS)
    sample_times = tuple(sorted({*(args.sample_time or SAMPLE_TIMES)}, reverse=True))
    where = Path.cwd() if args.dask else Path()  # other machines work elsewhere
    given: dict[str, Any] = options_of(FullSuite, args) | {
        "data": tuple(where / path for path in args.data),
        "train": None if args.train is None else where / args.train,
        "seeds": 1 if recorded else args.seeds,
        "workers": args.workers or os.cpu_count() or 1,
    }
    suite = FullSuite(
        folder=where / args.out,
        method_files=tuple(where / path for path in args.method_file),
        sample_times=sample_times,
        trained=given_files([where / path for path in args.policy], None, sample_times),
        recorded_variance=_variance(args, recorded),
        origin=_origin(args, args.model),
        **given,
    )
    output_folder(args.out, full_files())
    if args.data:
        _say(chosen_measurements("recorded" if recorded else "drawn", args.data)[1])
    result = run_full_suite(suite, Progress)
    methods = list(dict.fromkeys(score.method for score in result.scores))
    draws = "recorded measurements" if recorded else f"{args.seeds} noise seeds"
    test_set = f" (the frozen test set {result.test_set})" if result.test_set else ""
    line = f"{result.path}: {len(methods)} methods, {result.records} records{test_set}, {draws}"
    return Summary(line, {"out": str(result.path), "methods": methods, "rows": len(result.scores)})


def _paper(args: Evaluate) -> Summary:
    if not args.data:
        raise ValueError("no data given: name folders of MCAP files, or files")
    if len(args.sample_time) > 1:
        raise ValueError("--sample-time: only the full suite takes more than one")
    from rl.comparison.given import given_files
    from rl.comparison.paper import PAPER_FILES, PaperSuite, run_paper_suite
    from rl.options import LIMITS
    from twin.estimation.registry import find_method
    from twin.evaluation.protocol import Protocol
    from twin.evaluation.reading import DEFAULT_VARIANCE, chosen_measurements
    from twin.files.atomic import MADE_BY, write_whole
    from twin.files.bounds import check_between
    from twin.hysteresis import ColemanHodgdon
    from twin.report.figures import paper_figures, rmse_figure, to_png_bytes
    from twin.report.tables import paper_tables, score_table

    for name in args.methods:
        find_method(name)
    check_between("episodes", args.episodes, *LIMITS["episodes"])
    measurements, of_logs = chosen_measurements(args.measurements, args.data)
    recorded = measurements == "recorded"
    T = args.sample_time[0] if args.sample_time else PAPER_SAMPLE_TIME
    protocol = Protocol(args.suite, args.seeds, T, args.initial_error_deg, args.seed)
    model, source = _model(args)
    if not (model is None or isinstance(model, ColemanHodgdon)):
        raise ValueError(f"--model {source} is {model.name}: the paper's suite rests on coleman-hodgdon")
    trained = given_files(args.policy, model, [T])
    variance = _variance(args, recorded or args.write_estimates)
    if recorded:
        protocol = dataclasses.replace(protocol, seeds=1, recorded_variance=variance)
    given: dict[str, Any] = options_of(PaperSuite, args) | {"model": model}
    suite = PaperSuite(
        folder=output_folder(args.out, PAPER_FILES),
        protocol=protocol,
        trained=trained,
        source=source,
        recorded_variance=DEFAULT_VARIANCE if variance is None else variance,
        origin=_origin(args, Path(source) if source else None),
        **given,
    )
    _say(of_logs)
    result = run_paper_suite(suite, Progress("evaluate", "group"), TrainingProgress)
    table = score_table if recorded else paper_tables
    shown, written = (_with_trainings(result.scores, fmt, table) for fmt in ("plain", "markdown"))
    write_whole(args.out / "tables.md", f"{written}\n<!-- {MADE_BY} -->\n")
    write_whole(args.out / "rmse.png", to_png_bytes(rmse_figure(result.scores)))
    for number, (figure, _) in paper_figures(result.tracks, result.scores).items():
        write_whole(args.out / f"figure_{number:02d}.png", to_png_bytes(figure))
    draws = "recorded measurements" if recorded else f"{args.seeds} noise seeds"
    path = args.out / "evaluation.json"
    line = f"{path}: {len(result.methods)} methods, {result.records} records, {draws}"
    if result.estimates:
        line += f"; estimates in {args.out}/estimates"
    values = {"out": str(path), "methods": result.methods}
    return Summary(line, values, table=shown)


def _variance(args: Evaluate, recorded: bool) -> float | None:
    """Return R of recorded measurements, as it is given or as the records state it; None without them."""
    from twin.evaluation.reading import common_variance
    from twin.files.bounds import LARGEST_VARIANCE_DEG2

    variance = args.sensor_variance
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
    """Return a table, and below it the spread between training runs, where a method has several."""
    from twin.report.tables import training_table

    return "\n\n".join(part for part in (table(scores, fmt), training_table(scores, fmt)) if part)


def _say(line: str) -> None:
    if line:
        complain(f"endotwin evaluate: {line}")


def _origin(args: Evaluate, model: Path | None) -> dict[str, Any]:
    """Return the command of the results, and the hashes of all that they are made from."""
    from twin.files.origin import origin_of

    models = (path for path in (args.train, model) if path is not None)
    given = [*args.data, *models, *args.policy, *args.method_file]
    return origin_of(command_line("evaluate", args), list(dict.fromkeys(given)))


def _model(args: Evaluate) -> "tuple[HysteresisModel | None, str]":
    """Return the reference model and its file: given, in the working folder, or inside the first policy.

    None where every policy predicts by twins instead of a model.
    """
    from twin.estimation.learned.trained_file import read_trained_file
    from twin.estimation.load import model_of
    from twin.estimation.registry import find_training
    from twin.hysteresis import load_model

    if args.model is not None or MODEL.is_file() or not args.policy:
        path = args.model or MODEL
        return load_model(path), str(path)
    for path in args.policy:
        if not find_training(read_trained_file(path).agent).on_twins:
            return model_of(path), str(path)
    return None, ""


main = partial(run_verb, Evaluate, evaluate)

if __name__ == "__main__":
    sys.exit(main())
