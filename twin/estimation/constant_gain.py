"""The active model with a second, constant gain on the measured residual: eq. 10 with a constant action.

    phi = y - theta_AM(k|k),    X = X_AM + K phi

It is what RAM must pass to show that its policy does more than one number could.
"""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.gaussian import Belief
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.task import TrainingTask
from twin.estimation.tuning import draw_training_episodes
from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]
FIRST_STEP = 0.5  # of the search for the gain, in actions of [-1, 1]


@dataclasses.dataclass(frozen=True)
class ConstantGain(ActiveModel):
    """The active model, moved further towards each measurement; the covariance is left as it is.

    Attributes:
        gain: K: of the angle, and of the model's error [1 / s]; zero: the active model.
    """

    gain: tuple[float, float] = (0.0, 0.0)

    @property
    def states_interval(self) -> bool:
        """False: the covariance is that of the filter below, not of what the gain makes of it."""
        return False

    def update(self, belief: Belief, measurement_deg: Array) -> Belief:
        """Condition the belief on one measurement and add the gain times what is left of the residual."""
        updated = super().update(belief, measurement_deg)
        residual = measurement_deg - updated.mean[0]
        residual = np.where(np.isnan(residual), 0.0, residual)  # without a measurement there is none
        return updated._replace(mean=updated.mean + np.array(self.gain)[:, None] * residual)


def tune_constant_gain(active_model: ActiveModel, task: TrainingTask, seed: int) -> ConstantGain:
    """Return the filter with the constant gain of least RMSE on noisy training records.

    It sees what RAM sees in training, the truth of the training records included. Both gains are searched
    from the middle of [0, 1], as RAM's actions are bounded.

    Args:
        active_model: the filter that the gain is added to.
        task: training records and their noise.
        seed: of the episodes drawn.
    """
    from scipy.optimize import minimize  # imported when used: a table of methods needs none of it

    episodes = draw_training_episodes(task, seed)

    def with_gain(action: Array) -> ConstantGain:
        bend, error = ((np.clip(action, -1, 1) + 1) / 2).tolist()
        return ConstantGain(**vars(active_model), gain=(bend, error))

    def cost(action: Array) -> float:
        estimate = with_gain(action).estimate(
            episodes.pull_mm, episodes.measurement_deg, episodes.initial_bend_deg
        )
        rmse = float(np.sqrt(np.mean((estimate - episodes.bend_deg)[:, 1:] ** 2)))
        return rmse + 10 * float(np.maximum(np.abs(action) - 1, 0).sum())  # no way out of the bounds

    simplex = FIRST_STEP * np.array([[0, 0], [1, 0], [0, 1]])
    options = {"xatol": 0.01, "fatol": 1e-4, "maxfev": 120, "initial_simplex": simplex}
    return with_gain(minimize(cost, np.zeros(2), method="Nelder-Mead", options=options).x)


@dataclasses.dataclass(frozen=True)
class ConstantGainFit:
    """Constant gain with the least RMSE on the training records.

    Attributes:
        key: name in the file of fits.
    """

    key: str = "constant gain"

    def find(self, knowledge: Knowledge) -> dict[str, Any]:
        """Return both gains."""
        start = ActiveModel(knowledge.reference, knowledge.sample_time)
        return {"gain": list(tune_constant_gain(start, knowledge.task, knowledge.seed).gain)}


BEST_GAIN = ConstantGainFit()


def _build(knowledge: Knowledge) -> ConstantGain:
    of_bend, of_error = knowledge.found(BEST_GAIN)["gain"]
    return ConstantGain(knowledge.reference, knowledge.sample_time, gain=(float(of_bend), float(of_error)))


register_method(
    MethodSpec(
        name="Constant gain",
        noise_information="R",
        build=_build,
        models=(ColemanHodgdon.name,),
        fits=(BEST_GAIN,),
    )
)
