"""Identification of hysteresis models from records: arrays in, a fitted model out."""

from collections.abc import Sequence

from twin.errors import InputError
from twin.files.bounds import check_between
from twin.hysteresis import MODELS, BoucWen, ColemanHodgdon, HysteresisModel, PrandtlIshlinskii
from twin.identification.models import (
    identify_bouc_wen,
    identify_coleman_hodgdon,
    identify_prandtl_ishlinskii,
)
from twin.identification.search import NEVER_REVERSES, OnGeneration, Records, mean_square_error

__all__ = ["NEVER_REVERSES", "OPTIMIZERS", "Records", "check_options", "identify", "mean_square_error"]

POPULATIONS = (4, 10_000)  # smallest and largest population of a genetic algorithm
MOST_GENERATIONS = 100_000  # largest number of generations of a genetic algorithm
MOST_THRESHOLDS = 1000  # largest number of plays of a Prandtl-Ishlinskii model

OPTIMIZERS = {
    ColemanHodgdon.name: "pymoo GA, population {population}, generations {generations}",
    BoucWen.name: "pymoo GA, population {population}, generations {generations}, then scipy least_squares",
    PrandtlIshlinskii.name: "scipy nnls",
}
"""Method of the fit of each model, in words for its file."""


def identify(
    records: Records,
    seed: int,
    name: str = ColemanHodgdon.name,
    *,
    monotone: bool = False,
    thresholds_mm: Sequence[float] = (),
    population: int = 80,
    generations: int = 150,
    on_generation: OnGeneration | None = None,
) -> tuple[HysteresisModel, float]:
    """Fit a hysteresis model to all records.

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` of each record; the angle at the first sample is known.
        seed: of the genetic algorithm.
        name: of the model, one of `MODELS`.
        monotone: constrain a Coleman-Hodgdon model to c >= b / 2, so that loops of any size are monotone.
        thresholds_mm: of a Prandtl-Ishlinskii model; if not given, spread evenly over the stroke.
        population: candidates per generation of the genetic algorithm.
        generations: number of generations.
        on_generation: called with the number of the generation and the best RMSE so far [deg].

    Returns:
        The best model and its RMSE over all samples [deg].
    """
    size: dict[str, int] = {"population": population, "generations": generations}
    check_options(name, monotone=monotone, thresholds_mm=thresholds_mm, **size)
    if name == PrandtlIshlinskii.name:
        return identify_prandtl_ishlinskii(records, thresholds_mm=thresholds_mm)
    if name == BoucWen.name:
        return identify_bouc_wen(records, seed, **size, on_generation=on_generation)
    return identify_coleman_hodgdon(records, seed, monotone=monotone, **size, on_generation=on_generation)


def check_options(
    name: str,
    *,
    monotone: bool = False,
    thresholds_mm: Sequence[float] = (),
    population: int = 80,
    generations: int = 150,
) -> None:
    """Check that the model is one of `MODELS` and has the given options, within their bounds."""
    if name not in MODELS:
        raise InputError(f"unknown model {name!r}; valid: {', '.join(MODELS)}")
    if monotone and name != ColemanHodgdon.name:
        raise InputError(f"monotone constrains {ColemanHodgdon.name} models only, not {name}")
    if thresholds_mm and name != PrandtlIshlinskii.name:
        raise InputError(f"thresholds belong to {PrandtlIshlinskii.name} models only, not to {name}")
    if len(thresholds_mm) > MOST_THRESHOLDS:
        raise InputError(
            f"thresholds_mm: {len(thresholds_mm)} are given, at most {MOST_THRESHOLDS} are taken"
        )
    check_between("population", population, *POPULATIONS)
    check_between("generations", generations, 1, MOST_GENERATIONS)
