"""Trainings and searches cut short, for tests whose assertions do not depend on how good their ends are."""

from typing import Any

import pytest
from scipy import optimize

from rl.supervised import SequenceTraining

STEPS = 20
EVALUATIONS = 150


def train_networks(patch: pytest.MonkeyPatch) -> None:
    """Networks are trained by few steps, unless a test says by how many."""
    _, *others = SequenceTraining.__init__.__defaults__
    patch.setattr(SequenceTraining.__init__, "__defaults__", (STEPS, *others))


def tune_filters(patch: pytest.MonkeyPatch) -> None:
    """Filters are tuned by few evaluations of their likelihood or RMSE."""

    def minimize(*args: Any, options: dict[str, Any], **others: Any) -> Any:
        most = min(options["maxfev"], EVALUATIONS)
        return optimize.minimize(*args, options=options | {"maxfev": most}, **others)

    patch.setattr("twin.estimation.tuning.minimize", minimize)
