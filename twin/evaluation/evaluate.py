"""Evaluation of estimators in one call, as a notebook needs it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from twin.errors import InputError
from twin.estimation.estimator import Estimator
from twin.evaluation.compare import evaluate as compare
from twin.evaluation.method import as_method
from twin.evaluation.protocol import Protocol
from twin.evaluation.reading import evaluation_records
from twin.evaluation.recorded import chosen_measurements, common_variance
from twin.evaluation.score import Score


def evaluate(
    data: str | Path | Sequence[str | Path],
    estimators: Mapping[str, Estimator[Any]],
    *,
    suite: str = "paper",
    seeds: int = 20,
    sample_time: float = 0.1,
    initial_error_deg: float = 20.0,
    seed: int = 0,
    measurements: Literal["auto", "drawn", "recorded"] = "auto",
    variance: float | None = None,
) -> list[Score]:
    """Run estimators on records under noise and score them against the true angle.

    Args:
        data: folders of MCAP files, or files.
        estimators: by the names that the scores shall have.
        suite: `paper`, `paper-only` or `full`, which say the noises.
        seeds: draws of each noise.
        sample_time: T; records are thinned to it [s].
        initial_error_deg: error of the initial estimate [deg].
        seed: of the draws.
        measurements: `drawn`, the truth and noise drawn anew, or `recorded`, once, as the sensor saw it;
            `auto` is recorded where every record is a measured log, else drawn.
        variance: R that is told with recorded measurements; if not given, as the records tell it [deg^2].

    Returns:
        One score for each estimator, noise, stroke and kind of twin.

    Raises:
        FileNotFoundError: a path does not exist or a folder holds no MCAP file.
        ValueError: there is no estimator, a file is damaged, or an option is out of range.
    """
    given = [data] if isinstance(data, str | Path) else list(data)
    paths = [Path(path) for path in given]
    if not estimators:
        raise InputError("no estimator given: name at least one, as in {'my filter': estimator}")
    if not paths:
        raise InputError("no data given: name folders of MCAP files, or files")
    recorded = chosen_measurements(measurements, paths)[0] == "recorded"
    if recorded:
        variance = common_variance(paths)[0] if variance is None else variance
    protocol = Protocol(
        suite, 1 if recorded else seeds, sample_time, initial_error_deg, seed, variance if recorded else None
    )
    methods = [as_method(name, estimator) for name, estimator in estimators.items()]
    scores, *_ = compare(evaluation_records(paths, sample_time), methods, protocol)
    return scores
