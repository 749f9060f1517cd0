"""Means over scores: one figure for many noises, strokes and twins."""

from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

import numpy as np

from twin.evaluation.metrics import geometric_mean
from twin.evaluation.score import Score

Kind = TypeVar("Kind", bound=Hashable)


def rmse_by(scores: Sequence[Score], kind_of: Callable[[Score], Kind]) -> dict[Kind, float]:
    """Return the geometric mean of the RMSE [deg] of the scores of each kind, in the order of the kinds."""
    kinds: dict[Kind, list[float]] = {}
    for score in scores:
        kinds.setdefault(kind_of(score), []).append(score.rmse_deg)
    return {kind: float(geometric_mean(np.array(errors))) for kind, errors in kinds.items()}


def mean_coverage(scores: Sequence[Score]) -> float | None:
    """Return the mean share of samples whose 95 % interval held the truth; None where none is stated."""
    held = [score.coverage95 for score in scores if score.coverage95 is not None]
    return float(np.mean(held)) if held else None
