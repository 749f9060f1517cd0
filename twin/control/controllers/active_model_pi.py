"""Linear map and PI on the estimate of the active model (AM) with tuned noise."""

import functools
from collections.abc import Mapping

from twin.control.feedback import PI_SETTINGS, EstimateFeedback
from twin.control.knowledge import ControlKnowledge
from twin.control.registry import ControllerSpec, register_controller
from twin.estimation.registry import Style
from twin.live.online import OnlineEstimator


def build(knowledge: ControlKnowledge, settings: Mapping[str, float]) -> EstimateFeedback:
    """Return the controller of a run."""
    make_estimator = functools.partial(OnlineEstimator, knowledge.active_model, knowledge.sample_time)
    return EstimateFeedback(knowledge, make_estimator, settings)


ACTIVE_MODEL_PI = register_controller(
    ControllerSpec(
        "active-model-pi",
        3,
        "estimate of AM-tuned",
        build,
        PI_SETTINGS,
        style=Style("#1f5fa8", "solid", ""),
    )
)
