"""An estimator of your own, compared with others by one command.

endotwin evaluate data/test --train data/train --model coleman_hodgdon.json \
    --methods C-H AM AM-tuned Complementary --method-file my_filter.py --out results
"""

import dataclasses

import numpy as np

from twin.estimation.estimator import Estimator
from twin.estimation.registry import MethodSpec, register_method
from twin.hysteresis import ColemanHodgdon


@dataclasses.dataclass(frozen=True)
class Complementary(Estimator[np.ndarray]):
    """A model of hysteresis, corrected by a constant share of what each measurement differs from it."""

    model: ColemanHodgdon
    share: float = 0.2

    def start(self, pull_mm, bend_deg):
        """Return the state before the first sample."""
        return bend_deg.copy()

    def step(self, state, pull_mm, previous_pull_mm, measurement_deg):
        """Return the state after one sample; a measurement that is NaN is missing."""
        predicted, _ = self.model.step(state, np.empty((0, len(state))), pull_mm, previous_pull_mm)
        return predicted + self.share * np.nan_to_num(measurement_deg - predicted)

    def bend_deg(self, state):
        """Return the estimated angle."""
        return state


def build(known):
    """Return the estimator from what may be known before the test."""
    return Complementary(known.reference)


register_method(MethodSpec("Complementary", build, (), models=(ColemanHodgdon.name,)))
